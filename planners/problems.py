"""Problems to measure path planners on: known floors of every kind, corner to corner."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planners.avoidance import blind_quality
from planners.multipath import MultiPath
from planners.path_finding import Cell, astar
from sensing.random_maps import instance

KINDS = ("r10", "r20", "r30", "rooms", "clustered")
SIZES = (64, 128, 192)


class Crossing(Protocol):
    """What the quality of a plan is judged by: the true floor, and the shortest way across it.

    free: bool [rows, columns]. optimal: length in cells.
    """

    @property
    def free(self) -> NDArray[np.bool_]: ...
    @property
    def start(self) -> Cell: ...
    @property
    def goal(self) -> Cell: ...
    @property
    def optimal(self) -> float: ...


@dataclass(frozen=True, eq=False)
class KnownFloor:
    """A floor, all of whose cells are known for certain."""

    name: str
    free: NDArray[np.bool_]
    start: Cell
    goal: Cell

    @property
    def domain(self) -> NDArray[np.float32]:
        """The probability that each cell is blocked."""
        return (~self.free).astype(np.float32)

    @property
    def optimal(self) -> float:
        way = astar(self.free, self.start, self.goal)
        assert way is not None  # instances are connected
        return way.length


def walked_quality(plan: MultiPath, problem: Crossing) -> float:
    """Quality of a plan: shortest length / length that a blind robot walks by it [ZR93 §3.3]."""
    return blind_quality(problem.free, plan.plan, problem.start, problem.goal, problem.optimal)


def known_floors(rng: np.random.Generator) -> Iterator[KnownFloor]:
    """Floors of every kind and size in turn, without end."""
    seed, number = int(rng.integers(2**31)), 0
    while True:
        kind, size = KINDS[number % len(KINDS)], SIZES[number // len(KINDS) % len(SIZES)]
        yield KnownFloor(f"{kind}/{size}/{seed}/{number}", *instance(kind, size, number, seed))
        number += 1
