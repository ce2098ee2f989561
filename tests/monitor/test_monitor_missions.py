"""What a task is worth by its completion time, and what energy costs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from monitor import Energy, Mission, News, Value

KINDS = st.sampled_from(["linear", "exponential", "soft", "hard"])
POSITIVE = st.floats(0.1, 1e4)


@given(KINDS, POSITIVE, POSITIVE, st.lists(st.floats(0, 1e5), min_size=2))
def test_the_value_of_a_task_never_rises_with_time_and_never_leaves_its_range(
    kind, worth, seconds, times
):
    values = Value(kind, worth, seconds)(np.sort(times))
    assert (np.diff(values) <= 1e-9).all()
    assert (values >= 0).all()
    assert (values <= worth + 1e-9).all()


@given(KINDS, POSITIVE, POSITIVE)
def test_a_task_is_worth_nothing_after_its_deadline(kind, worth, seconds):
    value = Value(kind, worth, seconds)
    if np.isfinite(value.deadline):
        assert value(value.deadline * 1.001) == 0
    assert value(0.0) == worth


def test_value_counts_only_if_the_goal_was_reached_and_energy_always():
    mission = Mission(Value("linear", 100, 100), Energy(0.5, 1, 1))
    assert mission.net(True, 50, 10) == pytest.approx(50 - 5)
    assert mission.net(False, 50, 10) == pytest.approx(-5)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Value("cubic", 1, 1), "value.kind"),
        (lambda: Value("linear", -1, 1), "value.worth"),
        (lambda: Value("linear", 1, float("nan")), "value.seconds"),
        (lambda: Energy(-1, 0, 0), "energy.price"),
        (lambda: Mission(Value("linear", 1, 1), Energy(0, 0, 0), speeds=(2, 1)), "speeds"),
        (lambda: Mission(Value("linear", 1, 1), Energy(0, 0, 0), job=-1), "job"),
    ],
)
def test_constants_that_make_no_sense_are_named(make, told):
    with pytest.raises(AnytimeError, match=told):
        make()


@given(st.floats(0, 200), st.floats(0, 50))
def test_what_is_known_at_a_time_is_what_counts_then(time, energy):
    before, after = Value("soft", 100.0, 80.0), Value("hard", 40.0, 60.0)
    mission = Mission(before, Energy(0.2, 0.08, 0.03), news=News(20.0, after))
    known = mission.known(time)
    assert known.news is None
    assert known.value == (after if time >= 20.0 else before)
    assert mission.net(True, time, energy) == known.net(True, time, energy)
    assert known.known(time) == known
