"""Weighted A* with its weight as a knob: a longer way sooner, a shorter one later [Pohl 1970]."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import anytime
from planners.path_finding import Cell, Path, weighted_astar


@anytime.module(cost=lambda way: way.length)
def find_path(
    free: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    *,
    weight: float = anytime.knob([5.0, 2.0, 1.2, 1.0]),
) -> Iterator[Path]:
    """One way, at most `weight` times as long as the shortest; none where there is none.

    free: bool [rows, columns]. Work is counted in node expansions.
    """
    way = weighted_astar(free, start, goal, weight)
    if way is not None:
        anytime.charge(way.expansions)
        yield way
