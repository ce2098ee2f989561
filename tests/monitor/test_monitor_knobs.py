"""A monitored mission whose planner has a knob: the setting is one more choice of each frame."""

from __future__ import annotations

import numpy as np
import pytest

import anytime
import compiler
from anytime import WorkClock
from monitor import Energy, Mission, Value
from monitor.inter_frame import pinned_contracts
from monitor.robots.briefing import Effort, brief_with
from monitor.robots.grid import Scene
from monitor.robots.grid_missions import REFERENCE, GridMission
from monitor.robots.navigation import frame_problems
from planners import navigation
from sensing.random_maps import corner_to_corner, uniform
from sensing.vision import Vision, see


@anytime.module(quality=navigation.find_path.quality, estimate=navigation.find_path.estimate)
def find_path(sensed, place, *, weight=anytime.knob([4, 1])):
    for work, frame in navigation.plan_frame(sensed, place, weight):
        anytime.charge(work)
        yield frame


@compiler.program
def navigate(sensor, place):
    return find_path(see(sensor), place)


@pytest.fixture(scope="module")
def briefing():
    free = uniform(40, 0.15, np.random.default_rng(1))
    start, goal = corner_to_corner(free)
    scene = Scene(free, start, goal, radius=12, frame=6.0, device=Vision(2, 24))
    problems = list(frame_problems(scene, np.random.default_rng(0), 6))
    library = anytime.measure(navigate, problems, seconds=8.0, clock=lambda: WorkClock(REFERENCE))
    mission = Mission(Value("linear", 100.0, 60.0), Energy(0.2, 0.08, 0.03))
    program = compiler.compile(navigate, library)
    effort = Effort(levels=3, rhythm_seeds=1, seeds=2, choice_seeds=2, promise_seeds=2)
    return brief_with(program, GridMission(mission, scene, REFERENCE), effort)


def planners(shares):
    return [label for label, seconds in shares.items() if seconds > 0 and label != "see"]


def test_each_setting_is_a_course_of_its_own(briefing):
    chosen = [planners(steady_shares(briefing, course.shares)) for course in briefing.courses]
    assert {label for labels in chosen for label in labels} == set(briefing.program.labels[1:])
    assert all(len(labels) == 1 for labels in chosen)


def steady_shares(briefing, shares):
    return dict(zip(briefing.program.labels, shares, strict=True))


@pytest.mark.parametrize("extreme", ["min", "max"])
def test_pinned_sensing_leaves_each_setting_its_times(briefing, extreme):
    shares = pinned_contracts(briefing.program, extreme).shares
    assert (shares >= 0).all()
    assert len(np.unique(shares[:, 0])) == 1
    assert ((shares[:, 1:] > 0).sum(axis=1) == 1).all()
    assert (shares[:, 1:] > 0).any(axis=0).all()


@pytest.mark.parametrize("policy", ["table", "expected", "paper", "min", "max"])
def test_a_mission_runs_one_setting_a_frame_and_arrives(briefing, policy):
    report = briefing.live(briefing.monitor(policy), 3)
    assert report or policy == "max"  # which looks for too long to be in time
    assert not report.fault
    for frame in report.frames:
        assert len(planners(frame.decision.shares)) == 1
        ran = [call.label for call in frame.calls if call.label != "see"]
        assert ran == planners(frame.decision.shares)[: len(ran)]
