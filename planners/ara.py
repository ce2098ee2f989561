"""ARA*, the anytime repairing A* of Likhachev, Gordon and Thrun (NIPS 2003).

It searches with a heuristic that weighs too much, and then ever less. What an iteration finds out
is kept: nodes whose way became shorter after they were expanded wait, as inconsistent, for the next
iteration, and nothing else is expanded again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import anytime
from anytime.errors import AnytimeError
from anytime.machine_code import njit
from planners.atp import GRAIN
from planners.frontier import cells_of, least_way, next_base, path_to, pop, sift_up, way_cost
from planners.grids import Grid, endpoints
from planners.multipath import NO_WAY, Step, way_plan
from planners.path_finding import Cell, percent_of
from planners.problems import known_floors, walked_quality
from planners.search import DIAGONAL, OUT_OF_BUDGET, SPAN, STRAIGHT

CALLED = "5afabff1aa83"

WEIGHTS = (3.0, 2.5, 2.0, 1.5, 1.4, 1.3, 1.2, 1.1, 1.05, 1.02, 1.0)
"""Weights of the heuristic, one after the other."""
_DONE = 0
_SIZE, _WAITING, _UPPER, _ITERATION, _SHIFT = 0, 1, 2, 3, 16


class _Run(NamedTuple):
    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    key: NDArray[np.int64]
    heap: NDArray[np.int32]
    slot: NDArray[np.int32]
    waiting: NDArray[np.int32]
    state: NDArray[np.int64]


def steps(
    domain: NDArray[np.floating] | Grid,
    start: Cell,
    goal: Cell,
    *,
    weights: Sequence[float] = WEIGHTS,
    connectivity: int = 8,
) -> Iterator[Step]:
    """Plan from start to goal: a way at most `weights[0]` times the cheapest, then shorter ones.

    As `planners.steps`: work is counted in expansions, and plans are ways from cell to cell, whose
    `estimate` is the bound that their weight, or the least f that is open, proves. Weights count in
    whole per cent.
    Raises AnytimeError for weights that do not fall from 100 at most to 1 or more, and as
    `planners.steps`.
    """
    percents = [percent_of(weight) for weight in weights]
    if not percents or sorted(percents, reverse=True) != percents:
        raise AnytimeError(f"weights are {tuple(weights)}: there must be one, and they must fall")
    grid = domain if isinstance(domain, Grid) else Grid(domain)
    first, last, diagonals = endpoints(grid, start, goal, connectivity)
    columns, cells = grid.shape[1], grid.cost.size
    if first == last:
        yield Step(0.0, way_plan(*cells_of(np.array([first], np.int32), columns, 1), 0.0, 0.0))
        return
    run = _Run(
        clock=np.zeros(1, np.int64),
        label=np.zeros(cells, np.int64),
        key=np.zeros(cells, np.int64),
        heap=np.zeros(cells, np.int32),
        slot=np.zeros(cells, np.int32),
        waiting=np.zeros(cells, np.int32),
        state=np.zeros(4, np.int64),
    )
    down, across = last // columns - first // columns, last % columns - first % columns
    least, known, changes = int(least_way(down, across, diagonals)), float(SPAN), grid.changes
    for iteration, percent in enumerate(percents):
        lowest = _begin(columns, first, last, diagonals, percent, iteration, run)
        least = max(least, int(min(lowest, known)))
        found = OUT_OF_BUDGET
        while found == OUT_OF_BUDGET:
            found, taken = _improve(
                grid.cost, grid.wall, columns, last, diagonals, percent, run, GRAIN
            )
            cost, plan = float(run.state[_UPPER]), None
            if found != OUT_OF_BUDGET and cost < SPAN:
                least = max(least, math.ceil(100 * cost / percent))
            if cost < known:
                way = path_to(grid.cost, grid.wall, columns, first, last, diagonals, run)
                # Labels that were corrected late may have made it cheaper than the goal's says.
                known = float(way_cost(grid.cost, grid.wall, columns, way, 0, len(way) - 1))
                run.state[_UPPER] = int(known)
                plan = way_plan(*cells_of(way, columns, 1), known, least)
            yield Step(float(taken), plan)
            grid.unchanged(since=changes)
    if known == SPAN:
        yield Step(0.0, NO_WAY)


@anytime.module(
    quality=walked_quality,
    estimate=lambda plan: plan.estimate,
    name="ara",
    problems=known_floors,
)
def find_path(domain, start, goal):
    """Plan a path with ARA*; `domain` is the probability of being blocked of each cell."""
    for step in steps(domain, start, goal):
        anytime.charge(step.work)
        yield step.plan


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(columns, start, goal, diagonals, percent, iteration, run):
    """Begin an iteration on what is open or inconsistent, by its weight. Returns the least f."""
    state, label, key, heap, slot = run.state, run.label, run.key, run.heap, run.slot
    if iteration == 0:
        base = next_base(run)
        state[_SIZE], state[_WAITING], state[_UPPER] = 1, 0, SPAN
        heap[0] = start
        label[start] = base
    base, opened = run.clock[0], state[_SIZE]
    for place in range(state[_WAITING]):
        heap[opened] = run.waiting[place]
        opened += 1
    size, lowest = 0, SPAN
    weight = (percent << _SHIFT) // 100
    for place in range(opened):
        node = np.int64(heap[place])
        g = base - label[node]
        h = least_way(node // columns - goal // columns, node % columns - goal % columns, diagonals)
        if g + h >= state[_UPPER]:
            slot[node] = -1  # cannot beat the way in hand
            continue
        lowest = min(lowest, g + h)
        # What stood here has been read, for no more are kept than were read.
        sift_up(size, node, g + (h * weight >> _SHIFT), heap, slot, key, label)
        size += 1
    state[_SIZE], state[_WAITING], state[_ITERATION] = size, 0, iteration
    return lowest


@njit(cache=True, nogil=True, error_model="numpy")
def _improve(cost, wall, columns, goal, diagonals, percent, run, budget):
    """Expand until nothing open can better the way in hand by this weight: (DONE or OUT_OF_BUDGET,
    expansions)."""
    state, label, key, heap, slot = run.state, run.label, run.key, run.heap, run.slot
    waiting, base, size, rows = run.waiting, run.clock[0], state[_SIZE], cost.size // columns
    upper, expansions, weight = state[_UPPER], 0, (percent << _SHIFT) // 100
    closed, inconsistent = -2 - 2 * state[_ITERATION], -3 - 2 * state[_ITERATION]
    goal_row, goal_column = goal // columns, goal % columns
    while size > 0 and key[0] < upper:
        if expansions >= budget:
            state[_SIZE], state[_UPPER] = size, upper
            return OUT_OF_BUDGET, expansions
        node = pop(size, heap, slot, key, label)
        slot[node] = closed
        size -= 1
        expansions += 1
        g = base - label[node]
        row, column = node // columns, node % columns
        if g + least_way(row - goal_row, column - goal_column, diagonals) >= upper:
            continue
        for side in range(8 if diagonals else 4):
            dr = (-1, 1, 0, 0, -1, -1, 1, 1)[side]
            dc = (0, 0, -1, 1, -1, 1, -1, 1)[side]
            if not (0 <= row + dr < rows and 0 <= column + dc < columns):
                continue
            there = node + dr * columns + dc
            swept = int(cost[there])
            if swept == wall:
                continue
            if side >= 4:
                beside, below = int(cost[node + dc]), int(cost[node + dr * columns])
                if beside == wall or below == wall:
                    continue
                swept = max(swept, beside, below)
            new_g = g + (STRAIGHT if side < 4 else DIAGONAL) * swept
            old = label[there]
            if base - new_g <= old:
                continue
            h = least_way(row + dr - goal_row, column + dc - goal_column, diagonals)
            if new_g + h >= upper:
                continue
            known = old > base - SPAN
            label[there] = base - new_g
            if there == goal:
                upper = new_g
                continue
            if known and (slot[there] == closed or slot[there] == inconsistent):
                if slot[there] == closed:
                    slot[there] = inconsistent
                    waiting[state[_WAITING]] = there
                    state[_WAITING] += 1
                continue
            place = size
            if known and slot[there] >= 0:
                place = np.int64(slot[there])
            else:
                size += 1
            sift_up(place, there, new_g + (h * weight >> _SHIFT), heap, slot, key, label)
    # What is left cannot better the way by this weight, but it can with a smaller one.
    state[_SIZE], state[_UPPER] = size, upper
    return _DONE, expansions
