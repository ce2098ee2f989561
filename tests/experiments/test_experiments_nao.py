"""The NAO's benchmark: worlds that can be crossed, shares with bounds, another engine's word."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.benchmarks import nao_oracle
from experiments.benchmarks.figures import share_bounds, share_interval
from experiments.benchmarks.nao_worlds import Life, Outcome, figures, random_world, reachable
from monitor.endings import Ending
from monitor.robots.nao_scenes import Goal, Scene
from monitor.robots.nao_world import Obstacle


def test_the_bounds_of_a_share_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(0)
    for truth in (0.02, 0.5, 0.97):
        bounds = [share_bounds(int(rng.binomial(30, truth)), 30) for _ in range(2000)]
        assert np.mean([low <= truth <= high for low, high in bounds]) >= 0.95
    assert share_bounds(30, 30)[1] == 1.0
    assert share_bounds(0, 30)[0] == 0.0
    assert share_interval("a", [True, False])["a"] == 0.5


def test_a_world_repeats_and_its_goal_can_be_reached():
    assert random_world(3) == random_world(3) != random_world(4)
    assert all(reachable(random_world(seed)) for seed in range(10))


def test_a_goal_in_a_box_cannot_be_reached_until_a_wall_is_left_out():
    goal, half = (2.0, 0.0), 0.4
    walls = [
        Obstacle((goal[0] + x, goal[1] + y), size=size)
        for x, y, size in (
            (half, 0.0, (0.1, 0.9)),
            (-half, 0.0, (0.1, 0.9)),
            (0.0, half, (0.9, 0.1)),
            (0.0, -half, (0.9, 0.1)),
        )
    ]
    closed = Scene(goal=Goal(goal), obstacles=tuple(walls))
    assert not reachable(closed)
    assert reachable(Scene(goal=Goal(goal), obstacles=tuple(walls[1:])))


def test_only_worlds_whose_goal_can_be_reached_count():
    good = Life(Ending.REACHED, 0.01, 0.02, 0)
    missed = Life(Ending.BLOCKED, 0.3, 0.3, 0)
    told = figures(
        [Outcome(True, good, missed, good, good), Outcome(False, missed, missed, None, None)]
    )
    assert told["worlds.reachable"] == 0.5
    assert told["worlds.monitored_success"] == 1.0
    assert told["worlds.unmonitored_missed"] == 1.0
    assert told["worlds.unmonitored_missed_median_m"] == 0.3
    assert told["worlds.monitored_success_low"] < 1.0


@pytest.mark.slow
def test_another_engine_in_space_sees_the_same_distances_and_contacts():
    if not nao_oracle.available():
        pytest.skip(nao_oracle.MISSING)
    told = nao_oracle.figures(range(40))
    assert told["oracle.readings"] >= 500
    assert told["oracle.within_cm"] >= 0.99
    assert told["oracle.contacts"] >= 15
    assert told["oracle.contacts_within_3_ticks"] == 1.0
