"""Dividing time: the best static division among a program's calls, for every budget at once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compiler.elimination import (
    MIN_PLUS,
    SUM_PRODUCT,
    Factor,
    cheapest_levels,
    eliminate,
    times_to_levels,
)
from compiler.tables import Table

Floats = NDArray[np.float64]
SWEEPS = 4  # of pairwise exchange at each budget, at most
BUDGETS = 24  # at which programs of more than two calls are searched


@dataclass(frozen=True)
class Frontier:
    """The divisions that are worth having: none promises as much with less time.

    budgets: [F] seconds in all, increasing. shares: [F, n] seconds of each call.
    promised: [F] expected quality, increasing.
    """

    budgets: Floats
    shares: Floats
    promised: Floats

    def index(self, seconds: float) -> int:
        """The best division for this budget; -1 when it is below the least one."""
        return int(np.searchsorted(self.budgets, seconds + 1e-12, side="right")) - 1

    def promise(self, seconds: float) -> float:
        """Expected quality with this budget; 0 below the least one."""
        index = self.index(seconds)
        return float(self.promised[index]) if index >= 0 else 0.0


def divide(tables: Sequence[Table]) -> Frontier:
    """The frontier of a program's divisions of time. [ZR93] §4, in the inverse domain.

    Over distributions and exact on the tables' moments for one and two calls, and for any number
    where nothing is left to chance. Beyond, pairs of calls exchange their time optimally while
    the others keep theirs, starting from the best of the (min, +) solution for mean qualities
    and the plain divisions (MIN, MAX, equal shares), which it so never falls below.
    """
    if len(tables) == 1:
        values = tables[0].expected
        return _frontier(
            tables, tables[0].times, np.arange(len(values))[:, None], np.asarray(values)
        )
    if len(tables) == 2:
        return _frontier(tables, *_pair(tables, (0, 0), 0, 1))
    totals, moments, values = _from_mean_levels(tables)
    if all(_certain(table) for table in tables):
        return _frontier(tables, totals, moments, values)
    plain = _plain(tables)
    totals = np.concatenate([totals, plain[0]])
    moments = np.concatenate([moments, plain[1]])
    values = np.concatenate([values, plain[2]])
    least = float(totals[values > 0].min(initial=np.inf))
    most = float(sum(table.times[-1] for table in tables))
    if np.isfinite(least):
        for budget in np.geomspace(max(least, 1e-6 * most, 1e-12), max(most, 1e-12), BUDGETS):
            inside = np.flatnonzero(totals <= budget + 1e-12)
            start = moments[inside[np.argmax(values[inside])]]
            found = _exchanged(tables, tuple(int(m) for m in start), float(budget))
            totals = np.concatenate([totals, found[0]])
            moments = np.concatenate([moments, found[1]])
            values = np.concatenate([values, found[2]])
    return _frontier(tables, totals, moments, values)


def output_chances(tables: Sequence[Table], moments: Sequence[int]) -> Floats:
    """Probability of each level of the result when each call ends at its moment, [L], exactly."""
    factors = [
        Factor((*table.feeds, table.label), table.chances[..., moment, :])
        for table, moment in zip(tables, moments, strict=True)
    ]
    return eliminate(factors, (tables[-1].label,), SUM_PRODUCT)[0].table


def expected_quality(tables: Sequence[Table], moments: Sequence[int]) -> float:
    """Expected quality of the result when each call ends at its moment."""
    return float(output_chances(tables, moments) @ tables[-1].levels)


def moments_within(tables: Sequence[Table], shares: Sequence[float]) -> tuple[int, ...]:
    """The last moment of each call that its share of time reaches."""
    return tuple(
        max(0, int(np.searchsorted(table.times, share + 1e-12, side="right")) - 1)
        for table, share in zip(tables, shares, strict=True)
    )


def _pair(
    tables: Sequence[Table], fixed: Sequence[int], one: int, other: int
) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Every pair of moments of two calls while the others keep theirs.

    Returns seconds in all [P], moments [P, n], expected quality [P].
    """
    factors: list[Factor] = []
    for place, (table, moment) in enumerate(zip(tables, fixed, strict=True)):
        free = place in (one, other)
        output = place == len(tables) - 1
        chances = table.expected if output else table.chances
        if output:
            scope = (*table.feeds, f"time {place}") if free else table.feeds
            factors.append(Factor(scope, chances if free else chances[..., moment]))
        else:
            scope = (*table.feeds, *((f"time {place}",) if free else ()), table.label)
            factors.append(Factor(scope, chances if free else chances[..., moment, :]))
    kept = (f"time {one}", f"time {other}")
    values = eliminate(factors, kept, SUM_PRODUCT)[0].table
    rows, columns = np.indices(values.shape).reshape(2, -1)
    moments = np.tile(np.asarray(fixed, dtype=np.intp), (rows.size, 1))
    moments[:, one], moments[:, other] = rows, columns
    totals = sum(
        (table.times[moments[:, place]] for place, table in enumerate(tables)),
        start=np.zeros(rows.size),
    )
    return totals, moments, values.reshape(-1)


def _exchanged(
    tables: Sequence[Table], start: tuple[int, ...], budget: float
) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Divisions met while pairs of calls exchange time within the budget until none gains."""
    best, value = start, expected_quality(tables, start)
    met: list[tuple[Floats, NDArray[np.intp], Floats]] = []
    for _ in range(SWEEPS):
        before = value
        for one, other in itertools.combinations(range(len(tables)), 2):
            totals, moments, values = _pair(tables, best, one, other)
            inside = np.flatnonzero(totals <= budget + 1e-12)
            top = inside[np.argmax(values[inside])]
            if values[top] > value + 1e-12:
                best, value = tuple(int(m) for m in moments[top]), float(values[top])
            met.append(_undominated(totals, moments, values))
        if value <= before + 1e-12:
            break
    return (
        np.concatenate([totals for totals, _, _ in met]),
        np.concatenate([moments for _, moments, _ in met]),
        np.concatenate([values for _, _, values in met]),
    )


def _plain(tables: Sequence[Table]) -> tuple[Floats, NDArray[np.intp], Floats]:
    """MIN, MAX, and each call until it first may have a result, with every moment of the last;
    and equal shares."""
    may = [(t.chances[..., 0] < 1).reshape(-1, len(t.times)).any(axis=0) for t in tables]
    bases = [
        moments_within(tables, [table.first for table in tables]),
        moments_within(tables, [table.saturation for table in tables]),
        tuple(int(there.argmax()) for there in may),
    ]
    found: set[tuple[int, ...]]
    found = {(*base[:-1], last) for base in bases for last in range(len(tables[-1].times))}
    for share in np.unique(np.concatenate([table.times for table in tables])):
        found.add(moments_within(tables, [float(share)] * len(tables)))
    moments = np.array(sorted(found), dtype=np.intp)
    totals = np.sum([t.times[moments[:, i]] for i, t in enumerate(tables)], axis=0)
    return totals, moments, np.array([expected_quality(tables, row) for row in moments])


def _from_mean_levels(tables: Sequence[Table]) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Divisions that are optimal if every quality came out at its mean: (min, +) elimination."""
    factors: list[Factor] = []
    nearest: list[NDArray[np.intp]] = []
    for table in tables:
        distance = np.abs(table.expected[..., None] - table.levels)
        level = np.asarray(distance.argmin(axis=-1), dtype=np.intp)
        # Where it is certain: a result of quality 0 is as far from the mean as no result is.
        level = np.where(table.chances.max(axis=-1) == 1, table.chances.argmax(axis=-1), level)
        nearest.append(level)
        least = times_to_levels(level, table.times, len(table.levels))
        factors.append(Factor((*table.feeds, table.label), least))
    output = tables[-1].label
    costs, steps = eliminate(factors, (output,), MIN_PLUS)
    found: list[tuple[int, ...]] = [tuple(0 for _ in tables)]
    for level in np.flatnonzero(np.isfinite(costs.table)):
        levels = cheapest_levels(steps, {output: int(level)})
        row: list[int] = []
        for table, reached in zip(tables, nearest, strict=True):
            fed = tuple(levels[name] for name in table.feeds)
            row.append(int(np.flatnonzero(reached[fed] == levels[table.label])[0]))
        found.append(tuple(row))
    moments = np.array(found, dtype=np.intp)
    totals = np.array([sum(t.times[m] for t, m in zip(tables, row, strict=True)) for row in found])
    values = np.array([expected_quality(tables, row) for row in found])
    return totals, moments, values


def _certain(table: Table) -> bool:
    """Whether each input and time leads to one level for sure."""
    return bool(((table.chances == 0) | (table.chances == 1)).all())


def _undominated(
    totals: Floats, moments: NDArray[np.intp], values: Floats
) -> tuple[Floats, NDArray[np.intp], Floats]:
    order = np.lexsort((-values, totals))
    sorted_values = values[order]
    best_before = np.concatenate([[0.0], np.maximum.accumulate(sorted_values)[:-1]])
    kept = order[sorted_values > best_before + 1e-9]
    return totals[kept], moments[kept], values[kept]


def _frontier(
    tables: Sequence[Table], totals: Floats, moments: NDArray[np.intp], values: Floats
) -> Frontier:
    totals, moments, values = _undominated(totals, moments, values)
    shares = np.array([table.times[moments[:, i]] for i, table in enumerate(tables)]).T
    return Frontier(totals, shares.reshape(len(totals), len(tables)), values)
