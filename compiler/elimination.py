"""Variable elimination over levels of quality: one algorithm, two semirings.

In the inverse domain a module is the least time in which it turns input levels into an output
level; (min, +) elimination gives the least total time for every level of the program's result, all
budgets at once, for trees and for results used twice alike. With (+, ×) and the modules'
distributions for fixed times it gives the expected utility exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from compiler.ordering import Bucket, Order, Scope, elimination_order

Floats = NDArray[np.float64]
Levels = NDArray[np.intp]
PIECE = 1 << 15  # cells of a bucket that are joined at once, so that they stay in the cache


@dataclass(frozen=True, slots=True)
class Factor:
    """A table over the levels of some calls: one axis for each name in `scope`."""

    scope: tuple[str, ...]
    table: Floats


@dataclass(frozen=True)
class Semiring:
    """How two factors are joined and how a variable is summed out."""

    join: np.ufunc
    total: np.ufunc


MIN_PLUS = Semiring(np.add, np.minimum)
SUM_PRODUCT = Semiring(np.multiply, np.add)


@dataclass(frozen=True, slots=True)
class Step:
    """One elimination: in which order and from which tables, for walking back down.

    tables: of the factors given, then the one that each bucket of the order left behind, or a row
    of several; parts: which part of it, by number. Joined tables are not kept: a walk looks at one
    row of each table for every variable.
    """

    order: Order
    tables: tuple[Floats, ...]
    parts: Mapping[int, slice]

    def table(self, number: int) -> Floats:
        """That of the factor of this number."""
        part = self.parts.get(number)
        return self.tables[number] if part is None else self.tables[number][part]


def eliminate(
    factors: Sequence[Factor], order: Order, semiring: Semiring
) -> tuple[Factor, tuple[Step, ...]]:
    """Sum out every variable that the order does not keep. [Dec99]

    order: of these factors or of others with the same scopes and levels, by `order_of`.
    Returns the factor over what is kept, in that order, and a step for `cheapest_levels`; steps of
    eliminations that follow each other are put together in that order.
    """
    tables = [factor.table for factor in factors]
    machine_code = _machine_code if semiring is MIN_PLUS else None
    for buckets, start, numbers, parts in order.stages:
        if machine_code is not None and parts:
            along = tuple([tables[number] for number in numbers])
            left = machine_code.least_sums_along(tables[start], along, len(parts))
            tables += [left] * (len(parts) - 1)
            tables.append(left[parts[-1]])
            continue
        for bucket in buckets:
            tables.append(_left_behind(bucket, tables, order.scopes, semiring, machine_code))
    rest = [_aligned(tables[number], order.scopes[number], order.keep) for number in order.left]
    step = Step(order, tuple(tables), order.parts if machine_code is not None else {})
    return Factor(order.keep, _joined(rest, semiring)), (step,)


def _left_behind(
    bucket: Bucket,
    tables: Sequence[Floats],
    scopes: Sequence[Scope],
    semiring: Semiring,
    machine_code: MachineCode | None,
) -> Floats:
    """The table that a bucket leaves behind."""
    variable, members, scope, shape, blocks = bucket
    if machine_code is not None and blocks is not None:
        one, other = members
        left = machine_code.least_sums(tables[one], tables[other].reshape(blocks))
        return left if len(scope) == 1 else left.reshape(shape[1:])
    names = (variable, *scope)
    aligned = [_aligned(tables[number], scopes[number], names) for number in members]
    return _summed_out(aligned, shape, semiring)


def order_of(factors: Sequence[Factor], keep: Sequence[str]) -> Order:
    """A cheap order in which `eliminate` sums out every variable but `keep`, and its costs."""
    scopes = tuple([factor.scope for factor in factors])
    return elimination_order(scopes, tuple([f.table.shape for f in factors]), tuple(keep))


def cheapest_levels(steps: Sequence[Step], chosen: Mapping[str, int]) -> dict[str, int]:
    """The levels of all eliminated variables that reach the minimum, given those of the kept."""
    every = {name: np.array([level]) for name, level in chosen.items()}
    return {name: int(levels[0]) for name, levels in all_cheapest_levels(steps, every).items()}


def all_cheapest_levels(steps: Sequence[Step], chosen: Mapping[str, Levels]) -> dict[str, Levels]:
    """`cheapest_levels` for many choices at once: every value is [K] levels."""
    levels = dict(chosen)
    count = max((len(each) for each in levels.values()), default=1)
    for step, bucket in [(s, b) for s in reversed(steps) for b in reversed(s.order.buckets)]:
        if _machine_code is not None and bucket.blocks is not None:
            one, other = (step.table(number) for number in bucket.members)
            places = np.zeros(count, np.intp)
            for name, size in zip(bucket.scope, bucket.shape[1:], strict=True):
                places = places * size + levels[name]
            blocks = other.reshape(bucket.blocks)
            levels[bucket.variable] = _machine_code.least_places(one, blocks, places)
            continue
        costs: Floats | None = None
        for number in bucket.members:
            scope = step.order.scopes[number]
            index = tuple([levels[name] for name in scope if name != bucket.variable])
            table = np.moveaxis(step.table(number), scope.index(bucket.variable), -1)[index]
            costs = table if costs is None else costs + table
        assert costs is not None  # a bucket has members
        levels[bucket.variable] = np.broadcast_to(costs.argmin(axis=-1), (count,))
    return levels


def warm_up() -> None:
    """Eliminate in machine code from now on, with the same results.

    It pays for who compiles often, not for one compilation: numba takes longer to load than a
    program to be compiled.
    """
    global _machine_code
    from compiler import kernels

    _machine_code = cast(MachineCode, kernels)


class MachineCode(Protocol):
    """What `compiler.kernels` has."""

    def least_sums(self, costs: Floats, table: Floats) -> Floats: ...

    def least_sums_along(self, costs: Floats, tables: Sequence[Floats], count: int) -> Floats: ...

    def least_places(self, costs: Floats, table: Floats, places: Levels) -> Levels: ...


_machine_code: MachineCode | None = None


def _aligned(table: Floats, scope: tuple[str, ...], names: tuple[str, ...]) -> Floats:
    """The table with an axis for each of the names, of length 1 where it is not in its scope."""
    if scope == names:
        return table
    order = [scope.index(name) for name in names if name in scope]
    index = tuple([slice(None) if name in scope else None for name in names])
    return table.transpose(order)[index]


def _summed_out(tables: Sequence[Floats], shape: tuple[int, ...], semiring: Semiring) -> Floats:
    """The first axis summed out of the join of aligned tables, which has that shape."""
    cells = prod(shape)
    if cells <= 2 * PIECE or len(shape) == 1:
        return semiring.total.reduce(_joined(tables, semiring), axis=0)
    first, second, *rest = shape
    tables = [np.broadcast_to(t, (t.shape[0], second, *t.shape[2:])) for t in tables]
    result = np.empty(shape[1:])
    if cells > PIECE * second:
        for level in range(second):
            each = [table[:, level] for table in tables]
            result[level] = _summed_out(each, (first, *rest), semiring)
        return result
    width = PIECE * second // cells
    for start in range(0, second, width):
        joined = _joined([table[:, start : start + width] for table in tables], semiring)
        semiring.total.reduce(joined, axis=0, out=result[start : start + width])
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
    for moment in reversed(range(len(times))):
        np.put_along_axis(table, quality[..., moment : moment + 1], times[moment], axis=-1)
    return table
