"""ATP as it is printed in [ZR93] Figure 3: segments refined between points that are pinned.

It is the reference for the paper's figures, and what the grid robot's missions plan a frame with.
`planners.atp` is the planner for maps with walls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import anytime
from anytime.errors import AnytimeError
from anytime.machine_code import njit
from planners.grids import BELIEVED
from planners.multipath import MultiPath, Step
from planners.path_finding import Cell, index_of
from planners.problems import known_floors, walked_quality
from planners.refining import (
    ABSTRACT,
    COUNT,
    FIRST,
    FULL,
    HEAD_SEGMENT,
    LEVEL,
    NEXT,
    OBSTACLENESS,
    Pyramid,
    first_plan,
    refine,
)
from planners.search import DIAGONAL, STRAIGHT, workspace

CALLED = "c08f699498be"

HIGHEST_LEVEL = 3
"""The paper's Lmax."""

# Fewer abstract positions than this between start and goal are no plan: begin a level lower.
_FEWEST_POSITIONS = 4
# Expansions between two steps: as many as half the cells from start to goal and at least these, so
# that a short plan has several steps and Python's share of a long one stays small.
_LEAST_GRAIN = 16
# A streamed cell is worth 1/256 of an expansion, in all places where work is counted.
_STREAMED_PER_EXPANSION = 256
# How much longer than planned a robot walks that bumps its way through obstacleness p: fitted to
# blind walks on uniform floors of 10 to 35 %, 1 + p/2 + 3.5 p².
_LINEAR, _SQUARE = 0.5, 3.5


def steps(
    domain: NDArray[np.floating],
    start: Cell,
    goal: Cell,
    *,
    highest_level: int | None = None,
    grain: int | None = None,
) -> Iterator[Step]:
    """Plan from start to goal, abstractly at first, then in ever more detail.

    As `refinements`, but a plan that is believed longer than an earlier one is not told: such a
    step brings none, unless it is the last, whose plan is refined as far as it can be.
    """
    best: MultiPath | None = None
    for step in refinements(domain, start, goal, highest_level=highest_level, grain=grain):
        plan = step.plan
        assert plan is not None  # every refinement brings one
        # A base level plan's length is known, an abstract one's only believed.
        better = best is None or plan.length < best.length or plan.level == 0 < best.level
        best = plan if better else best
        if step.work or better:
            yield Step(step.work, plan if better else None)


def refinements(
    domain: NDArray[np.floating],
    start: Cell,
    goal: Cell,
    *,
    highest_level: int | None = None,
    grain: int | None = None,
) -> Iterator[Step]:
    """Every plan that ATP registers, as Fig. 3 has it, whether it is better or not.

    `domain` is float32 [rows, columns], the probability that a cell is blocked. A cell that is
    blocked for certain (1.0) is impassable, a believed obstacle only dear. The first step brings a
    plan at `highest_level` (chosen by distance, at most 3, if None), later ones refine its worst
    segment, at least `grain` expansions a step (by distance, if None; 1 is one segment a step).
    Work is counted in node expansions, with 1/256 for every cell summed.

    Raises AnytimeError if start or goal is outside the domain or certainly blocked. If no way leads
    to the goal an abstract plan says nothing of it: the robot that follows it finds out. A plan
    without any cell, of infinite length, says that the base level has no way.
    """
    domain = np.ascontiguousarray(domain, np.float32)
    if domain.ndim != 2 or not domain.size:
        raise AnytimeError(f"the domain is {list(domain.shape)}, it must be [rows, columns]")
    first, last = index_of(start, domain.shape, "start"), index_of(goal, domain.shape, "goal")
    for index, name, cell in ((first, "start", start), (last, "goal", goal)):
        if domain.reshape(-1)[index] >= 1.0:
            raise AnytimeError(
                f"{name} cell ({cell[0]}, {cell[1]}) is blocked for certain, choose a free cell"
            )
    distance = max(abs(start[0] - goal[0]), abs(start[1] - goal[1]))
    level = _level(distance) if highest_level is None else highest_level
    grain = max(_LEAST_GRAIN, distance // 2) if grain is None else grain
    if grain < 1:
        raise AnytimeError(f"grain is {grain}, it must be at least 1 expansion")
    if not 0 <= level <= 15:
        raise AnytimeError(f"highest_level is {level}, it must be between 0 and 15")
    pyramid, streamed = _pyramid(domain, level)
    if streamed < 0:
        raise AnytimeError("the domain holds a number outside [0, 1], they must be probabilities")
    straight = _straight(start, goal)
    state, expansions = first_plan(pyramid, level, first, last, workspace(domain.size))
    work = float(expansions + streamed / _STREAMED_PER_EXPANSION)
    yield Step(work, _multipath(state, pyramid, straight))
    done = False
    while not done:
        # A generator may be resumed by another thread, which has a workspace of its own.
        state, expansions, done = refine(state, pyramid, grain, workspace(domain.size))
        yield Step(float(expansions), _multipath(state, pyramid, straight))


@anytime.module(
    quality=walked_quality,
    estimate=lambda plan: plan.estimate,
    name="paper_atp",
    problems=known_floors,
)
def find_path(domain, start, goal):
    """Plan a path from start to goal; `domain` is the probability of being blocked of each cell."""
    for step in steps(domain, start, goal):
        anytime.charge(step.work)
        yield step.plan


def _level(distance: int) -> int:
    level = HIGHEST_LEVEL
    while level > 0 and distance >> level < _FEWEST_POSITIONS:
        level -= 1
    return level


def _straight(start: Cell, goal: Cell) -> float:
    near, far = sorted((abs(start[0] - goal[0]), abs(start[1] - goal[1])))
    return far - near + near * math.sqrt(2)


def _multipath(state, pyramid: Pyramid, straight: float) -> MultiPath:
    plan, bounds, blocked, length = _flatten(state, pyramid)
    believed = max(float(length), straight) if len(plan) else math.inf
    return MultiPath(plan, bounds, blocked, believed, straight)


def _abstract_costs() -> NDArray[np.uint8]:
    """The search cost of an abstract cell by its obstacleness: length and obstacleness together."""
    p = np.arange(FULL + 1) / FULL
    return (ABSTRACT * (1.0 + _LINEAR * p + _SQUARE * p * p) + 0.5).astype(np.uint8)


_ABSTRACT_COST = _abstract_costs()


@njit(cache=True, nogil=True)
def _pyramid(domain, highest):
    """Sum a domain up to its obstacleness on all levels: (pyramid, cells streamed, -1 if invalid).

    Cells outside the map count as blocked.
    """
    rows, columns = domain.shape
    offset, widths = np.zeros(highest + 2, np.int64), np.zeros(highest + 1, np.int64)
    height, width = rows, columns
    for level in range(highest + 1):
        widths[level] = width
        offset[level + 1] = offset[level] + height * width
        height, width = (height + 1) // 2, (width + 1) // 2
    obstacleness = np.empty(offset[highest + 1], np.int32)
    cost = np.empty(offset[highest + 1], np.uint8)
    pyramid = Pyramid(obstacleness, cost, offset, widths)
    streamed = rows * columns
    for row in range(rows):
        for column in range(columns):
            p = float(domain[row, column])
            if not 0.0 <= p <= 1.0:
                return pyramid, -1
            # Rounded down, so that only what is certain counts as full.
            obstacleness[row * columns + column] = int(p * FULL)
            cost[row * columns + column] = BELIEVED[int(p * FULL)]
    for level in range(1, highest + 1):
        below, here, width = offset[level - 1], offset[level], widths[level - 1]
        height = (here - below) // width
        streamed += here - below
        there = here
        for row in range(0, height, 2):
            for column in range(0, width, 2):
                first = below + row * width + column
                if row + 1 < height and column + 1 < width:
                    total = obstacleness[first] + obstacleness[first + 1] + 2
                    total += obstacleness[first + width] + obstacleness[first + width + 1]
                else:
                    # At the edge the diagonal one and at least one of these are outside.
                    total = obstacleness[first] + FULL + 2
                    total += obstacleness[first + 1] if column + 1 < width else FULL
                    total += obstacleness[first + width] if row + 1 < height else FULL
                obstacleness[there] = total >> 2
                cost[there] = _ABSTRACT_COST[total >> 2]
                there += 1
    return pyramid, streamed


@njit(cache=True, nogil=True)
def _flatten(state, pyramid):
    """List all cells of a plan in order: (plan, bounds, obstacleness, believed length)."""
    segments, cells, number = 0, 0, int(state.size[HEAD_SEGMENT])
    while number >= 0:
        segments += 1
        cells += int(state.segment[number, COUNT])
        number = int(state.segment[number, NEXT])
    plan = np.empty((cells, 3), np.int32)
    bounds = np.zeros(segments + 1, np.int32)
    obstacleness = np.empty(segments)
    segments, cells, length = 0, 0, 0.0
    number = int(state.size[HEAD_SEGMENT])
    while number >= 0:
        level, first = int(state.segment[number, LEVEL]), int(state.segment[number, FIRST])
        columns, base = pyramid.columns[level], pyramid.offset[level]
        before, before_row, before_column = 0.0, 0, 0
        for place in range(int(state.segment[number, COUNT])):
            there = int(state.cell[first + place])
            row, column = there // columns, there % columns
            plan[cells, 0] = level
            plan[cells, 1] = row
            plan[cells, 2] = column
            cells += 1
            p = pyramid.obstacleness[base + there] / FULL
            through = 1.0 + _LINEAR * p + _SQUARE * p * p
            if place > 0:
                straight = row == before_row or column == before_column
                step = (STRAIGHT if straight else DIAGONAL) << level
                length += step * (before + through) / (2.0 * STRAIGHT)
            before, before_row, before_column = through, row, column
        obstacleness[segments] = state.segment[number, OBSTACLENESS] / FULL
        segments += 1
        bounds[segments] = cells
        number = int(state.segment[number, NEXT])
    return plan, bounds, obstacleness, length
