"""Bounds for programs whose tables grow too large to be joined.

Each table may be charged a share of what its neighbours cost, so long as no seconds are lost or
made: the sum of the least entries of all tables is then never more than the least time of the
program. Shares that make it as large as they can are found by passing costs through the calls,
forwards and backwards [Kol15]. On programs of modules it is nearly always the least time itself;
where it is not, it tells which levels no division as good as the one in hand goes through.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from compiler.elimination import (
    MIN_PLUS,
    Factor,
    Floats,
    Levels,
    cheapest_levels,
    eliminate,
    order_of,
)

TIE = 1e-9  # share of a time by which two are the same: what rounding leaves


class Relaxation:
    """Shares of cost while they are improved; `bound` holds at any moment.

    The variables `fixed` have one level, the others all of theirs at first. `alive`: levels that
    are left, by variable. `tables`: over those, with what they are charged. `seen`: cells of tables
    looked at since it was made.
    """

    def __init__(self, factors: Sequence[Factor], fixed: Mapping[str, int]) -> None:
        self.scopes = tuple([factor.scope for factor in factors])
        self.alive: dict[str, Levels] = {}
        self.tables: list[Floats] = []
        for factor in factors:
            for name, size in zip(factor.scope, factor.table.shape, strict=True):
                self.alive[name] = np.array([fixed[name]]) if name in fixed else np.arange(size)
            index = np.ix_(*[self.alive[name] for name in factor.scope])
            self.tables.append(factor.table[index].copy())
        # What is charged to none of the tables just now.
        self.costs = {name: np.zeros(len(levels)) for name, levels in self.alive.items()}
        self.seen = 0
        self._touching = {
            name: [(number, s.index(name)) for number, s in enumerate(self.scopes) if name in s]
            for name in self.alive
        }
        # Factors that speak of a later variable, to which costs are passed on, and of an earlier.
        place = {name: number for number, name in enumerate(self.alive)}
        ends = [{place[name] for name in scope} for scope in self.scopes]
        self._after: dict[str, list[int]] = {}
        self._before: dict[str, list[int]] = {}
        for name, touching in self._touching.items():
            self._after[name] = [n for n, _ in touching if max(ends[n]) > place[name]]
            self._before[name] = [n for n, _ in touching if min(ends[n]) < place[name]]

    @property
    def bound(self) -> float:
        """Seconds that the program takes at least; inf when it is impossible."""
        if not all(len(levels) for levels in self.alive.values()):
            return np.inf
        least = sum(float(table.min()) for table in self.tables)
        return least + sum(float(cost.min()) for cost in self.costs.values())

    def improve(self) -> None:
        """Pass costs on to the calls that use a result, then back to those it comes from. The
        first alone is exact where every result is used once."""
        for variable in self.alive:
            self._pass(variable, self._after[variable])
        for variable in reversed(self.alive):
            self._pass(variable, self._before[variable])

    def prune(self, seconds: float) -> None:
        """Drop the levels that no division within these seconds goes through."""
        for variable, touching in self._touching.items():
            self._pass(variable, ())
            cost = self.costs[variable]
            rest = self.bound - float(cost.min(initial=np.inf))
            self._keep(variable, rest + cost <= seconds * (1 + TIE))
            self._pass(variable, [number for number, _ in touching])

    def rounded(self) -> dict[str, int]:
        """A level for each variable, from the last to the first the cheapest by what is charged."""
        chosen: dict[str, int] = {}
        for variable in reversed(self.alive):
            cost = self.costs[variable]
            for number, _ in self._touching[variable]:
                scope = self.scopes[number]
                part = self.tables[number][tuple([chosen.get(n, slice(None)) for n in scope])]
                axis = [name for name in scope if name not in chosen].index(variable)
                cost = cost + _least_along(part, axis)
            chosen[variable] = int(np.argmin(cost))
        return {name: int(self.alive[name][number]) for name, number in chosen.items()}

    def joined_cells(self) -> float:
        """Cells of the largest table that elimination over the levels that are left would join."""
        return order_of(self._factors(), ()).cells

    def eliminated(self) -> dict[str, int]:
        """The cheapest levels of those that are left, by elimination."""
        factors = self._factors()
        _, steps = eliminate(factors, order_of(factors, ()), MIN_PLUS)
        found = cheapest_levels(steps, {})
        return {name: int(self.alive[name][number]) for name, number in found.items()}

    def halves(self) -> tuple[Relaxation, Relaxation]:
        """The lower and the higher levels of the variable that most tables depend on."""
        variable = max(
            self.alive,
            key=lambda name: len(self.alive[name]) ** (1 + len(self._touching[name])),
        )
        low, high = self._copy(), self._copy()
        lower = np.arange(len(self.alive[variable])) < len(self.alive[variable]) // 2
        low._keep(variable, lower)
        high._keep(variable, ~lower)
        return low, high

    def _copy(self) -> Relaxation:
        other = copy.copy(self)
        other.tables = [table.copy() for table in self.tables]
        other.alive, other.costs = dict(self.alive), dict(self.costs)
        other.seen = 0
        return other

    def _factors(self) -> list[Factor]:
        tables = zip(self.scopes, self.tables, strict=True)
        return [
            *[Factor(scope, table) for scope, table in tables],
            *[Factor((name,), cost) for name, cost in self.costs.items()],
        ]

    def _pass(self, variable: str, onward: Sequence[int]) -> None:
        """Take what the tables cost at each level of the variable and share it among `onward`."""
        touching = self._touching[variable]
        least = [_least_along(self.tables[number], axis) for number, axis in touching]
        costs = np.sum([self.costs[variable], *least], axis=0)
        possible = np.isfinite(costs)
        self._keep(variable, possible)
        costs = costs[possible]
        share = costs / max(len(onward), 1)
        self.costs[variable] = np.zeros_like(costs) if onward else costs
        for (number, axis), taken in zip(touching, least, strict=True):
            table = self.tables[number]
            self.seen += table.size
            change = (share if number in onward else 0.0) - taken[possible]
            table += change.reshape([-1 if a == axis else 1 for a in range(table.ndim)])

    def _keep(self, variable: str, kept: NDArray[np.bool_]) -> None:
        if kept.all():
            return
        self.alive[variable] = self.alive[variable][kept]
        self.costs[variable] = self.costs[variable][kept]
        for number, axis in self._touching[variable]:
            self.tables[number] = np.compress(kept, self.tables[number], axis=axis)


def _least_along(table: Floats, axis: int) -> Floats:
    """The least entry at each place along an axis; inf where there is none."""
    others = tuple([a for a in range(table.ndim) if a != axis])
    return table.min(axis=others, initial=np.inf) if others else table
