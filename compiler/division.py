"""Dividing time: the best static division among a program's calls, for every budget at once."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import DECIMALS, INSTANT
from anytime.errors import AnytimeError
from anytime.joins import Several
from compiler import costs, grouped
from compiler.elimination import (
    SUM_PRODUCT,
    Factor,
    all_cheapest_levels,
    eliminate,
    order_of,
    times_to_levels,
)
from compiler.objectives import EXPECTED, Objective
from compiler.settings import settings_of
from compiler.tables import Table

Floats = NDArray[np.float64]
Divisions = tuple[Floats, NDArray[np.intp], Floats]  # seconds [P], moments [P, n], value [P]
ALL = 1_000_000  # divisions that are weighed at once, at most
SWEEPS = 4  # of pairwise exchange at each budget, at most
BUDGETS = 24  # at which programs of more divisions are searched


@dataclass(frozen=True)
class Frontier:
    """The divisions that are worth having: none promises as much with less time.

    budgets: [F] seconds in all, increasing. shares: [F, n] seconds of each call.
    promised: [F] expected quality, increasing. exact: whether no division of the tables' moments
    promises more.
    """

    budgets: Floats
    shares: Floats
    promised: Floats
    exact: bool = True

    def __post_init__(self) -> None:
        # To the picosecond, as the moments of recordings are.
        object.__setattr__(self, "budgets", np.round(self.budgets, DECIMALS))

    def index(self, seconds: float) -> int:
        """The best division for this budget; -1 when it is below the least one."""
        return int(np.searchsorted(self.budgets, seconds + INSTANT, side="right")) - 1

    def promise(self, seconds: float) -> float:
        """Expected quality with this budget; 0 below the least one."""
        index = self.index(seconds)
        return float(self.promised[index]) if index >= 0 else 0.0


def divide(tables: Sequence[Table], objective: Objective = EXPECTED) -> Frontier:
    """The frontier of a program's divisions of time. [ZR93] §4, in the inverse domain.

    Over distributions and exact on the tables' moments where all divisions can be weighed at
    once (three calls always can), for independent results, and for any number of calls where
    nothing is left to chance. Beyond, pairs of calls exchange their time optimally while the
    others keep theirs, starting from the best of the (min, +) solution for mean qualities and
    the plain divisions (MIN, MAX, equal shares), which it so never falls below. Modules with knobs
    are set in one way each, the best for the budget.
    Raises AnytimeError for results with deadlines of their own and a value that is not a mean.
    """
    settings = settings_of(tables)
    if len(settings) > 1:
        return _best([divide(each, objective) for each in settings])
    parts = independent(tables)
    if parts is not None:
        return _merged(tables, parts, objective)
    calls = [place for place, table in enumerate(tables) if table.rule is None]
    cells = math.prod(len(tables[place].times) for place in calls)
    if cells <= ALL:
        fixed = [0] * len(tables)
        return _frontier(tables, *_weighed(tables, fixed, calls, objective), objective)
    (totals, moments, values), proven = _from_mean_levels(tables, objective)
    if all(_certain(table) for table in tables) and objective == EXPECTED:
        found = _frontier(tables, totals, moments, values, objective)
        return replace(found, exact=proven)
    plain = _plain(tables, objective)
    totals = np.concatenate([totals, plain[0]])
    moments = np.concatenate([moments, plain[1]])
    values = np.concatenate([values, plain[2]])
    worth = totals[(values > nothing(tables, objective)) & (totals > 0)]
    most = float(costs.total(tables, [np.asarray(table.times[-1]) for table in tables]))
    if len(worth):
        for budget in np.geomspace(float(worth.min()), most, BUDGETS):
            inside = np.flatnonzero(totals <= budget)
            start = moments[inside[np.argmax(values[inside])]]
            found = _exchanged(tables, tuple(int(m) for m in start), float(budget), objective)
            totals = np.concatenate([totals, found[0]])
            moments = np.concatenate([moments, found[1]])
            values = np.concatenate([values, found[2]])
    return replace(_frontier(tables, totals, moments, values, objective), exact=False)


def _best(frontiers: Sequence[Frontier]) -> Frontier:
    """The divisions of several frontiers that none with as little time is better than."""
    budgets = np.concatenate([each.budgets for each in frontiers])
    shares = np.concatenate([each.shares for each in frontiers])
    promised = np.concatenate([each.promised for each in frontiers])
    order = np.lexsort((-promised, budgets))
    before = np.maximum.accumulate(np.concatenate([[-np.inf], promised[order][:-1]]))
    kept = order[promised[order] > before]
    exact = all(each.exact for each in frontiers)
    return Frontier(budgets[kept], shares[kept], promised[kept], exact)


def independent(tables: Sequence[Table]) -> tuple[tuple[int, ...], ...] | None:
    """Of a program with several results that share nothing, the places of the tables of each."""
    output = tables[-1]
    if not isinstance(output.rule, Several) or len(output.feeds) != len(output.rule.weights):
        return None
    place = {table.label: index for index, table in enumerate(tables)}
    parts: list[set[int]] = []
    for label in output.feeds:
        part, pending = set[int](), [label]
        while pending:
            one = place[pending.pop()]
            part.add(one)
            pending += tables[one].feeds
        parts.append(part)
    arms = [{arm.group for one in part for arm in tables[one].path} for part in parts]
    shared = any(
        a & b or g & h
        for (a, g), (b, h) in itertools.combinations(zip(parts, arms, strict=True), 2)
    )
    return None if shared else tuple(tuple(sorted(part)) for part in parts)


def value_of(tables: Sequence[Table], moments: Sequence[int], objective: Objective) -> float:
    """What a division is worth, in which each call ends at its moment."""
    seconds = costs.total(
        tables, [np.asarray(t.times[m]) for t, m in zip(tables, moments, strict=True)]
    )
    chances = output_chances(tables, moments)
    return float(objective.value(chances, tables[-1].levels, seconds))


def nothing(tables: Sequence[Table], objective: Objective) -> float:
    """What it is worth to have no result at once."""
    none = np.eye(len(tables[-1].levels))[0]
    return float(objective.value(none, tables[-1].levels, np.zeros(())))


def output_chances(tables: Sequence[Table], moments: Sequence[int]) -> Floats:
    """Probability of each level of the result when each call ends at its moment, [L], exactly."""
    factors = [
        Factor((*table.feeds, table.label), table.chances[..., moment, :])
        for table, moment in zip(tables, moments, strict=True)
    ]
    order = order_of(factors, (tables[-1].label,))
    return eliminate(factors, order, SUM_PRODUCT)[0].table


def expected_quality(tables: Sequence[Table], moments: Sequence[int]) -> float:
    """Expected quality of the result when each call ends at its moment."""
    return float(output_chances(tables, moments) @ tables[-1].levels)


def moments_within(tables: Sequence[Table], shares: Sequence[float]) -> tuple[int, ...]:
    """The last moment of each call that its share of time reaches."""
    return tuple(
        max(0, int(np.searchsorted(table.times, share + 1e-12, side="right")) - 1)
        for table, share in zip(tables, shares, strict=True)
    )


def _weighed(
    tables: Sequence[Table], fixed: Sequence[int], free: Sequence[int], objective: Objective
) -> Divisions:
    """Every division of some calls' moments while the others keep theirs."""
    mean = objective.additive and objective.timeless
    factors: list[Factor] = []
    for place, (table, moment) in enumerate(zip(tables, fixed, strict=True)):
        chances, scope = table.chances, (*table.feeds, f"time {place}", table.label)
        if mean and place == len(tables) - 1:
            chances = chances @ objective.worth(table.levels, np.zeros(()))
            scope = scope[:-1]
        if place not in free:
            axis = len(table.feeds)
            chances, scope = np.take(chances, moment, axis), scope[:axis] + scope[axis + 1 :]
        factors.append(Factor(scope, chances))
    kept = tuple(f"time {place}" for place in free)
    result = kept if mean else (*kept, tables[-1].label)
    values = eliminate(factors, order_of(factors, result), SUM_PRODUCT)[0].table
    rows = np.indices(tuple(len(tables[place].times) for place in free)).reshape(len(free), -1)
    moments = np.tile(np.asarray(fixed, dtype=np.intp), (rows.shape[1], 1))
    moments[:, list(free)] = rows.T
    totals = _totals(tables, moments)
    if mean:
        return totals, moments, values.reshape(-1)
    chances = values.reshape(len(totals), -1)
    return totals, moments, objective.value(chances, tables[-1].levels, totals)


def _totals(tables: Sequence[Table], moments: NDArray[np.intp]) -> Floats:
    times = [table.times[moments[:, place]] for place, table in enumerate(tables)]
    return np.broadcast_to(costs.total(tables, times), (len(moments),))


def _merged(
    tables: Sequence[Table], parts: Sequence[Sequence[int]], objective: Objective
) -> Frontier:
    """The frontier of several independent results on one processor, from those of each.

    In the order of their deadlines [Boddy & Dean 1994], each ends before its own.
    """
    rule = tables[-1].rule
    assert isinstance(rule, Several)
    if not (objective.additive and objective.timeless):
        raise AnytimeError(
            f"{objective!r} of several independent results is not the sum of theirs; compile them "
            "for their expected quality"
        )
    scale = sum(rule.weights)
    totals, values = np.zeros(1), np.zeros(1)
    shares, exact = np.zeros((1, len(tables))), True
    for place in sorted(range(len(parts)), key=lambda place: rule.deadlines[place]):
        own = divide([tables[index] for index in parts[place]], objective)
        exact = exact and own.exact
        budgets = np.concatenate([[0.0], own.budgets])
        gains = np.concatenate([[0.0], own.promised]) * rule.weights[place] / scale
        rows = np.zeros((len(budgets), len(tables)))
        rows[1:, list(parts[place])] = own.shares
        ends = (totals[:, None] + budgets).ravel()
        worth = (values[:, None] + gains).ravel()
        # Who gets no time is never late: what came before ended by an earlier deadline.
        late = ends > rule.deadlines[place] + INSTANT
        kept = _best_first(ends, np.where(late, -np.inf, worth), -np.inf)
        before, added = np.divmod(kept, len(budgets))
        totals, values, shares = ends[kept], worth[kept], shares[before] + rows[added]
    kept = values > 1e-9
    return Frontier(totals[kept], shares[kept], values[kept], exact)


def _exchanged(
    tables: Sequence[Table], start: tuple[int, ...], budget: float, objective: Objective
) -> Divisions:
    """Divisions met while pairs of calls exchange time within the budget until none gains."""
    best, value = start, value_of(tables, start, objective)
    calls = [place for place, table in enumerate(tables) if table.rule is None]
    met: list[Divisions] = []
    for _ in range(SWEEPS):
        before = best
        for pair in itertools.combinations(calls, 2):
            totals, moments, values = _weighed(tables, best, pair, objective)
            inside = np.flatnonzero(totals <= budget)
            top = inside[np.argmax(values[inside])]
            if values[top] > value:
                best, value = tuple(int(m) for m in moments[top]), float(values[top])
            met.append(_undominated(totals, moments, values, -np.inf))
        if best == before:
            break
    return (
        np.concatenate([totals for totals, _, _ in met]),
        np.concatenate([moments for _, moments, _ in met]),
        np.concatenate([values for _, _, values in met]),
    )


def _plain(tables: Sequence[Table], objective: Objective) -> Divisions:
    """MIN, MAX, and each call until it first may have a result, with every moment of the last;
    and equal shares."""
    may = [(t.chances[..., 0] < 1).reshape(-1, len(t.times)).any(axis=0) for t in tables]
    bases = [
        moments_within(tables, [table.first for table in tables]),
        moments_within(tables, [table.saturation for table in tables]),
        tuple(int(there.argmax()) for there in may),
    ]
    last = max(place for place, table in enumerate(tables) if table.rule is None)
    found: set[tuple[int, ...]]
    found = {
        (*base[:last], moment, *base[last + 1 :])
        for base in bases
        for moment in range(len(tables[last].times))
    }
    for share in np.unique(np.concatenate([table.times for table in tables])):
        found.add(moments_within(tables, [float(share)] * len(tables)))
    moments = np.array(sorted(found), dtype=np.intp)
    values = np.array([value_of(tables, row, objective) for row in moments])
    return _totals(tables, moments), moments, values


def _from_mean_levels(tables: Sequence[Table], objective: Objective) -> tuple[Divisions, bool]:
    """Divisions that are optimal if every quality came out at its mean, by (min, +) elimination,
    and whether that is proven."""
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
    solution, steps = grouped.cheapest_in_groups(tables, factors, output)
    levels = solution.levels(np.flatnonzero(np.isfinite(solution.seconds)))
    levels = all_cheapest_levels(steps, levels)
    rows = [
        (
            reached[tuple(levels[name] for name in table.feeds)] == levels[table.label][:, None]
        ).argmax(axis=-1)
        for table, reached in zip(tables, nearest, strict=True)
    ]
    moments = np.vstack([np.zeros(len(tables), dtype=np.intp), np.transpose(rows)])
    values = np.array([value_of(tables, row.tolist(), objective) for row in moments])
    return (_totals(tables, moments), moments, values), solution.exact


def _certain(table: Table) -> bool:
    """Whether each input and time leads to one level for sure."""
    return bool(((table.chances == 0) | (table.chances == 1)).all())


def _best_first(totals: Floats, values: Floats, floor: float) -> NDArray[np.intp]:
    """Places of the divisions worth more than `floor` and than any as fast, in order of time."""
    order = np.lexsort((-values, totals.round(12)))  # sums of the same times may differ by a bit
    ordered = values[order]
    before = np.maximum.accumulate(np.concatenate([[floor], ordered[:-1]]))
    return order[ordered > before + 1e-9]


def _undominated(
    totals: Floats, moments: NDArray[np.intp], values: Floats, floor: float
) -> Divisions:
    kept = _best_first(totals, values, floor)
    return totals[kept], moments[kept], values[kept]


def _frontier(
    tables: Sequence[Table],
    totals: Floats,
    moments: NDArray[np.intp],
    values: Floats,
    objective: Objective,
) -> Frontier:
    kept = _undominated(totals, moments, values, nothing(tables, objective))
    totals, moments, values = kept
    shares = np.array([table.times[moments[:, i]] for i, table in enumerate(tables)]).T
    return Frontier(totals, shares.reshape(len(totals), len(tables)), values)
