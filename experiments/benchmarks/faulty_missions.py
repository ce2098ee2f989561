"""Missions in which things go wrong: drawn from a number, so that each one repeats."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from anytime.faults import Fault, FaultyClock, Schedule
from anytime.running import seed_of
from compiler import CompiledProgram
from experiments import crossings
from monitor.missions import Energy, Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.reports import Report
from monitor.robots.faulty import FaultyRobot, faulty_program, kinds_of
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE
from sensing.vision import Vision

SIZE = 40  # cells
MISSION = Mission(Value("hard", 100.0, 400.0), Energy(0.1, 0.1, 0.02), job=1.0, name="faulty")
CLOSED = 1e-3  # seconds within which the ledger must close


@dataclass(frozen=True, eq=False)
class FaultyMission:
    """A floor and what goes wrong on it."""

    crossing: crossings.Crossing
    schedule: Schedule


@dataclass(frozen=True)
class Lived:
    """How such a mission went. raised: what came out of it as an exception, which nothing may.
    unclosed: seconds of the ledger beyond what may be missing."""

    ending: str
    report: Report | None
    raised: str = ""
    unclosed: float = 0.0


def drawn(program: CompiledProgram, number: int, seed: int) -> FaultyMission:
    """The mission with this number: a floor, and one to three faults."""
    rng = np.random.default_rng(seed_of("faulty mission", number, seed))
    kind = crossings.KINDS[number % len(crossings.KINDS)]
    floor = crossings.crossing(
        kind, number, reachable=bool(rng.random() < 0.9), seed=seed, size=SIZE
    )
    kinds = kinds_of(program.program)
    faults: list[Fault] = []
    for _ in range(int(rng.integers(1, 4))):
        what = str(rng.choice(list(kinds)))
        begins = float(rng.choice([0.0, rng.uniform(0, 60.0)]))
        ends = begins + float(rng.choice([math.inf, rng.uniform(0.5, 60.0)]))
        chance = float(rng.choice([1.0, 0.3]))
        faults.append(Fault(str(rng.choice(list(kinds[what]))), begins, ends, what, chance))
    return FaultyMission(floor, Schedule(faults, number))


def live(program: CompiledProgram, mission: FaultyMission) -> Lived:
    """Live it to its ending, on a work clock."""
    floor = mission.crossing
    clock = FaultyClock(REFERENCE, mission.schedule)
    scene = Scene(floor.free, floor.start, floor.goal, device=Vision(q_a=floor.quality))
    robot = FaultyRobot(GridRobot(scene, MISSION.energy, clock), mission.schedule)
    policy = constant(dict(zip(program.labels, (1.0, 1.0), strict=True)), 5.0)
    faulty = faulty_program(program, mission.schedule, robot)
    try:
        monitor = Monitor(faulty, policy, "steady")
        report = monitor.run(MISSION, robot, seed=floor.seed, listen=robot.log)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and not mission.schedule.faults:
            raise
        return Lived("", None, repr(error))
    ledger = report.ledger
    spent = ledger["drive"] + ledger["wait"] + ledger["job"]
    missing = max(abs(spent - report.seconds), -ledger["wait"]) - CLOSED
    return Lived(report.ending.value, report, unclosed=max(0.0, missing))
