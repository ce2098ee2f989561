"""What [ZR93] §5 says of the monitor: tasks on random floors that the robot has never seen.

The rhythm, the paper's "model of the environment", is measured on other floors of the same kind.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, lru_cache

import numpy as np

from anytime import WorkClock
from compiler import CompiledProgram, compile
from experiments.demo import measured
from experiments.reproduction.abstraction import FAMILY
from experiments.reproduction.ways import Way
from monitor.calibration import calibrate, measure_rhythm
from monitor.inter_frame import compiled_contracts
from monitor.missions import Energy, Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import Paper, Policy
from monitor.reports import Report
from monitor.rhythms import Rhythm
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE, GridMission
from monitor.robots.navigation import navigate
from monitor.states import Decision, State
from sensing import instance
from sensing.vision import Vision

SIZE = 96
ERROR = 0.04
"""By how much the value achieved differs from the one computed when the task is presented."""
MISSION = Mission(Value("linear", 100.0, 100.0), Energy(0.2, 0.08, 0.03), name="random floor")
"""A value that is gone after 100 s, for a way of some 20 s; costs as in the shipped office."""
VALUES = (
    MISSION.value,
    Value("soft", 100.0, 25.0),
    Value("exponential", 100.0, 50.0),
    Value("hard", 100.0, 35.0),
)
"""The paper draws no task value; these are those that the page compares."""
TASKS = 24
"""Lived at most for a draw of how the monitor steers; most are too short to steer at all."""
_DEVICE = Vision(2.0, 24.0, 0.75, 1.0)
# Floors that are used to measure with have indices far from those of the draws.
_MEASURED, _RHYTHM, _CALIBRATED = 1_000_000, 2_000_000, 3_000_000
_LEVELS, _LIVED, _CALIBRATIONS = 6, 8, 24


@dataclass
class Watched:
    """A policy that keeps what it was asked and answered within frames."""

    policy: Policy
    seen: list[tuple[State, Decision]] = field(default_factory=list)

    def __call__(self, state: State) -> Decision:
        decision = self.policy(state)
        if state.moment != "frame":
            self.seen.append((state, decision))
        return decision


def scene(index: int) -> Scene:
    """The index-th random floor, corner to corner."""
    free, start, goal = instance(FAMILY, SIZE, index)
    return Scene(free, start, goal, device=_DEVICE)


@cache
def _program() -> CompiledProgram:
    grid = GridMission(MISSION, scene(_MEASURED), REFERENCE)
    return compile(navigate, measured(grid, 0).on(REFERENCE))


@cache
def _rhythm() -> Rhythm:
    program = _program()
    found = measure_rhythm(
        program,
        MISSION,
        compiled_contracts(program),
        _robots(_RHYTHM),
        seeds=range(_LIVED),
        levels=_LEVELS,
    )
    assert found is not None  # floors are connected, so some mission arrives
    return found


def _robots(first: int) -> Callable[[], GridRobot]:
    """Makes robots, each on a floor of its own."""
    indices = itertools.count(first)
    return lambda: _robot(next(indices))


def _robot(index: int) -> GridRobot:
    return GridRobot(scene(index), MISSION.energy, WorkClock(REFERENCE))


@cache
def monitor(way: Way, value: Value = MISSION.value) -> Monitor:
    """The monitor for such tasks, with the policy of that way."""
    program, rhythm = _program(), _rhythm()
    mission = Mission(value, MISSION.energy, name=MISSION.name)
    contracts = compiled_contracts(program)
    if way.policy == "paper":
        return Monitor(program, Paper(mission, contracts, rhythm), way.policy, rhythm)
    policy = calibrate(
        program, mission, contracts, rhythm, _robots(_CALIBRATED), seeds=range(_CALIBRATIONS)
    )
    return Monitor(program, policy, way.policy, rhythm)


@lru_cache(maxsize=8)
def lived(
    seed: int, way: Way, value: Value = MISSION.value
) -> tuple[Report, tuple[tuple[State, Decision], ...]]:
    """One task on a new floor, and what was decided within frames."""
    able = monitor(way, value)
    watched = Watched(able.policy)
    mission = Mission(value, MISSION.energy, name=MISSION.name)
    watching = Monitor(able.program, watched, able.name, able.rhythm)
    return watching.run(mission, _robot(seed), seed=seed), tuple(watched.seen)


# --- The claims, one draw each.


def ahead_behind(seed: int, way: Way) -> bool:
    """Within frames: faster if planning is ahead and execution behind, slower the other way round,
    else neither; in task after task until it has occurred."""
    for index in range(TASKS * seed, TASKS * (seed + 1)):
        told = [
            (_expected(state), _done(state, decision)) for state, decision in lived(index, way)[1]
        ]
        if any(expected != done for expected, done in told):
            return False
        if any(done for _, done in told):
            return True
    return False


def _expected(state: State) -> int:
    """Which way the paper's rule changes the speed: 1, -1 or 0."""
    contract = state.contract
    assert contract is not None  # within a frame
    if state.seen is None or state.advertised is None:
        return 0
    ends = state.time + state.situation.in_hand / contract.speed
    late = ends - (state.frame_started + contract.contract)
    ahead = state.seen >= state.advertised
    slow, fast = MISSION.speeds
    if ahead and late > 0:
        return int(contract.speed < fast)
    return -int(contract.speed > slow) if not ahead and late < 0 else 0


def _done(state: State, decision: Decision) -> int:
    assert state.contract is not None  # within a frame
    return int(np.sign(decision.speed - state.contract.speed))


def within_4(seed: int, way: Way, value: Value = MISSION.value) -> tuple[float, ...]:
    """The share of the value computed at the beginning that was not achieved; twice, because it
    may err on either side."""
    report = lived(seed, way, value)[0]
    gap = 1.0 - report.net / report.promised
    return gap, gap
