"""Obstacle avoidance: following any plan, however abstract or wrong, to the goal [ZR93 §3.3]."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from planners.frontier import cells_of
from planners.path_finding import Cell, flat, flat_free, index_of
from planners.search import STRAIGHT, UNLIMITED, workspace
from planners.walking import REACHED, UNREACHABLE
from planners.walking import walk as _walk

# The longest level of a plan's cell: a block of 2^15 cells is wider than any map.
_HIGHEST_LEVEL = 15


@dataclass(frozen=True, eq=False)
class Walk:
    """What a robot did that followed a plan.

    `cells` is int32 [m, 2], every cell it stood on from start to where it ended; `length` is in
    cells, a diagonal counting sqrt 2. `unreachable` is a proof: no way leads to the goal over
    everything that it has not touched and found blocked. A walk that is neither `reached` nor
    `unreachable` was broken off by its leash.
    """

    cells: NDArray[np.int32]
    length: float
    reached: bool
    unreachable: bool
    expansions: int


def walk(
    free: NDArray[np.bool_],
    cost: NDArray[np.uint8],
    touched: NDArray[np.bool_],
    plan: NDArray[np.int32],
    start: Cell,
    goal: Cell,
    *,
    leash: float = math.inf,
) -> Walk:
    """Walk along a plan, touching the 8 neighbours of every cell, and detour where it is blocked.

    `free` bool [rows, columns] is the world. `cost` uint8 [rows, columns] is the robot's belief, at
    least 1 everywhere, and `touched` bool what it knows for certain; both are updated in place:
    touched cells cost 1 or, if blocked, 255, which alone is impassable. `plan` is int32 [n, 3] of
    (level, row, column); an empty one is allowed, the goal follows in any case. As long as a way
    exists the goal is reached, unless the walk would become longer than `leash` cells.
    """
    shape = free.shape
    for grid, name in ((cost, "cost"), (touched, "touched")):
        if grid.shape != shape or not grid.flags.c_contiguous or not grid.flags.writeable:
            raise AnytimeError(
                f"{name} is {list(grid.shape)}, it must be a writeable, contiguous array of the"
                f" map's shape {list(shape)}"
            )
    if leash < 0 or math.isnan(leash):
        raise AnytimeError(f"leash is {leash:g} cells, it must be at least 0")
    world, first = flat_free(free, "free"), index_of(start, shape, "start")
    last = index_of(goal, shape, "goal")
    if not world[first]:
        raise AnytimeError(f"start cell ({start[0]}, {start[1]}) is blocked, no robot can be there")
    limit = UNLIMITED if leash >= UNLIMITED / STRAIGHT else int(leash * STRAIGHT)
    path, ending, expansions = _walk(
        world,
        flat(cost, "cost"),
        flat(touched, "touched"),
        shape[1],
        _checked(plan),
        first,
        last,
        limit,
        workspace(world.size),
    )
    cells, diagonal = cells_of(path, shape[1], 0)
    return Walk(
        cells=cells,
        length=len(cells) - 1 - diagonal + diagonal * math.sqrt(2),
        reached=ending == REACHED,
        unreachable=ending == UNREACHABLE,
        expansions=int(expansions),
    )


def blind_walk(free: NDArray[np.bool_], plan: NDArray[np.int32], start: Cell, goal: Cell) -> Walk:
    """Walk along a plan knowing nothing but that plan: what is not touched is believed free."""
    belief, touched = np.ones(free.shape, np.uint8), np.zeros(free.shape, np.bool_)
    return walk(free, belief, touched, plan, start, goal)


def blind_quality(
    free: NDArray[np.bool_],
    plan: NDArray[np.int32],
    start: Cell,
    goal: Cell,
    optimal_length: float,
) -> float:
    """Return the quality of a plan: optimal length / length walked blindly [ZR93 §3.3].

    0 where the goal cannot be reached; 1 where the start is the goal.
    """
    walked = blind_walk(free, plan, start, goal)
    if not walked.reached:
        return 0.0
    return min(1.0, optimal_length / walked.length) if walked.length > 0 else 1.0


def _checked(plan: NDArray[np.int32]) -> NDArray[np.int32]:
    if plan.ndim != 2 or plan.shape[1] != 3 or plan.dtype.kind not in "iu":
        raise AnytimeError(
            f"the plan is {plan.dtype} {list(plan.shape)}, it must be int32 [n, 3] of"
            " (level, row, column)"
        )
    if len(plan) and not 0 <= plan[:, 0].min() <= plan[:, 0].max() <= _HIGHEST_LEVEL:
        raise AnytimeError(f"a level of the plan is not between 0 and {_HIGHEST_LEVEL}")
    return np.ascontiguousarray(plan, np.int32)
