"""Machines: seconds per unit of work, by module and by step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
from anytime import AnytimeError, Machine, WorkClock
from anytime.machines import STEP_BINS, Rate, charged_rate, step_bin, stepped_rate


@given(st.integers(0, 10**7))
def test_every_step_has_one_bin_and_bins_do_not_go_back(step):
    assert STEP_BINS[step_bin(step)] <= step
    assert step_bin(step) <= step_bin(step + 1) < len(STEP_BINS) == 32


@given(st.lists(st.tuples(st.floats(0.01, 100), st.floats(0, 10)), min_size=1, max_size=30))
def test_a_charged_rate_accounts_for_all_seconds(samples):
    rate = charged_rate(samples)
    work, seconds = (sum(column) for column in zip(*samples, strict=True))
    assert rate.per_work * work == pytest.approx(seconds)
    assert rate.p95_over_mean >= 1
    assert rate.steps == len(samples)


def test_steps_without_work_have_no_rate():
    assert charged_rate([(0, 1.0)]) == Rate()
    assert stepped_rate([]) == Rate()


def test_a_ladder_keeps_the_time_of_each_step():
    rate = stepped_rate([(step, 0.1 * 4**step) for _ in range(5) for step in range(4)])
    machine = Machine("m", {"see": rate})
    assert [machine.seconds("see", 1, s) for s in range(4)] == pytest.approx([0.1, 0.4, 1.6, 6.4])
    assert machine.seconds("see", 1, 1000) == pytest.approx(6.4)
    assert machine.elapsed("see", np.array([0.0, 1, 2, 4])) == pytest.approx([0, 0.1, 0.5, 8.5])


def test_a_step_that_was_never_measured_takes_as_long_as_the_one_before():
    rate = stepped_rate([(0, 1.0), (3, 5.0)])
    assert rate.per_step == (1.0, 1.0, 1.0, 5.0)


@given(
    rates=st.lists(st.floats(0, 10), min_size=1, max_size=32),
    work=st.lists(st.integers(0, 300), max_size=10),
)
def test_more_work_never_ends_earlier(rates, work):
    machine = Machine("m", {"see": Rate(0.0, tuple(rates), 1.0, 9)})
    ends = machine.elapsed("see", np.sort(np.array(work, dtype=float)))
    assert (np.diff(ends) >= 0).all()
    clock = WorkClock(machine)
    for step in range(max(work, default=0)):
        clock.spend("see", 1.0, step)
    if work:
        assert ends[-1] == pytest.approx(clock.now())


def test_a_rate_is_finite_and_not_negative():
    for rate in (-1.0, float("nan"), float("inf")):
        with pytest.raises(AnytimeError, match="finite seconds"):
            Machine("m").with_rate("see", rate)


def test_a_profile_moves_to_another_machine_with_its_qualities():
    @anytime.module(quality=lambda value: value)
    def see(truth):
        for value in (0.2, 0.5, truth):
            anytime.charge(10)
            yield value

    class Problem:
        truth = 0.9

    slow, fast = (Machine(n).with_rate("see", r) for n, r in (("slow", 0.2), ("fast", 0.1)))
    library = anytime.measure(see, [Problem()], seconds=100, clock=lambda: WorkClock(slow))
    moved = library.on(fast)
    times = np.linspace(0, 7, 50)
    assert moved.machine.name == moved["see"].machine == "fast"
    assert moved["see"].mean(times / 2) == pytest.approx(library["see"].mean(times))
    assert moved["see"].recordings[0].end == (3.0, 30.0)


def test_its_text_names_every_module():
    machine = Machine("m", {"walk": Rate(0.001), "see": Rate(0, (0.1, 0.2), 1.5, 8)})
    assert "see" in repr(machine)
    assert "walk" in repr(machine)
    assert max(map(len, repr(machine).splitlines())) <= 100
