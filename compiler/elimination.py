"""Variable elimination over levels of quality: one algorithm, two semirings.

In the inverse domain a module is the least time in which it turns input levels into an output
level; (min, +) elimination gives the least total time for every level of the program's result, all
budgets at once, for trees and for results used twice alike. With (+, ×) and the modules'
distributions for fixed times it gives the expected utility exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Factor:
    """A table over the levels of some calls: one axis for each name in `scope`."""

    scope: tuple[str, ...]
    table: Floats


@dataclass(frozen=True)
class Semiring:
    """How two factors are joined and how a variable is summed out."""

    join: Callable[[Floats, Floats], Floats]
    total: Callable[[Floats, int], Floats]


MIN_PLUS = Semiring(np.add, lambda table, axis: table.min(axis=axis))
SUM_PRODUCT = Semiring(np.multiply, lambda table, axis: table.sum(axis=axis))


@dataclass(frozen=True)
class Step:
    """One eliminated variable: the joined table it was taken from, for walking back down."""

    variable: str
    scope: tuple[str, ...]
    table: Floats


def eliminate(
    factors: Sequence[Factor], keep: Sequence[str], semiring: Semiring
) -> tuple[Factor, tuple[Step, ...]]:
    """Sum out every variable but `keep`, cheapest joined table first.

    Returns the factor over `keep`, in that order, and the steps in the order they were made.
    """
    pending = list(factors)
    sizes = {n: s for f in pending for n, s in zip(f.scope, f.table.shape, strict=True)}
    remaining = sorted({name for factor in pending for name in factor.scope} - set(keep))
    steps: list[Step] = []
    while remaining:
        variable = min(remaining, key=lambda name: (_width(pending, name, sizes), name))
        remaining.remove(variable)
        joined = _join([f for f in pending if variable in f.scope], semiring)
        pending = [f for f in pending if variable not in f.scope]
        steps.append(Step(variable, joined.scope, joined.table))
        axis = joined.scope.index(variable)
        left = joined.scope[:axis] + joined.scope[axis + 1 :]
        pending.append(Factor(left, np.asarray(semiring.total(joined.table, axis))))
    last = _join(pending, semiring)
    order = [last.scope.index(name) for name in keep]
    return Factor(tuple(keep), last.table.transpose(order)), tuple(steps)


def cheapest_levels(steps: Sequence[Step], chosen: dict[str, int]) -> dict[str, int]:
    """The levels of all eliminated variables that reach the minimum, given those of the kept."""
    levels = dict(chosen)
    for step in reversed(steps):
        index = tuple(slice(None) if name == step.variable else levels[name] for name in step.scope)
        levels[step.variable] = int(np.argmin(step.table[index]))
    return levels


def _width(factors: Sequence[Factor], variable: str, sizes: dict[str, int]) -> float:
    scope = {name for factor in factors if variable in factor.scope for name in factor.scope}
    return float(np.prod([float(sizes[name]) for name in scope]))


def _join(factors: Sequence[Factor], semiring: Semiring) -> Factor:
    scope = tuple(dict.fromkeys(name for factor in factors for name in factor.scope))
    joined: Floats | None = None
    for factor in factors:
        order = [factor.scope.index(name) for name in scope if name in factor.scope]
        view = factor.table.transpose(order)
        for place, name in enumerate(scope):
            if name not in factor.scope:
                view = np.expand_dims(view, place)
        joined = view if joined is None else semiring.join(joined, view)
    return Factor(scope, np.zeros(()) if joined is None else joined)


def times_to_levels(quality: NDArray[np.intp], times: Floats, levels: int) -> Floats:
    """Least time to deliver exactly each level: quality [..., times] of level indices to
    [..., levels] of seconds, inf where a level is never delivered.

    Exactly, not "at least": so a program whose modules do worse on better input is still
    compiled to its optimum.
    """
    table = np.full((*quality.shape[:-1], levels), np.inf)
    for moment in range(len(times) - 1, -1, -1):
        np.put_along_axis(table, quality[..., moment : moment + 1], times[moment], axis=-1)
    return table
