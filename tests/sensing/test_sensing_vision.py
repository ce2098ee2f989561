"""Anytime vision: nothing before Ta, quality as promised, never worse with more time [ZR93] §2."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime.errors import AnytimeError
from anytime.machines import Machine, Rate
from sensing import Camera, Look, Sensor, Vision, looks, see, sense, uniform

FREE = uniform((90, 90), 0.2, np.random.default_rng(0))


@settings(max_examples=30)
@given(st.floats(0.5, 1), st.integers(0, 10_000))
def test_the_share_of_wrong_cells_is_one_minus_the_quality(quality, seed):
    sensed = sense(FREE, (45, 45), 32, quality, np.random.default_rng(seed))
    cells = int(sensed.inside.sum())
    wrong = round((1 - sensed.score(FREE).quality) * cells)
    expected = cells * (1 - quality)
    assert abs(wrong - expected) <= 6 * (expected * quality) ** 0.5 + 1e-6


def test_free_and_blocked_cells_are_misread_alike():
    sensed = sense(FREE, (45, 45), 44, 0.8, np.random.default_rng(1))
    result = sensed.score(FREE)
    assert result.false_free == pytest.approx(0.2, abs=0.04)
    assert result.false_blocked == pytest.approx(0.2, abs=0.02)


def test_a_perfect_look_is_the_truth_and_the_disc_is_cut_at_the_edge():
    sensed = sense(FREE, (0, 89), 10, 1.0, np.random.default_rng(0))
    assert sensed.window == (0, 79)
    assert sensed.blocked.shape == (11, 11)
    assert sensed.score(FREE).quality == 1.0
    assert not sensed.blocked[~sensed.inside].any()


@pytest.mark.parametrize("concave", [True, False])
def test_quality_runs_from_qa_at_ta_to_qb_at_tb(concave):
    vision = Vision(t_a=2.5, t_b=10, q_a=0.7, q_b=0.95, concave=concave)
    assert vision.quality(2.4) is None
    assert vision.quality(2.5) == pytest.approx(0.7)
    assert vision.quality(10) == vision.quality(1e9) == 0.95
    rising = [vision.quality(time) or 0.0 for time in np.linspace(2.5, 10, 50)]
    assert all(after > before for before, after in pairwise(rising))
    middle = vision.quality(6.25) or 0.0
    assert middle > 0.88 if concave else middle == pytest.approx(0.825)


def test_there_is_no_description_before_ta():
    seen = list(Vision(t_a=4, t_b=9).look(FREE, (45, 45), 8, np.random.default_rng(0)))
    assert [sensed is None for sensed in seen] == [True] * 3 + [False] * 6


@given(st.integers(0, 1000))
def test_a_cell_once_right_stays_right(seed):
    vision = Vision(t_a=2, t_b=12, q_a=0.6)
    truth = ~FREE
    right = None
    for sensed in vision.look(FREE, (45, 45), 12, np.random.default_rng(seed)):
        if sensed is None:
            continue
        now = (sensed.blocked == truth[sensed.slices]) | ~sensed.inside
        assert right is None or not (right & ~now).any()
        right = now
    assert right is not None
    assert right.all()


def test_a_look_broken_off_is_the_glance_of_that_quality():
    vision = Vision(t_a=2, t_b=12)
    for sensed in vision.look(FREE, (45, 45), 12, np.random.default_rng(3)):
        if sensed is not None:
            again = sense(FREE, (45, 45), 12, sensed.quality, np.random.default_rng(3))
            assert np.array_equal(again.blocked, sensed.blocked)


def test_with_falloff_the_edge_is_seen_worse_than_the_middle():
    sensed = sense(FREE, (45, 45), 32, 0.95, np.random.default_rng(0), falloff=0.8)
    assert sensed.confidence is not None
    assert sensed.confidence[32, 32] == pytest.approx(0.95)
    assert sensed.confidence[32, 0] == pytest.approx(0.59)
    assert sensed.quality == pytest.approx(sensed.score(FREE).quality, abs=0.03)


def test_two_runs_give_the_same_bytes():
    first, second = (
        sense(FREE, (45, 45), 32, 0.8, np.random.default_rng(5)).blocked.tobytes() for _ in range(2)
    )
    assert first == second


@pytest.mark.parametrize(
    ("numbers", "complaint"),
    [
        ({"t_a": 0.0}, "0 < t_a <= t_b"),
        ({"t_a": 9.0, "t_b": 8.0}, "0 < t_a <= t_b"),
        ({"t_b": float("inf")}, "0 < t_a <= t_b"),
        ({"q_a": 0.4}, "0.5 <= q_a"),
        ({"q_a": 0.9, "q_b": 0.8}, "q_a <= q_b"),
        ({"q_a": float("nan")}, "q_a <= q_b"),
        ({"falloff": 2.0}, "from 0 to 1"),
    ],
)
def test_a_sensor_that_can_not_be_is_refused(numbers, complaint):
    with pytest.raises(AnytimeError, match=complaint):
        Vision(**numbers)


def test_a_quality_that_is_no_probability_is_refused():
    with pytest.raises(AnytimeError, match="probability"):
        sense(FREE, (45, 45), 8, 1.2, np.random.default_rng(0))


@pytest.mark.parametrize("device", [Vision(t_a=3, t_b=8), Camera(last=8)])
def test_seeing_is_an_anytime_module(device):
    problem = Look(Sensor(FREE, (45, 45), 12, device))
    result = anytime.run(see, problem.sensor, seconds=60.0)
    assert result.status is anytime.Status.COMPLETE
    assert result.value is not None
    assert see.score(result.value, problem) == result.value.score(FREE).quality
    assert len(result.history) == 6


@pytest.mark.parametrize(("seconds", "quality"), [(0.9, None), (1.51, 0.75), (2.51, 0.85)])
def test_time_buys_exposures_and_exposures_buy_quality(seconds, quality):
    vision = Vision(t_a=3, t_b=8, concave=False)
    clock = anytime.WorkClock(Machine("slow", {"see": Rate(per_work=0.5)}))
    sensor = Sensor(FREE, (45, 45), 12, vision)
    result = anytime.run(see, sensor, deadline=anytime.Deadline.after(seconds, clock))
    seen = None if result.value is None else result.value.quality
    assert seen == (None if quality is None else pytest.approx(quality))


def test_the_profile_of_seeing_is_that_of_the_sensor():
    vision = Vision(t_a=3, t_b=12, concave=False)
    problems = list(looks(np.random.default_rng(0), 6, vision, radius=24))
    profile = anytime.measure(see, problems, seconds=60.0)["see"]
    for recording in profile.recordings:
        assert recording.work[0] == 3
        assert recording.work[-1] == 12
        promised = [vision.quality(work) for work in recording.work]
        assert recording.raw == pytest.approx(promised, abs=0.05)
        assert recording.estimates == pytest.approx(promised)


def test_problems_are_as_many_and_as_cluttered_as_asked_for():
    problems = list(looks(np.random.default_rng(0), 3, radius=20, density=0.3))
    assert len(problems) == 3
    assert np.mean([problem.sensor.free.mean() for problem in problems]) == pytest.approx(
        0.7, abs=0.03
    )
