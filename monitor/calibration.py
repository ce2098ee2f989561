"""Calibration: missions lived off line, so that the monitor foresees what really happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.programs import makers
from compiler import CompiledProgram
from monitor.bodies import Robot
from monitor.courses import Course, Leg, course_of, legs_of, refined, smoothed
from monitor.endings import Ending
from monitor.inter_frame import Contracts, Spread
from monitor.missions import Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import Expected, constant
from monitor.reports import Report
from monitor.rhythms import Lived, Rhythm, rhythm_of

Floats = NDArray[np.float64]
MakeRobot = Callable[[], Robot]
RATIOS = 9  # quantiles kept of real over foreseen time
BINS = 3  # of foreseen time left
SPEEDS = 19  # at which missions are reckoned
PATIENCE = 3.0  # deadlines that a mission of calibration may last


@dataclass(frozen=True)
class Steady:
    """What missions taught that were lived at one constant division.

    shares: seconds of each call. lived, legs: of each mission.
    """

    shares: tuple[float, ...]
    lived: tuple[Lived, ...]
    legs: tuple[tuple[Leg, ...], ...]

    def nets(self, mission: Mission, speeds: Floats) -> Floats:
        """Mean net value that the missions would have had at each speed, [V]; -inf without any.

        What was seen, and so what was walked, hardly depends on the speed: each mission tells what
        it would have been worth at every speed.
        """
        if not self.legs:
            return np.full(len(speeds), -np.inf)
        return np.mean([_nets(mission, legs, speeds) for legs in self.legs], axis=0)

    def joined(self, other: Steady) -> Steady:
        """The missions of both, which were lived at one division."""
        return replace(self, lived=self.lived + other.lived, legs=self.legs + other.legs)


def live_steadily(
    program: CompiledProgram,
    mission: Mission,
    contracts: Contracts,
    make_robot: MakeRobot,
    *,
    seeds: Sequence[int],
    levels: int = 6,
) -> tuple[Steady, ...]:
    """Missions lived at constant sensing times, those that reached their goal.

    levels: sensing times, spread over those of the contracts. Each is lived once for each seed.
    """
    _must_live(seeds)
    sensing = np.unique(contracts.shares[:, 0])
    chosen = sensing[np.unique(np.linspace(0, len(sensing) - 1, levels).round().astype(int))]
    longest = float(contracts.shares[:, 1:].sum(axis=1).max())
    return tuple(
        _steady(program, mission, shares, make_robot, seeds)
        for shares in _constants(program, chosen.tolist(), longest)
    )


def live_closer(
    program: CompiledProgram,
    mission: Mission,
    lived: Sequence[Steady],
    make_robot: MakeRobot,
    *,
    seeds: Sequence[int],
    further: Sequence[int],
) -> tuple[Steady, ...]:
    """What was lived, and more of it about the division that was worth most: there policies will
    be, so what chance says of it weighs most.

    That division and its neighbours are lived for the further seeds, and those half-way between
    them for these and for `seeds`, for which all the others were. Nothing more where no mission
    reached its goal.
    """
    if not any(steady.legs for steady in lived):
        return tuple(lived)
    speeds = np.geomspace(*mission.speeds, SPEEDS)
    best = max(lived, key=lambda steady: float(steady.nets(mission, speeds).max()))
    alike = [steady for steady in lived if _calls(steady.shares) == _calls(best.shares)]
    place = alike.index(best)
    near = alike[max(place - 1, 0) : place + 2]

    def live(shares: tuple[float, ...], seeds: Sequence[int]) -> Steady:
        return _steady(program, mission, shares, make_robot, seeds)

    known = [one.joined(live(one.shares, further)) if one in near else one for one in lived]
    between = [
        tuple((a + b) / 2 for a, b in zip(one.shares, other.shares, strict=True))
        for one, other in pairwise(near)
    ]
    new = [live(shares, [*seeds, *further]) for shares in between]
    return tuple(sorted([*known, *new], key=lambda steady: steady.shares[0]))


def _steady(
    program: CompiledProgram,
    mission: Mission,
    shares: tuple[float, ...],
    make_robot: MakeRobot,
    seeds: Sequence[int],
) -> Steady:
    division = dict(zip(program.labels, shares, strict=True))
    policy = constant(division, float(np.sqrt(mission.speeds[0] * mission.speeds[1])))
    endless = _patient(mission)
    lived: list[Lived] = []
    legs: list[tuple[Leg, ...]] = []
    made: list[Robot] = []
    for seed in seeds:
        robot = make_robot()
        if any(robot is other for other in made):
            raise AnytimeError("make_robot gives the same robot again; let it make one each time")
        made.append(robot)
        route = robot.situation().to_go
        report = _sound(Monitor(program, policy, "constant").run(endless, robot, seed=seed))
        if report and route > 0:
            lived.append(_lived(shares[0], route, report))
            legs.append(legs_of(report))
    return Steady(shares, tuple(lived), tuple(legs))


def _calls(shares: Sequence[float]) -> tuple[bool, ...]:
    """Which calls are made: divisions with different ones have nothing between them."""
    return tuple(share > 0 for share in shares)


def _nets(mission: Mission, legs: Sequence[Leg], speeds: Floats) -> Floats:
    """Net values of a mission had it been walked at each speed, [V]."""
    walked = np.array([leg.walked for leg in legs])[:, None] / speeds
    thinking = np.array([leg.thinking for leg in legs])[:, None]
    seconds = np.maximum(walked, thinking).sum(axis=0) + mission.job
    energy = walked.sum(axis=0) * mission.energy.power(speeds)
    energy += mission.energy.idle * (seconds - walked.sum(axis=0))
    return mission.value(seconds) - mission.energy.price * energy


def _constants(
    program: CompiledProgram, sensing: Sequence[float], longest: float
) -> Iterator[tuple[float, ...]]:
    """Each time of sensing, and all that is useful for the rest: for one plan of those that the
    program chooses among, and in equal parts for that and for the calls before it."""
    plans = [call.label for call in makers(program.program.output)]
    for time in sensing:
        for plan in plans:
            rest = [each for each in program.labels[1:] if each == plan or each not in plans]
            part = longest / max(len(rest), 1)
            yield (float(time), *(part if each in rest else 0.0 for each in program.labels[1:]))


def measure_rhythm(
    program: CompiledProgram,
    mission: Mission,
    contracts: Contracts,
    make_robot: MakeRobot,
    *,
    seeds: Sequence[int],
    levels: int = 6,
) -> Rhythm | None:
    """The rhythm of a mission, from missions lived at constant sensing times; None if none of
    them reached its goal. seeds, levels: see `live_steadily`."""
    return rhythm_from(
        live_steadily(program, mission, contracts, make_robot, seeds=seeds, levels=levels)
    )


def rhythm_from(lived: Sequence[Steady]) -> Rhythm | None:
    """The rhythm of missions lived at constant divisions; None if there are none."""
    missions = [mission for steady in lived for mission in steady.lived]
    return rhythm_of(missions) if missions else None


def courses_from(lived: Sequence[Steady]) -> tuple[Course, ...]:
    """The courses of missions lived at constant divisions."""
    settings: dict[tuple[bool, ...], list[Course]] = {}
    for steady in lived:
        course = course_of(steady.legs, steady.shares)
        if course is not None:
            settings.setdefault(_calls(steady.shares), []).append(course)
    return tuple(course for alike in settings.values() for course in refined(smoothed(alike)))


def calibrate(
    program: CompiledProgram,
    mission: Mission,
    contracts: Contracts,
    rhythm: Rhythm,
    make_robot: MakeRobot,
    *,
    seeds: Sequence[int],
    rounds: int = 2,
) -> Expected:
    """The policy of expectation over how far the time left really was from the time foreseen.

    It lives the mission for each seed, `rounds` times, the later ones with what it learnt.
    """
    _must_live(seeds)
    if rhythm is None:  # pyright: ignore[reportUnnecessaryComparison]
        raise AnytimeError("there is no rhythm: no mission reached its goal when it was measured")
    policy = Expected(mission, contracts, rhythm, Spread())
    endless = _patient(mission)
    for _ in range(rounds):
        monitor = Monitor(program, policy, "expected", rhythm)
        lived = [
            _foreseen_and_real(_sound(monitor.run(endless, make_robot(), seed=seed)))
            for seed in seeds
        ]
        policy = Expected(mission, contracts, rhythm, spread_of(lived))
    return policy


def spread_of(lived: Sequence[Sequence[tuple[float, float]]]) -> Spread:
    """Quantiles of real / foreseen seconds left, from the (foreseen, real) of missions' frames.

    In bins of equally many frames, and one of its own for the beginnings: what a mission promises
    when it is presented is held against whole missions.
    """
    pairs = [pair for mission in lived for pair in mission]
    if not pairs:
        return Spread()
    foreseen, real = np.array(pairs).T
    bounds = np.quantile(foreseen, np.arange(BINS) / BINS)
    bounds[0] = 0.0
    rows = np.asarray(np.searchsorted(bounds, foreseen, side="right") - 1, dtype=np.intp)
    shares = (np.arange(RATIOS) + 0.5) / RATIOS
    ratios = [
        tuple(np.quantile((real / foreseen)[rows == row], shares).tolist())
        for row in range(BINS)
        if (rows == row).any()
    ]
    kept = [float(bounds[row]) for row in range(BINS) if (rows == row).any()]
    begun = np.array([mission[0] for mission in lived if mission])
    first = 0.999 * float(begun[:, 0].min())
    if len(begun) >= RATIOS and first > kept[-1]:
        kept.append(first)
        ratios.append(tuple(np.quantile(begun[:, 1] / begun[:, 0], shares).tolist()))
    return Spread(tuple(kept), tuple(ratios))


def _must_live(seeds: Sequence[int]) -> None:
    if not len(seeds):
        raise AnytimeError("seeds is empty; give one for each mission to live")


def _sound(report: Report) -> Report:
    """A mission that says something of missions: raises AnytimeError for what a robot did wrong."""
    if report.ending is Ending.INTERNAL:
        raise AnytimeError(f"a mission of calibration ended: {report.fault}")
    return report


def _foreseen_and_real(report: Report) -> list[tuple[float, float]]:
    # A mission that was cut short lasted at least as long as it did.
    return [
        (frame.decision.why.seconds, report.seconds - frame.started)
        for frame in report.frames
        if frame.decision.why.seconds > 0
    ]


def _patient(mission: Mission) -> Mission:
    """The mission as it would go on after its deadline, up to `PATIENCE` times as long."""
    value = mission.value
    until = value.deadline if np.isfinite(value.deadline) else 8 * value.seconds
    return replace(mission, value=Value("hard", value.worth, PATIENCE * until), news=None)


def _lived(sensing: float, route: float, report: Report) -> Lived:
    moving = [frame for frame in report.frames if not frame.standing]
    estimates = [
        call.estimate
        for frame in report.frames
        for call in frame.calls[1:]
        if call.estimate is not None
    ]
    return Lived(
        sensing=sensing,
        route=route,
        walked=sum(frame.told("length") for frame in moving),
        planned=sum(frame.told("planned") for frame in moving),
        moving=len(moving),
        standing=len(report.frames) - len(moving),
        estimate=float(np.mean(estimates)) if estimates else 0.0,
    )
