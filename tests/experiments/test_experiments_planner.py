"""Races of planners: what they count, and that every planner gets to the end."""

import numpy as np
import pytest

from experiments.benchmarks.planner_drawing import draw
from experiments.benchmarks.planner_races import Problem, curve, race, share_at, timed
from experiments.benchmarks.planner_rivals import PLANNERS

SHARES = np.linspace(0.0, 3.0, 50)


@pytest.fixture(scope="module", params=["r20", "rooms"])
def raced(request):
    return [race(Problem(request.param, 96, index), tuple(PLANNERS)) for index in range(3)]


def test_those_that_end_with_a_proof_end_with_the_shortest(raced):
    for each in raced:
        assert each.final["atp"] == pytest.approx(1.0, abs=1e-4)
        for name in ("ara", "rwa"):  # they are stopped after half as much again as A*
            assert 0.9 < each.final[name] <= 1.0 + 1e-4


def test_curves_rise_and_begin_at_nothing(raced):
    for name in PLANNERS:
        quality = curve(raced, name, SHARES)
        assert quality[0] == 0.0
        assert (np.diff(quality) >= 0).all()
        assert quality[-1] <= 1.0 + 1e-4


def test_a_level_is_reached_where_the_curve_reaches_it(raced):
    tracks = [each.tracks["atp"] for each in raced]
    share = share_at(tracks, 0.97)
    assert curve(raced, "atp", np.array([share]))[0] >= 0.97
    assert curve(raced, "atp", np.array([share - 1e-9]))[0] < 0.97
    assert share_at(tracks, 1.5) is None


def test_a_problem_that_is_too_small_is_left_out():
    assert race(Problem("r20", 64, 0), ("atp",), least=10**6) is None


def test_time_is_told_for_plans_in_their_order(raced):
    for each in raced:
        moments = [moment for moment, _ in timed(each, repeats=1)]
        assert moments == sorted(moments)
        assert all(moment > 0 for moment in moments)


def test_the_picture_is_drawn(raced, tmp_path):
    against_time = {"some": [timed(each, repeats=1) for each in raced]}
    drawn = draw({"some": raced, "none": []}, against_time, tmp_path / "a.png")
    assert drawn.read_bytes().startswith(b"\x89PNG")
