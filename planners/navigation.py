"""Planning one frame of a walk: from where it begins to a sub-goal on the way. [ZR93] §5.

A sensed cell is evidence, not truth: what was sensed updates the belief about the whole floor, a
route on that belief says where the frame should lead, and ATP plans it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import anytime
from planners.avoidance import Walk, walk
from planners.multipath import MultiPath
from planners.paper_atp import HIGHEST_LEVEL, steps
from planners.path_finding import Cell, Path, astar, route
from planners.touring import shortest_tour
from sensing import Belief, SensedMap
from sensing.sensed_maps import disc

DEAREST = 250.0  # cost of a believed obstacle, in free cells; only a touched one is impassable
PER_ODDS = 4.0  # how fast the cost of a cell rises with the odds that it is blocked
ROUTE_WEIGHT = 2.0  # of the search for the route: at most this times the cheapest
LEASH = 1.5  # a frame is broken off when it walks this much more than planned …
SLACK = 8.0  # … and this many cells beyond
IMPASSABLE = 255
BLOCK = 2**HIGHEST_LEVEL
NO_PLAN = np.zeros((0, 3), np.int32)
PATIENCE = 4  # plans that lead nowhere new before the robot makes straight for the goal


@dataclass(frozen=True, eq=False)
class Place:
    """Where the next frame begins, and what is believed of the floor before looking again.

    start, goal: cells. frame: length of a frame in cells. radius: of the sensed disc around `seen`.
    later: further goals, to be visited after `goal`. beyond: believed length of the way from `goal`
    through them, in cells; None while the order of all the goals is to be chosen.
    """

    belief: Belief
    start: Cell
    goal: Cell
    seen: Cell
    radius: int
    frame: float
    later: tuple[Cell, ...] = ()
    beyond: float | None = 0.0


@dataclass(frozen=True, eq=False)
class FramePlan:
    """A plan for one frame.

    plan: from `start` to `sub_goal`, on the way to `goal` and then to those `later`, in this order.
    to_goal: believed length from the sub-goal to the goal; beyond: from there through the later
    ones, both in cells. belief: what was believed when it was made. length: believed length of the
    frame itself.
    """

    plan: MultiPath
    start: Cell
    sub_goal: Cell
    goal: Cell
    to_goal: float
    belief: Belief
    later: tuple[Cell, ...] = ()
    beyond: float = 0.0

    @property
    def route_left(self) -> float:
        """Believed length of all that is left after the frame, in cells."""
        return self.to_goal + self.beyond

    @property
    def length(self) -> float:
        return self.plan.length

    @property
    def leash(self) -> float:
        """The walked length in cells beyond which the frame is broken off."""
        return LEASH * self.length + SLACK


@dataclass(frozen=True, eq=False)
class NoWay:
    """The proof that no way leads to a goal over everything not touched and found blocked."""


def travel_cost(belief: Belief) -> NDArray[np.uint8]:
    """What it costs to cross each cell, uint8 [rows, columns]: 1 free … 250 believed blocked,
    255 touched and blocked, which alone is impassable."""
    odds = np.exp(belief.log_odds)
    cost = np.minimum(DEAREST, 1.0 + PER_ODDS * odds).astype(np.uint8)
    cost[belief.touched] = 1
    cost[belief.touched_blocked] = IMPASSABLE
    return cost


def sub_goal(path: Path, place: Place, cost: NDArray[np.uint8]) -> tuple[Cell, float]:
    """Where a frame along this route ends: (cell, length of the route beyond it in cells).

    The first cell one frame's length along it, or the last before it leaves the sensed disc, or
    the goal; stepped back while it is believed blocked.
    """
    cells = path.cells
    steps_taken = np.abs(np.diff(cells, axis=0)).sum(axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.where(steps_taken == 2, np.sqrt(2.0), 1.0))])
    end = int(np.searchsorted(along, place.frame))
    outside = np.hypot(*(cells - np.array(place.seen)).T) > place.radius
    left = np.flatnonzero(outside[1:])
    if len(left):
        end = min(end, max(int(left[0]), 1))
    end = min(end, len(cells) - 1)
    while end > 1 and cost[tuple(cells[end])] > PER_ODDS:
        end -= 1
    return (int(cells[end, 0]), int(cells[end, 1])), float(along[-1] - along[end])


def plan_frame(
    sensed: SensedMap | None, place: Place, weight: float = ROUTE_WEIGHT
) -> Iterator[tuple[float, FramePlan | NoWay | None]]:
    """Plan a frame in steps of (work, a better plan or None).

    weight: of the search for the route across the whole map, >= 1. Where the order of several
    goals is to be chosen, it is chosen first: the shortest tour on what is now believed.

    Work counts node expansions, with 1/256 for every cell summed.
    """
    belief = place.belief.copy()
    if sensed is not None:
        belief.update(sensed)
    cost = travel_cost(belief)
    goals, beyond, way = (place.goal, *place.later), place.beyond, None
    spent = 0.0
    if all(cost[cell] != IMPASSABLE for cell in (place.start, *goals)):
        if beyond is not None:
            way = route(cost, place.start, place.goal, weight)
            spent = float(way.expansions) if way else 0.0
        elif tour := shortest_tour(cost, place.start, goals, weight):
            goals, beyond, way = tour.goals, tour.beyond, tour.first
            spent = float(tour.expansions)
    if way is None:
        yield 0.0, NoWay()
        return
    end, left = sub_goal(way, place, cost)
    window = disc(place.start, place.radius, belief.shape)
    # ATP's blocks must be blocks of the whole map, so the window begins at a multiple of them.
    top, side = (at // BLOCK * BLOCK for at in (window.row, window.column))
    bottom, right = (cut.stop for cut in window.window)
    cut = slice(top, bottom), slice(side, right)
    domain = 1.0 / (1.0 + np.exp(-belief.log_odds[cut]))
    np.copyto(domain, ~belief.touched_blocked[cut] * np.float32(-1) + 1, where=belief.touched[cut])
    start = place.start[0] - top, place.start[1] - side
    for step in steps(domain, start, (end[0] - top, end[1] - side)):
        plan = None
        if step.plan is not None:
            plan = FramePlan(
                _moved(step.plan, top, side),
                place.start,
                end,
                goals[0],
                left,
                belief,
                goals[1:],
                beyond or 0.0,
            )
        yield step.work + spent, plan
        spent = 0.0


def _moved(plan: MultiPath, top: int, side: int) -> MultiPath:
    """The plan of a window that begins at (top, side), on the whole map."""
    moved = plan.plan.copy()
    moved[:, 1] += top >> moved[:, 0]
    moved[:, 2] += side >> moved[:, 0]
    return replace(plan, plan=moved)


def follow(free: NDArray[np.bool_], frame: FramePlan, start: Cell, *, insist: int = 0) -> Walk:
    """Walk a frame on the true floor with what was believed when it was planned, on a leash.

    insist: how often plans led nowhere new. Then the robot follows none: obstacle avoidance alone
    takes it to the sub-goal, after `PATIENCE` times to the goal, on a leash twice as long each
    time; so it arrives in the end if a way exists.
    """
    cost = travel_cost(frame.belief)
    touched = frame.belief.touched.copy()
    if not insist:
        plan = frame.plan.plan
        return walk(free, cost, touched, plan, start, frame.sub_goal, leash=frame.leash)
    target = frame.sub_goal if insist < PATIENCE else frame.goal
    leash = frame.leash * 2.0 ** min(insist, 40)
    return walk(free, cost, touched, NO_PLAN, start, target, leash=leash)


class FrameProblem(Protocol):
    """A problem for `find_path`: the place, and the true floor to judge by."""

    @property
    def place(self) -> Place: ...
    @property
    def free(self) -> NDArray[np.bool_]: ...


def frame_quality(frame: FramePlan | NoWay, problem: FrameProblem) -> float:
    """How much nearer the goal a frame leads for each cell that is really walked, in [0, 1]."""
    if isinstance(frame, NoWay):
        return 0.0
    walked = follow(problem.free, frame, problem.place.start)
    row, column = (int(at) for at in walked.cells[-1])
    before = astar(problem.free, problem.place.start, frame.goal)
    after = astar(problem.free, (row, column), frame.goal)
    if before is None or after is None:
        return 0.0
    if walked.length == 0:
        return 1.0 if before.length == 0 else 0.0
    return float(np.clip((before.length - after.length) / walked.length, 0.0, 1.0))


@anytime.module(
    quality=frame_quality,
    estimate=lambda frame: frame.plan.estimate if isinstance(frame, FramePlan) else 0.0,
)
def find_path(sensed: SensedMap, place: Place) -> Iterator[FramePlan | NoWay | None]:
    """Plan the next frame with what was just sensed. Work is counted in node expansions."""
    for work, frame in plan_frame(sensed, place):
        anytime.charge(work)
        yield frame
