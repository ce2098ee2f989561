"""The least time for every level of a program's result, with a proof or with bounds."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compiler.climbing import climbed, cost_of
from compiler.elimination import (
    MIN_PLUS,
    Factor,
    Floats,
    Levels,
    Step,
    all_cheapest_levels,
    eliminate,
    order_of,
)
from compiler.relaxation import TIE, Relaxation

CELLS = 2e7  # of the largest joined table up to which elimination is tried
WORK = 1e9  # cells of tables looked at for one level of the output, at most (seconds)
PASSES = 30  # of costs through the calls for one part, at most
GAINING = 0.1  # share of the gap that a pass must close to be followed by another


@dataclass(frozen=True)
class Solution:
    """The cheapest way found to every level of the output, and what it costs at least.

    seconds: [L] in all for each level of the output, inf where there is no way. bound: [L] no way
    is cheaper than that; equal to seconds where that is proven. ways: steps of elimination, or
    [L] levels by variable. method: how it was found.
    """

    output: str
    seconds: Floats
    bound: Floats
    ways: tuple[Step, ...] | Mapping[str, Levels]
    method: str

    def levels(self, wanted: Levels) -> dict[str, Levels]:
        """The levels of all variables on the ways to [K] levels of the output; without meaning
        where there is no way."""
        if isinstance(self.ways, tuple):
            return all_cheapest_levels(self.ways, {self.output: wanted})
        return {name: levels[wanted] for name, levels in self.ways.items()}

    @property
    def exact(self) -> bool:
        return bool((self.bound == self.seconds).all())

    def gap(self, qualities: Floats) -> float:
        """How much quality may be missing at any budget, at most. qualities: [L] of the levels."""
        possible = np.isfinite(self.bound)
        budgets = self.bound[possible]
        found = np.where(self.seconds <= budgets[:, None] * (1 + TIE), qualities, 0.0)
        reached = np.where(self.bound <= budgets[:, None], qualities, 0.0)
        missing = reached.max(axis=1, initial=0.0) - found.max(axis=1, initial=0.0)
        return float(missing.max(initial=0.0))


def cheapest(factors: Sequence[Factor], output: str, cells: float = CELLS) -> Solution:
    """The least time for every level of the output, all budgets at once.

    factors: the seconds of each call for its levels, in the order of the calls. Exact by
    elimination while the largest joined table has at most `cells` cells; beyond, one level of the
    output after the other by branch and bound on the relaxation, which is nearly always exact too.
    """
    order = order_of(factors, (output,))
    if order.cells <= cells:
        costs, steps = eliminate(factors, order, MIN_PLUS)
        return Solution(output, costs.table, costs.table, steps, "elimination")
    count = next(
        size
        for factor in factors
        for name, size in zip(factor.scope, factor.table.shape, strict=True)
        if name == output
    )
    ways = [_cheapest_to(factors, {output: level}, cells) for level in range(count)]
    names = dict.fromkeys(name for factor in factors for name in factor.scope)
    return Solution(
        output,
        np.array([way.seconds for way in ways]),
        np.array([way.bound for way in ways]),
        {name: np.array([way.levels.get(name, 0) for way in ways]) for name in names},
        "branch and bound",
    )


@dataclass(frozen=True)
class _Way:
    """Levels of all variables, their seconds in all, and the bound."""

    levels: Mapping[str, int]
    seconds: float
    bound: float


def _cheapest_to(factors: Sequence[Factor], fixed: Mapping[str, int], cells: float) -> _Way:
    """Branch and bound: parts of the levels, the one with the least bound first."""
    best = _Way({}, np.inf, np.inf)
    number = itertools.count()
    waiting = [(0.0, next(number), Relaxation(factors, fixed))]
    seen = 0
    while waiting and seen < WORK:
        bound, _, part = heapq.heappop(waiting)
        if bound >= best.seconds * (1 - TIE):
            return _Way(best.levels, best.seconds, best.seconds)
        best = _tightened(part, factors, fixed, best)
        seen += part.seen
        if part.bound >= best.seconds * (1 - TIE):
            continue
        if part.joined_cells() <= cells:
            best = _better(best, factors, part.eliminated())
            continue
        for half in part.halves():
            heapq.heappush(waiting, (max(bound, half.bound), next(number), half))
    if not waiting:
        return _Way(best.levels, best.seconds, best.seconds)
    return _Way(best.levels, best.seconds, min(waiting[0][0], best.seconds))


def _tightened(
    part: Relaxation, factors: Sequence[Factor], fixed: Mapping[str, int], best: _Way
) -> _Way:
    """Improve the bound of the part while that gains, and the best way by what is met."""
    gap, found = np.inf, dict(best.levels)
    for _ in range(PASSES):
        before = part.bound
        part.improve()
        if not np.isfinite(part.bound):
            return best
        found = part.rounded()
        best = _better(best, factors, found)
        gap = best.seconds - part.bound
        if gap <= TIE * best.seconds or part.bound - before < GAINING * gap:
            break
    if gap > TIE * best.seconds:
        best = _better(best, factors, climbed(factors, found, frozenset(fixed)))
        if np.isfinite(best.seconds):
            part.prune(best.seconds)
    return best


def _better(best: _Way, factors: Sequence[Factor], levels: Mapping[str, int]) -> _Way:
    seconds = cost_of(factors, levels)
    return _Way(levels, seconds, best.bound) if seconds < best.seconds else best
