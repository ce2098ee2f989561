"""A robot that listens while it moves: its readings reach the map as they come."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import anytime
from anytime import Deadline, Machine, WorkClock
from experiments.shipped import DATA
from monitor.robots.nao_hearing import Hearing
from monitor.robots.nao_scenes import read_scene
from monitor.robots.simulated_nao import SimulatedNao
from sensing.sonar_map import obstacles, sonar_map

SITTING = read_scene(DATA / "scenes" / "sitting.toml")


def listened(rate, seconds=1.0, posture="Sit"):
    clock = WorkClock(Machine("robot").with_rate("sonar_map", rate))
    nao = SimulatedNao(replace(SITTING, posture=posture), clock)
    nao.walk(0.0, 0.5, 0.0)
    hearing = Hearing(nao, SITTING.sonars)
    return anytime.run(sonar_map, hearing, deadline=Deadline.after(seconds, clock)), nao


@pytest.mark.parametrize("rate", [0.0, 0.02, 0.1])
def test_however_fast_one_thinks_a_reading_is_heard_once(rate):
    result, _ = listened(rate)
    assert result.value.heard in (10, 11)
    times = [change.seconds for change in result.history]
    assert all(after - before == pytest.approx(0.1, abs=0.021) for before, after in pairwise(times))


def test_who_thinks_slowly_hears_less():
    assert listened(0.25)[0].value.heard == 4


def test_the_map_is_made_while_the_robot_walks_and_finds_what_is_in_the_way():
    result, nao = listened(0.02, 6.0, "Stand")
    assert nao.read().pose_in_world[1] > 0.3
    found = obstacles(result.value)
    assert np.hypot(found[:, 0] - 0.5, found[:, 1]).min() < 0.15
