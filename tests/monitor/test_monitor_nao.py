"""A NAO executes its plan while the plan is still being improved."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import anytime
import compiler
from anytime import Machine, WorkClock
from monitor.endings import Ending
from monitor.missions import Energy, Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.robots.nao import NaoRobot
from monitor.robots.nao_planning import errands, improve
from monitor.robots.nao_scenes import read_scene
from monitor.robots.simulated_nao import SimulatedNao

SCENES = Path(__file__).resolve().parents[2] / "experiments" / "data" / "scenes"
MACHINE = Machine("nao").with_rate("sonar_map", 0.1).with_rate("find_plan", 1e-5)
MISSION = Mission(Value("soft", 100.0, 60.0), Energy(0.1, 1.0, 0.0), speeds=(0.095, 0.095))


@pytest.fixture(scope="module")
def program():
    problems = errands(np.random.default_rng(0), 4)
    clock = lambda: WorkClock(MACHINE)  # noqa: E731
    return compiler.compile(improve, anytime.measure(improve, problems, seconds=0.6, clock=clock))


def live(program, name: str, seed: int, *, noise: bool = True):
    scene = read_scene(SCENES / f"{name}.toml", seed=seed, noise=noise)
    clock = WorkClock(MACHINE)
    body = SimulatedNao(scene, clock)
    robot = NaoRobot(body, clock, scene.goal, MISSION.energy, sonars=scene.sonars, seed=seed)
    monitor = Monitor(program, constant(program.allocate(0.4).shares, 0.095), "fixed")
    frames = []
    report = monitor.run(MISSION, robot, seed=seed, listen=frames.append)
    assert not report.fault
    return report, robot, body, frames


def test_it_stands_up_and_goes_round_though_nothing_tells_it_to(program):
    report, robot, body, frames = live(program, "sitting", 3)
    assert report.ending is Ending.REACHED
    assert robot.falls == body.falls == 0
    assert math.dist(robot.reading.pose_in_world[:2], (1.0, 0.0)) <= 0.06
    postures = [frame.story["posture"] for frame in frames]
    assert postures[0] == "Sit"
    assert postures[-1] in ("Stand", "StandInit", "StandZero")
    assert max(abs(y) for frame in frames for _, y, _ in frame.story["motion"]["track"]) > 0.1


def test_a_mission_repeats_to_the_bit(program):
    runs = [live(program, "appearing", 1) for _ in range(2)]
    motions = [[frame.story["motion"] for frame in run[3]] for run in runs]
    assert motions[0] == motions[1]
    assert runs[0][0].seconds == runs[1][0].seconds


def test_after_a_fall_it_stands_up_and_goes_on(program):
    report, robot, body, _ = live(program, "fall", 2)
    assert body.falls >= 1
    assert robot.falls == body.falls
    assert report.ending is Ending.REACHED


def test_without_noise_it_arrives_where_it_believes_to_be(program):
    report, robot, body, _ = live(program, "sitting", 1, noise=False)
    assert report.ending is Ending.REACHED
    assert math.dist(body.true_pose_in_world[:2], robot.reading.pose_in_world[:2]) < 1e-6


def test_a_body_that_is_closed_ends_the_mission_as_link_lost(program):
    scene = read_scene(SCENES / "sitting.toml")
    clock = WorkClock(MACHINE)
    body = SimulatedNao(scene, clock)
    robot = NaoRobot(body, clock, scene.goal, MISSION.energy)
    monitor = Monitor(program, constant(program.allocate(0.4).shares, 0.095), "fixed")
    report = monitor.run(MISSION, robot, listen=lambda frame: body.close())
    assert report.ending is Ending.LINK_LOST
