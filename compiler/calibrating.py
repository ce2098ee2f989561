"""What a promise is worth: calibrated on problems that the division was not chosen on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.profiles import Profile
from anytime.programs import Program
from compiler.certificates import best_so_far
from compiler.costs import stretched
from compiler.division import Frontier, divide, expected_quality, moments_within, value_of
from compiler.intervals import mean_interval
from compiler.objectives import EXPECTED, Objective
from compiler.replaying import Replay
from compiler.tables import Table, tables

Floats = NDArray[np.float64]
RUN = 40  # divisions that are really run to calibrate a program
RESAMPLED = 8  # budgets at which intervals are found from the tables of some of the problems
RESAMPLES = 60  # of those tables, at most
FOLDS = 5  # problems are dealt into; each is promised by divisions chosen on the others
DIVIDED = 3  # calls and joins at most of programs that are divided anew for each fold
KNOTS = 96  # budgets at which promises are calibrated; fewer for many calls


@dataclass(frozen=True)
class Calibration:
    """From what the tables say of a division to what may be promised, and how surely.

    levels: [K] expected quality by the tables, increasing from 0 to 1. promised, low, high: [K]
    the promise and the ends of its 95 % interval, none of which falls as the level rises. So more
    time or a faster module, which never lower the level, never lower the promise.
    """

    levels: Floats
    promised: Floats
    low: Floats
    high: Floats

    def promise(self, level: float) -> float:
        """What may be promised of a division that the tables give this level."""
        return float(self._corrected(np.asarray(level)))

    def interval(self, promised: float) -> tuple[float, float]:
        """The 95 % interval of a promise; levels of one promise have one interval."""
        low = float(np.interp(promised, self.promised, self.low))
        high = float(np.interp(promised, self.promised, self.high))
        return min(low, promised), max(high, promised)

    def _corrected(self, levels: Floats) -> Floats:
        # Beyond the knots the correction stays what it is at the last.
        corrected = levels + np.interp(levels, self.levels, self.promised - self.levels)
        return np.clip(corrected, 0.0, 1.0)

    def rows(self) -> list[tuple[float, float, float, float]]:
        """Level, promise, low and high end of each knot."""
        return list(zip(*(c.tolist() for c in astuple(self)), strict=True))

    def applied(self, frontier: Frontier) -> Frontier:
        """The frontier with what may be promised in place of what the tables say."""
        promised = self._corrected(frontier.promised)
        return replace(frontier, promised=np.maximum.accumulate(promised))  # but for rounding


AS_IT_IS = Calibration(*(np.array([0.0, 1.0]) for _ in range(4)))
"""Promises what the tables say, and is sure of it."""


def calibrate(
    program: Program,
    profiles: Mapping[str, Profile],
    frontier: Frontier,
    replay: Replay,
    seed: int = 0,
) -> tuple[Frontier, Calibration]:
    """The divisions of a frontier that stand when they are lived again, and what may be promised
    for what the tables say of them (`Calibration.applied`).

    Cross-fitting: each fold of the problems lives (`compiler.replaying`) the divisions that were
    chosen without it. One that is worse there than another with less time gives way to that other
    with more of it, for tables, which are averages over problems, can be mistaken. Isotonic
    regression of the means over the tables' levels gives the promises.
    """
    knots = _knots(frontier, KNOTS * DIVIDED // max(DIVIDED, len(program.calls)))
    values = _unseen(program, profiles, frontier, replay, frontier.budgets[knots], seed)
    standing = _standing(values)
    frontier, knots, values = _stretched(frontier, knots, values, standing, replay)
    return frontier, _isotonic(frontier.promised[knots], values)


def calibrate_by_running(
    tables: Sequence[Table], frontier: Frontier, run: Callable[[Sequence[float]], Floats]
) -> tuple[Frontier, Calibration]:
    """The divisions that stand when a program is really run, with their promises, and the
    calibration: run(budgets) gives qualities [P, budgets] on problems that the divisions were not
    chosen on.

    In a long program neighbouring divisions may be worth very different qualities, for tables do
    not tell all that goes on between modules. So only divisions that were run are kept, each that
    is the best of those with no more time. To be the best of many flatters: what is promised is
    what problems achieve with the divisions that are the best on the others.
    """
    knots = _knots(frontier, RUN)
    values = run(frontier.budgets[knots].tolist())
    kept = np.unique(best_so_far(values.mean(axis=0)))
    lived = np.zeros(values.shape)
    fold_of = np.arange(len(values)) % min(FOLDS, len(values))
    for fold in range(FOLDS):
        held = fold_of == fold
        lived[held] = values[held][:, best_so_far(values[~held].mean(axis=0))]
    rows = knots[kept]
    worth = [
        expected_quality(tables, moments_within(tables, frontier.shares[row].tolist()))
        for row in rows
    ]
    calibration = _isotonic(np.array(worth), lived[:, kept])
    found = replace(
        frontier,
        budgets=frontier.budgets[rows],
        shares=frontier.shares[rows],
        promised=np.array(worth),
    )
    return calibration.applied(found), calibration


def _stretched(
    frontier: Frontier,
    knots: NDArray[np.intp],
    values: Floats,
    standing: NDArray[np.bool_],
    replay: Replay,
) -> tuple[Frontier, NDArray[np.intp], Floats]:
    """The frontier without the rows of knots that do not stand; where the last division before that
    does gains by more time, with that in their place. Then the knots, and what is lived at them."""
    knot_of = np.searchsorted(knots, np.arange(len(frontier.budgets))).clip(0, len(knots) - 1)
    kept, standing = standing[knot_of], standing.copy()
    shares, promised, values = frontier.shares.copy(), frontier.promised.copy(), values.copy()
    best = 0
    for column, knot in enumerate(knots):
        if standing[column]:
            best = knot
            continue
        budget = float(frontier.budgets[knot])
        given = stretched(replay.tables, shares[best].tolist(), budget)
        row = [given.get(table.label, 0.0) for table in replay.tables]
        level = expected_quality(replay.tables, moments_within(replay.tables, row))
        if level > promised[best]:
            shares[knot], promised[knot], best = row, level, knot
            values[:, column] = replay.achieved([*given.values()], budget)
            kept[knot] = standing[column] = True
    found = replace(
        frontier, budgets=frontier.budgets[kept], shares=shares[kept], promised=promised[kept]
    )
    return found, (np.cumsum(kept) - 1)[knots[standing]], values[:, standing]


def as_tables_say(
    program: Program,
    profiles: Mapping[str, Profile],
    frontier: Frontier,
    objective: Objective,
    seed: int = 0,
) -> Calibration:
    """What the tables say is promised. For programs that cannot be lived again on recordings: with
    branches, parallels, several outputs, or for other objectives.

    Intervals of an expected quality are those of the mean of the problems' shares in it, which
    leaving them out one by one tells (the jackknife's pseudo-values, Tukey 1958); of what is no
    mean, by bootstrap over problems.
    """
    problems = sorted({p for profile in profiles.values() for p in profile.problems})
    rng = np.random.default_rng(seed)
    knots = _knots(frontier, RESAMPLED)

    def said_of(counts: Mapping[str, float]) -> list[float]:
        again = tables(program, profiles, counts)
        shares = [frontier.shares[knot].tolist() for knot in knots]
        return [value_of(again, moments_within(again, row), objective) for row in shares]

    said = frontier.promised[knots]
    if objective == EXPECTED and len(problems) == 1:
        low, high = mean_interval(said[None])
    elif objective == EXPECTED:
        groups = np.array_split(rng.permutation(problems), min(len(problems), RESAMPLES))
        without = [said_of({p: float(p not in group) for p in problems}) for group in groups]
        values = len(groups) * said - (len(groups) - 1) * np.array(without)
        low, high = mean_interval(np.clip(values, 0.0, 1.0))
    else:
        drawn = [rng.integers(0, len(problems), len(problems)) for _ in range(RESAMPLES)]
        sampled = [said_of(Counter(problems[int(index)] for index in each)) for each in drawn]
        low, high = np.quantile(sampled, [0.025, 0.975], axis=0)
    low = np.minimum(np.minimum.accumulate(low[::-1])[::-1], said)
    return Calibration(said, said, low, np.maximum(np.maximum.accumulate(high), said))


def _isotonic(levels: Floats, values: Floats) -> Calibration:
    """From lived qualities [P, K] at the tables' levels [K]."""
    blocks = _blocks(values.mean(axis=0))
    pooled = np.array([values[:, block].mean(axis=1) for block in blocks]).T  # [P, blocks]
    low, high = mean_interval(pooled)
    sizes = [block.stop - block.start for block in blocks]
    # Means of equal numbers in another order differ in the last bit, and must not fall by it.
    mean = np.minimum(np.maximum.accumulate(pooled.mean(axis=0)), 1.0)
    columns = (
        mean,
        np.minimum(np.minimum.accumulate(low[::-1])[::-1], mean),
        np.maximum(np.maximum.accumulate(high), mean),
    )
    promised, low, high = (np.repeat(column, sizes) for column in columns)
    rows = np.array([
        np.concatenate([[0.0], levels, [1.0 + 1e-9]]),
        np.concatenate([[0.0], promised, [1.0]]),
        np.concatenate([[0.0], low, low[-1:]]),
        np.concatenate([high[:1], high, [1.0]]),
    ])  # fmt: skip
    # Of knots at one level the last stands: a division that is worth nothing by the tables.
    return Calibration(*rows[:, np.append(np.diff(rows[0]) > 0, True)])


def _unseen(
    program: Program,
    profiles: Mapping[str, Profile],
    frontier: Frontier,
    replay: Replay,
    budgets: Floats,
    seed: int,
) -> Floats:
    """Quality that may be expected on each problem at each budget, [P, budgets].

    It is achieved with the division that is chosen without the problem's fold. That is one of fewer
    problems: by what such divisions achieve less, on the problems that they are chosen on, than the
    frontier's own on all, the promise of that one is more (the optimism of [Efron 1983]).
    """
    problems = replay.problems
    folds = min(FOLDS, len(problems))
    fold_of = np.random.default_rng(seed).permutation(len(problems)) % folds
    every = {problem for profile in profiles.values() for problem in profile.problems}
    chosen = [frontier] * folds
    for fold in range(folds):
        others = every - {problems[row] for row in np.flatnonzero(fold_of == fold)}
        if others:
            made = tables(program, profiles, dict.fromkeys(others, 1.0))
            chosen[fold] = _chosen(made, frontier)
    values = np.zeros((len(problems), len(budgets)))
    for column, budget in enumerate(budgets.tolist()):
        # Where the others say that there is no result yet, all of them had one.
        known = [each if each.index(budget) >= 0 else frontier for each in chosen]
        whole, *lived = _lives(replay, [frontier, *known], budget)
        there: list[Floats] = []
        for fold, each in enumerate(lived):
            values[fold_of == fold, column] = each[fold_of == fold]
            there.append(each[fold_of != fold])
        if folds > 1:
            values[:, column] += whole.mean() - np.concatenate(there).mean()
    return values.clip(0.0, 1.0)


def _lives(replay: Replay, sources: Sequence[Frontier], budget: float) -> list[Floats]:
    """Quality achieved on each problem with the division of each frontier for a budget, [P]."""
    rows = [tuple(source.shares[source.index(budget)].tolist()) for source in sources]
    found = {
        row: replay.achieved([*stretched(replay.tables, row, budget).values()], budget)
        for row in dict.fromkeys(rows)
    }
    return [found[row] for row in rows]


def _standing(values: Floats) -> NDArray[np.bool_]:
    """Which columns [K] are not surely (by two standard errors, paired) worse than one before."""
    standing = np.ones(values.shape[1], dtype=bool)
    best = values[:, 0]
    for column in range(1, values.shape[1]):
        change = values[:, column] - best
        error = change.std(ddof=1) / np.sqrt(len(change)) if len(change) > 1 else np.inf
        standing[column] = change.mean() >= -2.0 * error
        if change.mean() > 0:
            best = values[:, column]
    return standing


def _chosen(made: Sequence[Table], frontier: Frontier) -> Frontier:
    """The frontier by these tables: divided anew, or of many calls, for which that takes long, the
    best of the divisions already known."""
    if len(made) <= DIVIDED:
        return divide(made)
    worth = [expected_quality(made, moments_within(made, row.tolist())) for row in frontier.shares]
    best, kept = -1.0, np.zeros(len(worth), dtype=bool)
    for place, value in enumerate(worth):
        kept[place] = value > best
        best = max(best, value)
    return Frontier(frontier.budgets[kept], frontier.shares[kept], np.array(worth)[kept])


def _knots(frontier: Frontier, most: int) -> NDArray[np.intp]:
    """Places of the frontier, about `most`, spread over promised quality and over time."""
    count = len(frontier.budgets)
    if count <= most:
        return np.arange(count)
    ends = float(frontier.promised[0]), float(frontier.promised[-1])
    by_quality = np.searchsorted(frontier.promised, np.linspace(*ends, most // 2))
    by_time = np.linspace(0, count - 1, most // 2).round()
    return np.unique(np.concatenate([by_quality, by_time]).clip(0, count - 1).astype(np.intp))


def _blocks(means: Floats) -> list[slice]:
    """Runs of neighbours that isotonic regression gives one value: pool adjacent violators."""
    blocks: list[tuple[float, int, int]] = []
    for place, mean in enumerate(means):
        value, start, end = float(mean), place, place + 1
        while blocks and blocks[-1][0] >= value:
            before, first, last = blocks.pop()
            value = (before * (last - first) + value * (end - start)) / (end - first)
            start = first
        blocks.append((value, start, end))
    return [slice(start, end) for _, start, end in blocks]
