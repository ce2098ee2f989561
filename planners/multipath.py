"""The plan of an abstract planner: successive segments of arbitrary level [ZR93 §3.2]."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planners.search import DIAGONAL, STRAIGHT


@dataclass(frozen=True, eq=False)
class Segment:
    """A piece of a plan on one level of abstraction.

    `cells` is int32 [n, 2] of (row, column) on that level: a cell of level 3 stands for 8 x 8 cells
    of the map. `obstacleness` in [0, 1] is the mean share of it that is blocked.
    """

    level: int
    cells: NDArray[np.int32]
    obstacleness: float


@dataclass(frozen=True, eq=False)
class MultiPath:
    """A plan that any robot with obstacle avoidance can execute, however abstract it still is.

    `plan` is int32 [n, 3] of (level, row, column), all segments one after the other; `bounds` is
    int32 [m + 1], segment i is `plan[bounds[i]:bounds[i + 1]]`; `obstacleness` is float [m].
    `length` is what the planner believes that will be walked, in cells (infinite where it knows of
    no way), and `least` the least that it can be: the octile distance, or what is proven beyond it.
    """

    plan: NDArray[np.int32]
    bounds: NDArray[np.int32]
    obstacleness: NDArray[np.float64]
    length: float
    least: float

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The segments in the order in which they are walked."""
        pieces = zip(self.bounds[:-1], self.bounds[1:], self.obstacleness, strict=True)
        return tuple(
            Segment(int(self.plan[begin, 0]), self.plan[begin:end, 1:], float(blocked))
            for begin, end, blocked in pieces
        )

    @property
    def level(self) -> int:
        """The highest level that is left; 0 for a plan without any abstraction."""
        return int(self.plan[:, 0].max(initial=0))

    @property
    def estimate(self) -> float:
        """Least possible / believed length, in [0, 1]: a bound on the quality of a way from cell to
        cell, and what is visible of that of an abstract plan."""
        return min(1.0, self.least / self.length) if self.length > 0 else 1.0

    def __str__(self) -> str:
        levels = ", ".join(
            f"{sum(segment.level == level for segment in self.segments)} of level {level}"
            for level in sorted({segment.level for segment in self.segments}, reverse=True)
        )
        return f"plan of {self.length:.1f} cells: {levels or 'nothing to walk'}"


@dataclass(frozen=True, eq=False)
class Step:
    """What a planner did since its last step: the work, and the best plan if it is a new one."""

    work: float
    plan: MultiPath | None


_FREE = np.zeros(1)  # the obstacleness of every way
_FREE.flags.writeable = False


def way_plan(plan: NDArray[np.int32], diagonal: int, cost: float, least: float) -> MultiPath:
    """A plan without any abstraction: a way from cell to cell.

    `plan` is int32 [n, 3] of (0, row, column), with so many diagonal steps: see
    `frontier.cells_of`. `cost` is what the search says of it (10 000 a straight step over a cell of
    cost 1), `least` a proven lower bound of that. Where believed obstacles are crossed, `length`
    counts them as what they cost.
    """
    # Counted rather than summed, so that equal ways have equal lengths to the last bit.
    diagonal = int(diagonal)  # numba leaves it an int, plain numpy an int64
    straight = max(len(plan) - 1, 0) - diagonal
    length = straight + diagonal * math.sqrt(2)
    dear = cost - (straight * STRAIGHT + diagonal * DIAGONAL)
    if dear > 0:
        length += dear / STRAIGHT
    bound = min(1.0, least / cost) if cost > 0 else 1.0
    return MultiPath(plan, np.array([0, len(plan)], np.int32), _FREE, length, bound * length)


NO_WAY = MultiPath(np.empty((0, 3), np.int32), np.zeros(1, np.int32), np.zeros(0), math.inf, 0.0)
"""The plan that says that the base level has no way."""
