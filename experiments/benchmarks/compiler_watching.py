"""What it is worth to decide inside calls too, by what they show while they run.

The chains of `compiler_adaptive`, as recorded runs: a run has its luck, good or bad, from beginning
to end, so that what it shows after a while says what it will come to. Deciding inside is compared
with deciding at boundaries on the same tables. What a plan is worth is computed; it is lived in the
tables' own chain of levels, and on runs that the tables have never counted.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import compiler
from anytime.joins import Known
from anytime.programs import Program
from compiler.adaptive import plan_for
from compiler.objectives import Objective
from compiler.policies import Plan, Policy
from compiler.stopping import transitions
from compiler.tables import Courses, Table
from experiments.benchmarks.compiler_adaptive import COST, LEVELS, LUCK, STEPS, chain

RUNS, FEW = 300, 30  # that a table counts for each level of its input
LIVES = 2000
SPREAD = 0.05  # between runs of the same luck
QUALITIES = np.linspace(0.0, 1.0, LEVELS)

Levels = NDArray[np.intp]
Draw = Callable[[int, int], Levels]  # place of a call, level of its input → its level at each step


@dataclass(frozen=True)
class Stage:
    """How a module rises: by its rate, with a chance of bad luck, above a gate of its input."""

    rate: float
    gate: float | None
    luck: float

    def runs(self, quality: float, count: int, rng: np.random.Generator) -> Levels:
        """Levels of some runs on an input of this quality, [count, STEPS + 1]."""
        rising = 1 - np.exp(-self.rate * np.arange(STEPS + 1))
        passed = 1.0
        if self.gate is not None:
            passed = (0.3 + 0.7 * quality) / (1 + np.exp(-(quality - self.gate) / 0.05))
        luck = np.where(rng.random(count) < self.luck, 0.3, 1.0)[:, None]
        reached = passed * luck * rising + rng.normal(0, SPREAD, count)[:, None]
        levels = np.clip(np.rint(reached * (LEVELS - 1)), 1, LEVELS - 1).astype(np.intp)
        levels[:, 0] = 0
        return levels


@dataclass(frozen=True)
class Compared:
    """A chain's tables with the plan that decides at boundaries and the one that decides inside."""

    tables: list[Table]
    steps: dict[str, np.ndarray]
    plain: Plan
    inside: Plan


def measure(count: int, seed: int) -> tuple[dict[str, float | int | None], int]:
    """Figures of `count` chains for each chance of bad luck, and in how many of them deciding
    inside is worth less than deciding at boundaries."""
    rng = np.random.default_rng([seed, 23])
    program = chain()
    objective = compiler.expected(lambda quality, steps: quality - COST * steps)
    computed: dict[float, list[tuple[float, float]]] = {luck: [] for luck in LUCK}
    unseen_gains: dict[int, list[tuple[float, float]]] = {RUNS: [], FEW: []}
    below, worst = 0, 0.0
    for luck in LUCK:
        for place in range(count):
            stages = drawn(program, luck, rng)
            many = compared(program, counted(program, stages, RUNS, rng), objective)
            below += bool(many.inside.value < many.plain.value - 1e-9)
            computed[luck].append((many.plain.value, many.inside.value))
            if place > count // 4:  # some of them are lived
                continue
            own = chained(many.tables, many.steps, rng)
            lived, error = live(program, many.tables, many.inside, objective, own)
            worst = max(worst, abs(lived - many.inside.value) / error)
            if not luck:
                continue
            few = compared(program, counted(program, stages, FEW, rng), objective)
            for runs, each in ((RUNS, many), (FEW, few)):
                fresh = unseen(stages, rng)
                plain, _ = live(program, each.tables, each.plain, objective, fresh)
                inside, _ = live(program, each.tables, each.inside, objective, fresh)
                unseen_gains[runs].append((plain, inside))
    gains = {luck: gain(pairs) for luck, pairs in computed.items()}
    figures = {
        "adaptive.inside_gain": gain([pair for luck in LUCK[1:] for pair in computed[luck]]),
        **{f"adaptive.inside_gain_luck_{100 * luck:.0f}": each for luck, each in gains.items()},
        "adaptive.inside_gain_unseen": gain(unseen_gains[RUNS]),
        "adaptive.inside_gain_few": gain(unseen_gains[FEW]),
        "adaptive.inside_lived_worst_z": worst,
        "adaptive.inside_count": len(LUCK) * count,
    }
    return figures, below


def compared(program: Program, tables: list[Table], objective: Objective) -> Compared:
    """Both plans on the same tables."""
    steps = {table.label: transitions(table) for table in tables}
    plain = plan_for(program, tables, float(STEPS), objective)
    inside = plan_for(program, tables, float(STEPS), objective, steps)
    return Compared(tables, steps, plain, inside)


def gain(pairs: Sequence[tuple[float, float]]) -> float:
    """Of pairs of values, what the second are worth more in all."""
    first, second = np.sum(pairs, axis=0)
    return float(second / first - 1)


def drawn(program: Program, luck: float, rng: np.random.Generator) -> list[Stage]:
    """Modules at random; the first has no gate."""
    return [
        Stage(rng.uniform(0.05, 0.25), rng.uniform(0.3, 0.6) if place else None, luck)
        for place in range(len(program.calls))
    ]


def counted(
    program: Program, stages: Sequence[Stage], runs: int, rng: np.random.Generator
) -> list[Table]:
    """Tables that count so many runs of each stage for each level of its input."""
    tables: list[Table] = []
    for place, (call, stage) in enumerate(zip(program.calls, stages, strict=True)):
        cells = LEVELS if place else 1
        levels = np.concatenate([stage.runs(float(QUALITIES[c]), runs, rng) for c in range(cells)])
        weights = np.repeat(np.eye(cells), runs, axis=1) / runs
        chances = np.stack([weights @ (levels == level) for level in range(LEVELS)], axis=-1)
        feeds: tuple[str, ...] = ()
        if place:
            feeds = (program.calls[place - 1].label,)
            weights[0], chances[0] = 0.0, np.eye(LEVELS)[0]  # no input, no result
        else:
            weights, chances = weights[0], chances[0]
        times = np.arange(STEPS + 1, dtype=float)
        name, courses = call.module.name, Courses(levels, weights)
        table = Table(call.label, name, feeds, QUALITIES, times, chances, 1.0, courses=courses)
        tables.append(table)
    return tables


def chained(
    tables: Sequence[Table], steps: Mapping[str, np.ndarray], rng: np.random.Generator
) -> Draw:
    """Runs drawn from the transitions of tables."""
    sums = [np.cumsum(steps[table.label], axis=-1) for table in tables]
    cells = [each.reshape(STEPS, -1, LEVELS, LEVELS).tolist() for each in sums]

    def draw(place: int, fed: int) -> Levels:
        level, levels = 0, [0]
        for moment, luck in enumerate(rng.random(STEPS).tolist()):
            row = cells[place][moment][fed if place else 0][level]
            level = bisect.bisect_right(row, luck * row[-1])
            levels.append(level)
        return np.array(levels)

    return draw


def unseen(stages: Sequence[Stage], rng: np.random.Generator) -> Draw:
    """Runs that no table has counted."""

    def draw(place: int, fed: int) -> Levels:
        return stages[place].runs(float(QUALITIES[fed]), 1, rng)[0]

    return draw


def live(
    program: Program,
    tables: Sequence[Table],
    plan: Plan,
    objective: Objective,
    draw: Draw,
    lives: int = LIVES,
) -> tuple[float, float]:
    """What a plan is worth when it is lived by chance, and the standard error of that."""
    policy = Policy((plan,), {table.label: table.levels for table in tables}, {})
    worths = np.zeros(lives)
    for life in range(lives):
        left, level, known = plan.budget, 0, dict[str, Known]()
        for place, table in enumerate(tables):
            share = policy.share(program, plan, table.label, left, known)
            last = round(share.seconds)
            if place and not level:
                left, level = left - last, 0
                continue
            levels = draw(place, level)
            spent = last
            if share.watched:
                at = np.minimum(np.arange(last + 1), len(share.ends) - 1)
                over = share.ends[at, levels[: last + 1]]
                spent = int(over.argmax()) if over.any() else last
            left, level = left - spent, int(levels[spent])
            if level:
                known[table.label] = Known(None, float(QUALITIES[level]))
        spent_all = np.asarray(plan.budget - left)
        worths[life] = float(objective.worth(QUALITIES[[level]], spent_all)[0])
    return float(worths.mean()), float(worths.std(ddof=1) / np.sqrt(lives)) + 1e-12
