"""Variable elimination over levels of quality: one algorithm, two semirings.

In the inverse domain a module is the least time in which it turns input levels into an output
level; (min, +) elimination gives the least total time for every level of the program's result, all
budgets at once, for trees and for results used twice alike. With (+, ×) and the modules'
distributions for fixed times it gives the expected utility exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from compiler.ordering import Order, elimination_order

Floats = NDArray[np.float64]
Levels = NDArray[np.intp]
WHOLE = 1 << 16  # cells up to which a bucket is joined in one piece, which then stays in the cache


@dataclass(frozen=True, slots=True)
class Factor:
    """A table over the levels of some calls: one axis for each name in `scope`."""

    scope: tuple[str, ...]
    table: Floats


@dataclass(frozen=True)
class Semiring:
    """How two factors are joined and how a variable is summed out; the total of nothing."""

    join: np.ufunc
    total: np.ufunc
    nothing: float


MIN_PLUS = Semiring(np.add, np.minimum, np.inf)
SUM_PRODUCT = Semiring(np.multiply, np.add, 0.0)


@dataclass(frozen=True, slots=True)
class Steps:
    """What was eliminated, in which order and from which factors, for walking back down.

    factors: those given, then the one that each bucket of the order left behind. Joined tables
    are not kept: a walk looks at one cell of each factor for every level of one variable.
    """

    order: Order
    factors: tuple[Factor, ...]


def eliminate(
    factors: Sequence[Factor], keep: Sequence[str], semiring: Semiring
) -> tuple[Factor, Steps]:
    """Sum out every variable but `keep`, in a cheap order. [Dec99]

    Returns the factor over `keep`, in that order, and the steps for `cheapest_levels`.
    """
    order = order_of(factors, keep)
    every = list(factors)
    least_sums = _least_sums if semiring is MIN_PLUS else None
    for bucket in order.buckets:
        if least_sums is not None and bucket.axis >= 0:
            costs, table = every[bucket.members[0]].table, every[bucket.members[1]].table
            cut, axis = table.shape, bucket.axis
            blocks = table.reshape(prod(cut[:axis]), cut[axis], -1)
            left = least_sums(costs, blocks).reshape(bucket.shape[1:])
        else:
            names = (bucket.variable, *bucket.scope)
            aligned = [_aligned(every[number], names) for number in bucket.members]
            left = _summed_out(aligned, bucket.shape, semiring)
        every.append(Factor(bucket.scope, left))
    kept = tuple(keep)
    rest = [_aligned(every[number], kept) for number in order.left]
    return Factor(kept, _joined(rest, semiring)), Steps(order, tuple(every))


def order_of(factors: Sequence[Factor], keep: Sequence[str]) -> Order:
    """The order in which `eliminate` sums out, and what that costs."""
    sizes: dict[str, int] = {}
    for factor in factors:
        sizes.update(zip(factor.scope, factor.table.shape, strict=True))
    scopes = tuple([factor.scope for factor in factors])
    return elimination_order(scopes, tuple(sizes.values()), tuple(keep))


def cheapest_levels(steps: Steps, chosen: Mapping[str, int]) -> dict[str, int]:
    """The levels of all eliminated variables that reach the minimum, given those of the kept."""
    every = {name: np.array([level]) for name, level in chosen.items()}
    return {name: int(levels[0]) for name, levels in all_cheapest_levels(steps, every).items()}


def all_cheapest_levels(steps: Steps, chosen: Mapping[str, Levels]) -> dict[str, Levels]:
    """`cheapest_levels` for many choices at once: every value is [K] levels."""
    levels = dict(chosen)
    count = max((len(each) for each in levels.values()), default=1)
    for bucket in reversed(steps.order.buckets):
        costs: Floats = np.zeros((bucket.shape[0], count))
        for number in bucket.members:
            factor = steps.factors[number]
            axis = factor.scope.index(bucket.variable)
            index = [levels[name] for name in factor.scope if name != bucket.variable]
            table = np.moveaxis(factor.table, axis, 0)
            costs = costs + (table[(slice(None), *index)] if index else table[:, None])
        levels[bucket.variable] = costs.argmin(axis=0)
    return levels


def warm_up() -> None:
    """Eliminate in machine code from now on, with the same results.

    It pays for who compiles often, not for one compilation: numba takes longer to load than a
    program to be compiled.
    """
    global _least_sums
    from compiler import kernels

    _least_sums = kernels.least_sums


_least_sums: Callable[[Floats, Floats], Floats] | None = None


def _aligned(factor: Factor, names: tuple[str, ...]) -> Floats:
    """The table with an axis for each of the names, of length 1 where it is not in its scope."""
    scope = factor.scope
    if scope == names:
        return factor.table
    order = [scope.index(name) for name in names if name in scope]
    index = tuple([slice(None) if name in scope else None for name in names])
    return factor.table.transpose(order)[index]


def _summed_out(tables: Sequence[Floats], shape: tuple[int, ...], semiring: Semiring) -> Floats:
    """The first axis summed out of the join of aligned tables, which has that shape."""
    if prod(shape) <= WHOLE:
        return semiring.total.reduce(_joined(tables, semiring), axis=0)
    rows = [np.broadcast_to(table, (shape[0], *table.shape[1:])) for table in tables]
    result = np.full(shape[1:], semiring.nothing)
    # A new array of this size for each level would cost more than its sum: its pages are cleared.
    part = np.empty(shape[1:])
    for level in range(shape[0]):
        *small, last = [row[level] for row in rows]
        semiring.join(_joined(small, semiring), last, out=part)
        semiring.total(result, part, out=result)
    return result


def _joined(tables: Sequence[Floats], semiring: Semiring) -> Floats:
    """The join of aligned tables, small ones first, so that few cells are touched twice."""
    if not tables:
        return np.asarray(semiring.join.identity, dtype=float)
    joined = tables[0]
    for table in tables[1:]:
        joined = semiring.join(joined, table)
    return joined


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
