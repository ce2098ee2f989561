"""In which order to visit several goals: the shortest tour on what is believed of a floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from planners.path_finding import Cell, Path, route

MOST_GOALS = 8  # all their orders are compared: 40,320


@dataclass(frozen=True, eq=False)
class Tour:
    """An order in which to visit goals.

    goals: in that order. first: the way to the first of them. beyond: length of the ways from each
    to the next, in cells. expansions: work of all the searches.
    """

    goals: tuple[Cell, ...]
    first: Path
    beyond: float
    expansions: int

    @property
    def length(self) -> float:
        return self.first.length + self.beyond


def shortest_tour(
    cost: NDArray[np.uint8], start: Cell, goals: Sequence[Cell], weight: float = 1.0
) -> Tour | None:
    """The shortest tour from start through all goals, or None where no way leads to one of them.

    cost: uint8 [rows, columns] as of `route`; the ways are its, and a way back is as long as the
    way there. weight: of those searches; with 1, and where all free cells cost 1, no tour is
    shorter. Raises AnytimeError without a goal, or for more than `MOST_GOALS`.

    A way is searched for when the best order uses it; until then it is as long as on an empty
    floor, which no way is shorter than. So an order all of whose ways are known is the best
    [Dellin & Srinivasa 2016].
    """
    if not 1 <= len(goals) <= MOST_GOALS:
        raise AnytimeError(f"a tour through {len(goals)} goals; it takes 1 to {MOST_GOALS}")
    cells = [start, *goals]
    lengths = _on_an_empty_floor(np.array(cells))
    ways: dict[tuple[int, int], Path] = {}
    orders = np.array([(0, *order) for order in permutations(range(1, len(cells)))])
    while True:
        totals = lengths[orders[:, :-1], orders[:, 1:]].sum(axis=1)
        best = orders[int(np.argmin(totals))].tolist()
        legs = [(min(pair), max(pair)) for pair in pairwise(best)]
        unknown = [leg for leg in legs if leg not in ways]
        if not unknown:
            break
        for one, other in unknown:
            way = route(cost, cells[one], cells[other], weight)
            if way is None:
                return None
            ways[one, other] = way
            lengths[one, other] = lengths[other, one] = way.length
    return Tour(
        tuple(cells[index] for index in best[1:]),
        ways[legs[0]],
        float(sum(ways[leg].length for leg in legs[1:])),
        sum(way.expansions for way in ways.values()),
    )


def _on_an_empty_floor(cells: NDArray[np.integer]) -> NDArray[np.float64]:
    """Lengths of the ways between cells [n, 2] where nothing is in the way, [n, n]."""
    apart = np.abs(cells[:, None] - cells[None])
    return apart.max(axis=2) + (np.sqrt(2.0) - 1.0) * apart.min(axis=2)
