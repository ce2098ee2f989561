"""What happens around a plan that is being optimised: the scenarios of [PRP16] §4, timed.

A second is a CPU-second of the thread in which the query runs, so that the figures do not depend
on what else the machine does; targets move and obstacles change on that same clock.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from planners.nao import POSTURES, Body
from planners.nao_plan import actions_of, made_before, plan, plan_world, trajectory
from planners.query import Operators, Query

OBSTACLE = (0.5, 0.0, 0.2)
GOAL = (1.0, 0.0)
CLOSE = 0.05
"""A plan is good when it costs this much more than the best one, at most."""

Point = tuple[float, float]
Disc = tuple[float, float, float]


def body() -> Body:
    """The NAO of the paper's simulation: 10 cm/s, and 3 s from any posture to any other."""
    seconds = np.full((6, 6), 3.0)
    np.fill_diagonal(seconds, 0.0)
    return Body(
        speed=0.1,
        step_phase=0.0,
        posture_seconds=seconds,
        fall_seconds=20.0,
        command_seconds=0.0,
    )


def sitting(disc: Disc | None = OBSTACLE) -> dict[str, Any]:
    """[PRP16] Figure 1: the robot sits, the goal is one metre ahead, an obstacle between."""
    return plan_world(GOAL, obstacles=[disc] if disc else [], body=body())


def detour(start: Point, goal: Point, disc: Disc | None) -> float:
    """Metres of the shortest way of at most two legs from start to goal around a disc."""
    straight = math.dist(start, goal)
    if disc is None:
        return straight
    centre, radius = disc[:2], disc[2]
    a, b = math.dist(start, centre), math.dist(goal, centre)
    share = sum((c - s) * (g - s) for s, g, c in zip(start, goal, centre, strict=True))
    share = min(1.0, max(0.0, share / straight**2))
    nearest = [s + share * (g - s) for s, g in zip(start, goal, strict=True)]
    if math.dist(nearest, centre) >= radius:
        return straight
    # the triangle of start, goal and the point where the two tangents on one side meet
    to_goal = math.atan2(goal[1] - start[1], goal[0] - start[0])
    to_start = math.atan2(start[1] - goal[1], start[0] - goal[0])
    ways: list[float] = []
    for side in (-1.0, 1.0):
        seen = math.atan2(centre[1] - start[1], centre[0] - start[0])
        back = math.atan2(centre[1] - goal[1], centre[0] - goal[0])
        at_start = abs(_turn(seen + side * math.asin(radius / a) - to_goal))
        at_goal = abs(_turn(back - side * math.asin(radius / b) - to_start))
        scale = straight / math.sin(at_start + at_goal)
        ways.append(scale * (math.sin(at_start) + math.sin(at_goal)))
    return min(ways)


def _turn(angle: float) -> float:
    return math.remainder(angle, math.tau)


def least(start: Point, goal: Point, disc: Disc | None, before: float) -> float:
    """What the best plan costs: `before` seconds of standing up, then the shortest way."""
    robot = body()
    return 0.005 * (before + detour(start, goal, disc) / robot.speed)


@dataclass(frozen=True)
class Recovery:
    """How long a query took until its best plan was as it should be; inf if it never was."""

    seconds: float
    evaluations: float

    @property
    def found(self) -> bool:
        return math.isfinite(self.seconds)


class Timed:
    """A query whose own CPU time is counted."""

    def __init__(
        self,
        world: Mapping[str, Any],
        seed: int,
        operators: Operators | None = None,
        population: int = 60,
    ) -> None:
        self.query = Query(plan, world, seed=seed, operators=operators, population=population)
        self.seconds = 0.0

    def step(self, generations: int = 1) -> None:
        before = time.thread_time()
        self.query.step(generations)
        self.seconds += time.thread_time() - before

    def converge(self, seconds: float) -> None:
        """Let the query work for some seconds of its own."""
        end = self.seconds + seconds
        while self.seconds < end:
            self.step(25)

    def until(self, good: Callable[[], bool], seconds: float) -> Recovery:
        """Work until the best plan is good, at most for some seconds."""
        begun, evaluations = self.seconds, self.query.evaluations
        while self.seconds - begun < seconds:
            self.step()
            if good():
                return Recovery(self.seconds - begun, self.query.evaluations - evaluations)
        return Recovery(math.inf, math.inf)

    def walked(self) -> tuple[float, float]:
        """Metres that the best plan walks, and how far it leads aside of the straight line."""
        world = dict(self.query.world)
        poses = trajectory(actions_of(self.query.best.choices), world)
        length = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(poses))
        return length, max(abs(pose.y) for pose in poses)


def first_plan(seed: int, operators: Operators | None = None) -> Recovery:
    """From nothing to a good plan. The paper: 0.5 s."""
    timed = Timed(sitting(), seed, operators)
    good = least((0.0, 0.0), GOAL, OBSTACLE, 3.0) + CLOSE
    return timed.until(lambda: timed.query.value <= good, 1.0)


def removed(seed: int, after: float, operators: Operators | None = None) -> Recovery:
    """The obstacle is removed, which changes the value of no good plan: when is it straight?"""
    timed = Timed(sitting(), seed, operators)
    timed.converge(after)
    timed.query.world["obstacle_count"] = 0
    return timed.until(lambda: _straight(timed), 1.0)


def _straight(timed: Timed) -> bool:
    straight = least((0.0, 0.0), GOAL, None, 3.0)
    return timed.query.value <= straight + 0.02 and timed.walked()[0] <= 1.02


def appeared(seed: int, operators: Operators | None = None) -> Recovery:
    """An obstacle appears 0.4 m ahead when the robot has stood up and walked 0.2 m."""
    timed = Timed(sitting(None), seed, operators)
    timed.converge(0.5)
    searched = timed.query
    actions, choices = actions_of(searched.best.choices), searched.best.choices
    poses = trajectory(actions, dict(searched.world))
    done = max(i for i, pose in enumerate(poses) if pose.seconds <= 5.0)
    here = poses[done]
    start = (here.x, here.y)
    if done < len(actions):
        after = poses[done + 1]
        share = (5.0 - here.seconds) / (after.seconds - here.seconds)
        start = (here.x + share * (after.x - here.x), here.y + share * (after.y - here.y))
    ahead = 0.4 / math.dist(start, GOAL)
    disc = (start[0] + ahead * (GOAL[0] - start[0]), start[1] + ahead * (GOAL[1] - start[1]), 0.2)
    current = actions[done] if done < len(actions) else None
    searched.constrain(made_before(choices, done))
    now = plan_world(
        GOAL,
        pose=(*start, here.heading),
        posture=POSTURES[here.posture],
        obstacles=[disc],
        done=done,
        current=current,
        elapsed=5.0 - here.seconds,
        body=body(),
    )
    searched.world.update(now)
    good = least(start, GOAL, disc, 0.0) + CLOSE
    return timed.until(lambda: searched.value <= good, 1.0)


def fallen(seed: int, operators: Operators | None = None) -> Recovery:
    """The robot falls on its way and crouches where no plan expected it."""
    timed = Timed(sitting(), seed, operators)
    timed.converge(0.5)
    start = (0.3, 0.15)
    timed.query.world.update(x=start[0], y=start[1], heading=0.7, posture=1)
    good = least(start, GOAL, OBSTACLE, 3.0) + CLOSE
    return timed.until(lambda: timed.query.value <= good, 1.0)


def moving(seed: int, operators: Operators | None = None) -> float:
    """The target moves at 10 cm/s for 6 s: the mean excess of the best plan after 0.5 s."""
    timed = Timed(sitting(), seed, operators)
    excess: list[float] = []
    while timed.seconds < 6.0:
        goal = (1.0 + 0.1 * timed.seconds, 0.0)
        timed.query.world["goal_x"] = goal[0]
        timed.step()
        if timed.seconds > 0.5:
            excess.append(timed.query.value - least((0.0, 0.0), goal, OBSTACLE, 3.0))
    return float(np.mean(excess))


@dataclass(frozen=True)
class Summary:
    """Recoveries over seeds."""

    found: float
    p90_ms: float
    p90_evaluations: float
    median_ms: float

    @classmethod
    def of(cls, recoveries: list[Recovery]) -> Summary:
        times = [recovery.seconds * 1000 for recovery in recoveries]
        counts = [recovery.evaluations for recovery in recoveries]
        return cls(
            float(np.mean([recovery.found for recovery in recoveries])),
            float(np.quantile(times, 0.9, method="higher")),
            float(np.quantile(counts, 0.9, method="higher")),
            float(np.quantile(times, 0.5, method="higher")),
        )
