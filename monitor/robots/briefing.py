"""The briefing before a mission: what the monitor is to know, and the policies to choose from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from anytime import ProfileLibrary, WallClock, WorkClock
from anytime.clocks import Clock, is_number
from anytime.errors import AnytimeError
from anytime.faults import Schedule
from compiler import CompiledProgram, compile
from monitor.bodies import Robot
from monitor.calibration import (
    Steady,
    calibrate,
    courses_from,
    live_closer,
    live_steadily,
    rhythm_from,
)
from monitor.choosing import Chosen, Verdict, judge_policies, tuned_division
from monitor.courses import Course
from monitor.forking import forked
from monitor.inter_frame import Contracts, Spread, compiled_contracts, pinned_contracts
from monitor.logs import Floor, LogWriter
from monitor.monitoring import Listener, Monitor
from monitor.policies import Expected, Informed, Paper, Policy, constant
from monitor.reports import Frame, Report
from monitor.rhythms import Rhythm
from monitor.robots.faulty import FaultyRobot, faulty_program
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import GridMission
from monitor.robots.lessons import NO_MEMORY, Memory
from monitor.robots.navigation import navigate

POLICIES = ("optimal", "table", "expected", "paper", "fixed", "min", "max")
# Missions of calibration have seeds of their own, far from those that anybody runs.
RHYTHM_SEED, CALIBRATION_SEED, CHOICE_SEED = 1_000_000, 2_000_000, 2_500_000


@dataclass(frozen=True)
class Effort:
    """How many missions are lived for calibration: levels of sensing × seeds, further seeds about
    the best of them, then seeds; to choose the policy, at most so many seeds for each, and so many
    more to learn what the chosen one is worth."""

    levels: int = 6
    rhythm_seeds: int = 12
    closer_seeds: int = 12
    seeds: int = 16
    choice_seeds: int = 80
    promise_seeds: int = 120


QUICK = Effort(levels=4, rhythm_seeds=3, closer_seeds=0, seeds=6, choice_seeds=4, promise_seeds=4)
LONG = 400.0  # cells; calibration lives fewer missions that are longer than this


def effort_for(scene: Scene) -> Effort:
    """The effort that a scene needs: less the longer its missions are."""
    share = min(1.0, LONG / max(scene.optimal, 1.0)) if np.isfinite(scene.optimal) else 0.0
    usual = Effort()
    return Effort(
        usual.levels,
        max(3, round(share * usual.rhythm_seeds)),
        round(share * usual.closer_seeds),
        max(6, round(share * usual.seeds)),
        max(6, round(share * usual.choice_seeds)),
        max(6, round(share * usual.promise_seeds)),
    )


@dataclass(frozen=True)
class Briefing:
    """A grid mission with its compiled program and the rhythm that it was measured to have.

    lived: the missions that told the rhythm. memory: where what others teach is kept.
    """

    grid: GridMission
    program: CompiledProgram
    rhythm: Rhythm
    effort: Effort
    lived: tuple[Steady, ...] = ()
    memory: Memory = NO_MEMORY

    def robot(self, clock: Clock | None = None) -> GridRobot:
        """The robot at the start of the mission."""
        clock = clock or WorkClock(self.grid.machine)
        return GridRobot(self.grid.scene, self.grid.mission.energy, clock)

    def live_beforehand(self) -> tuple[Steady, ...]:
        """Missions at constant divisions, more of them about the best."""
        last = RHYTHM_SEED + self.effort.rhythm_seeds
        seeds, further = range(RHYTHM_SEED, last), range(last, last + self.effort.closer_seeds)
        program, mission, robot = self.program, self.grid.mission, self.robot
        levels = self.effort.levels
        lived = live_steadily(program, mission, self.contracts, robot, seeds=seeds, levels=levels)
        if not further:
            return lived
        return live_closer(program, mission, lived, robot, seeds=seeds, further=further)

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """What the mission's rest looks like at each constant division that was lived."""
        return courses_from(self.lived)

    @cached_property
    def contracts(self) -> Contracts:
        return compiled_contracts(self.program)

    def monitor(self, policy: str) -> Monitor:
        """The monitor with one of `POLICIES`. Raises AnytimeError for another name."""
        return Monitor(self.program, self._policy(policy), policy, self.rhythm)

    def _policy(self, name: str) -> Policy:
        mission = self.grid.mission
        news = mission.news
        if news is not None:  # what comes is not foreseen, but what to do then is prepared
            parts = (mission.known(time) for time in (0.0, news.at))
            grids = (replace(self.grid, mission=part) for part in parts)
            return Informed(news.at, *(replace(self, grid=grid)._policy(name) for grid in grids))
        if name == "paper":
            return Paper(mission, self.contracts, self.rhythm)
        if name == "fixed":
            missing = {*self.program.labels, "speed"} - set(mission.fixed)
            if missing:
                raise AnytimeError(
                    f"mission {mission.name!r} has no [fixed] {', '.join(sorted(missing))}; the "
                    "policy fixed needs seconds for each call and a speed"
                )
            shares = {label: float(mission.fixed[label]) for label in self.program.labels}
            return constant(shares, float(mission.fixed["speed"]))
        if name in ("min", "max"):
            return self._calibrated(name, pinned_contracts(self.program, name))
        if name == "expected":
            return self._expected
        if name == "table":
            return self._tables()
        if name == "optimal":
            return self._chosen()
        raise AnytimeError(f"no policy {name!r}; there are {', '.join(POLICIES)}")

    def _tables(self) -> Policy:
        from monitor.course_tables import solve
        from monitor.optimal import Optimal

        mission, route = self.grid.mission, self.robot().situation().to_go
        if not self.courses or not np.isfinite(route):
            return self._expected
        tables = tuple(solve(mission, course, route) for course in self.courses)
        return Optimal(mission, self.program.labels, tables)

    def _chosen(self) -> Chosen:
        """The best of the tables, of the expectation and of a fixed division, on missions that
        made none of them."""
        policies = {"table": self._tables(), "expected": self._expected}
        fixed = tuned_division(self.program, self.grid.mission, self.lived)
        if fixed is not None:
            policies["fixed"] = fixed
        last = CHOICE_SEED + self.effort.choice_seeds
        seeds, further = range(CHOICE_SEED, last), range(last, last + self.effort.promise_seeds)
        verdict = self.memory.recall(
            "verdict",
            self._learnt_from,
            Verdict,
            lambda: judge_policies(
                self.program,
                self.grid.mission,
                policies,
                self.rhythm,
                self.robot,
                seeds=seeds,
                further=further,
            ),
        )
        return Chosen(policies, verdict)

    @cached_property
    def _expected(self) -> Expected:
        return self._calibrated("expected", self.contracts)

    def _calibrated(self, name: str, contracts: Contracts) -> Expected:
        mission, rhythm = self.grid.mission, self.rhythm
        seeds = range(CALIBRATION_SEED, CALIBRATION_SEED + self.effort.seeds)
        spread = self.memory.recall(
            f"spread-{name}",
            self._learnt_from,
            Spread,
            lambda: (
                calibrate(self.program, mission, contracts, rhythm, self.robot, seeds=seeds).spread
            ),
        )
        return Expected(mission, contracts, rhythm, spread)

    @cached_property
    def _learnt_from(self) -> bytes:
        return _described(self.grid, self.program, self.effort)

    def live(
        self,
        monitor: Monitor,
        seed: int,
        *,
        clock: Clock | None = None,
        log: Path | None = None,
        faults: Schedule | None = None,
    ) -> Report:
        """Live the mission once; log: a file that is written while it goes on. faults: what goes
        wrong on the way, on purpose; those of a clock need a `FaultyClock`."""
        report = self._live(monitor, seed, clock, log, faults)
        if faults is not None or isinstance(clock, WallClock):
            return report  # would not be the same again

        def again(frame: int, shares: Mapping[str, float], speed: float | None) -> Report:
            slow, fast = self.grid.mission.speeds
            if speed is not None and not (is_number(speed) and slow <= speed <= fast):
                raise AnytimeError(f"speed is {speed!r}; the mission has {slow} to {fast} cells/s")
            other = replace(monitor, policy=forked(monitor.policy, frame, shares, speed))
            return self.live(other, seed)

        return replace(report, again=again)

    def _live(
        self,
        monitor: Monitor,
        seed: int,
        clock: Clock | None,
        log: Path | None,
        faults: Schedule | None,
    ) -> Report:
        robot: Robot = self.robot(clock)
        listen: Listener = _silent
        if faults is not None:
            robot = FaultyRobot(robot, faults)
            listen = robot.log
            monitor = replace(monitor, program=faulty_program(monitor.program, faults, robot))
        if log is None:
            heard = None if faults is None else listen
            return monitor.run(self.grid.mission, robot, seed=seed, listen=heard)
        scene = self.grid.scene
        floor = Floor(
            scene.free,
            scene.start,
            scene.goal,
            scene.radius,
            density=scene.density,
            also=scene.also,
        )
        with LogWriter(log) as writer:
            writer.mission(
                self.grid.mission,
                policy=monitor.name,
                seed=seed,
                labels=self.program.labels,
                machine=self.program.machine,
                floor=floor,
            )

            def told(frame: Frame) -> None:
                listen(frame)
                writer.frame(frame)

            report = monitor.run(self.grid.mission, robot, seed=seed, listen=told)
            writer.end(report)
        return report


def brief(
    grid: GridMission,
    library: ProfileLibrary,
    effort: Effort | None = None,
    memory: Memory = NO_MEMORY,
) -> Briefing:
    """Compile the paper's program for a mission's machine and measure the mission's rhythm.

    memory: where what the missions lived before it teach is kept for the next briefing.
    """
    return brief_with(compile(navigate, library.on(grid.machine)), grid, effort, memory)


def brief_with(
    program: CompiledProgram,
    grid: GridMission,
    effort: Effort | None = None,
    memory: Memory = NO_MEMORY,
) -> Briefing:
    """Measure a mission's rhythm with a program that is compiled already; else as `brief`."""
    effort = effort or effort_for(grid.scene)
    unknown = Rhythm(*(np.array([value]) for value in _neutral(grid.scene.frame)))
    briefing = Briefing(grid, program, unknown, effort)
    lived = memory.recall(
        "lived", _described(grid, program, effort), tuple[Steady, ...], briefing.live_beforehand
    )
    return Briefing(grid, program, rhythm_from(lived) or unknown, effort, lived, memory)


def _described(grid: GridMission, program: CompiledProgram, effort: Effort) -> bytes:
    """All that the missions before a mission depend on, but for the code."""
    scene, frontier = grid.scene, program.frontier
    words = (grid.mission, grid.machine, effort, program.labels, scene.free.shape, scene.start)
    more = (scene.goals, scene.radius, scene.frame, scene.device, scene.density)
    arrays = (scene.free, frontier.budgets, frontier.shares, frontier.promised)
    return repr((words, more)).encode() + b"".join(array.tobytes() for array in arrays)


def _silent(frame: Frame) -> None:
    """Nobody listens."""


def _neutral(frame: float) -> Sequence[float]:
    """A rhythm for missions of which nothing is known: no detours, no stops."""
    return (0.0, 1.0 / frame, frame, 1.0, 0.0, 1.0)
