"""The plan of an abstract planner: successive segments of arbitrary level [ZR93 §3.2]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


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
    no way), and `straight` the least that it can be (octile distance).
    """

    plan: NDArray[np.int32]
    bounds: NDArray[np.int32]
    obstacleness: NDArray[np.float64]
    length: float
    straight: float

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
        """Straight distance / believed length, in [0, 1]: what is visible of the quality."""
        return min(1.0, self.straight / self.length) if self.length > 0 else 1.0

    def __str__(self) -> str:
        levels = ", ".join(
            f"{sum(segment.level == level for segment in self.segments)} of level {level}"
            for level in sorted({segment.level for segment in self.segments}, reverse=True)
        )
        return f"plan of {self.length:.1f} cells: {levels or 'nothing to walk'}"
