"""What it is worth to decide each share when its call begins, by what was achieved before.

Chains of three modules whose results may be bad luck, and whose second and third do nothing with
an input below a gate; time costs what it costs [0.004 a step, of 60]. The plan's value is computed,
and checked by living it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

import numpy as np

import compiler
from anytime.joins import Known
from anytime.modules import Module
from anytime.programs import Program
from compiler.adaptive import ceiling, plan_for
from compiler.division import divide, nothing
from compiler.objectives import Objective
from compiler.policies import Plan, Policy
from compiler.tables import Table
from experiments.benchmarks.compiler_constructs import random_tables, read, sketch
from experiments.benchmarks.figures import Figures, ratio_interval

STEPS, LEVELS = 60, 21
COST = 0.004  # of a step
LUCK = (0.0, 0.25, 0.4)  # chances of bad luck
LIVES = 2000


def measure(count: int, seed: int) -> Figures:
    """Figures of `count` chains for each chance of bad luck, and of as many random programs."""
    rng = np.random.default_rng([seed, 9])
    program = chain()
    objective = compiler.expected(lambda quality, steps: quality - COST * steps)
    worth: dict[float, list[tuple[float, float]]] = {luck: [] for luck in LUCK}
    below, worst = 0, 0.0
    for luck in LUCK:
        for _ in range(count):
            tables = gated(program, luck, rng)
            static = divide(tables, objective)
            best = max(static.promise(STEPS), nothing(tables, objective))
            plan = plan_for(program, tables, float(STEPS), objective)
            below += bool(plan.value < best - 1e-9)
            worth[luck].append((best, plan.value))
            lived, error = live(program, tables, plan, objective, rng)
            worst = max(worst, abs(lived - plan.value) / error)
    for _ in range(count):
        for kind in ("branch", "loop", "choose"):
            random = read(sketch(kind, rng))
            tables = random_tables(random, rng)
            for budget in (10.0, 20.0):
                plan = plan_for(random, tables, budget, compiler.expected())
                below += bool(plan.value < divide(tables).promise(budget) - 1e-9)
    gaps = [_gap(int(rng.integers(5, 8)), rng) for _ in range(count)]
    gains = {luck: _gain(pairs) for luck, pairs in worth.items()}
    return {
        "adaptive.below_static": below,
        **_gain_interval([pair for luck in LUCK[1:] for pair in worth[luck]]),
        **{f"adaptive.gain_luck_{100 * luck:.0f}": gain for luck, gain in gains.items()},
        "adaptive.lived_worst_z": worst,
        "adaptive.count": len(LUCK) * count,
        "search.gap": max(gaps),
        "search.gap_mean": float(np.mean(gaps)),
    }


def _gap(length: int, rng: np.random.Generator) -> float:
    """How far the division of a chain too long for exactness may be from the best, by the bound
    of a policy that sees everything; the worst of three budgets."""
    program = chain(length)
    tables = gated(program, 0.1, rng, steps=20)
    frontier = divide(tables)
    assert not frontier.exact
    gap = 0.0
    for budget in (20.0, 40.0, 60.0):
        bound = ceiling(program, tables, budget, compiler.expected())
        assert bound is not None
        gap = max(gap, bound - frontier.promise(budget))
    return gap


def _gain(pairs: Sequence[tuple[float, float]]) -> float:
    """Of pairs of (static, adaptive) values, what the adaptive are worth more in all."""
    static, adaptive = np.sum(pairs, axis=0)
    return float(adaptive / static - 1)


def _gain_interval(pairs: Sequence[tuple[float, float]]) -> Figures:
    """The gain on gated profiles with bad luck, with its interval over them."""
    static, adaptive = np.transpose(pairs)
    ratio = ratio_interval("adaptive.gain", adaptive, static)
    return {key: None if value is None else value - 1 for key, value in ratio.items()}


def chain(length: int = 3) -> Program:
    """Modules after each other."""

    def never(*inputs: object) -> None:
        raise AssertionError("only its table is used")

    modules = [
        Module(f"module {place}", never, ("value",), quality=lambda v: 1.0, estimate=lambda v: 1.0)
        for place in range(length)
    ]
    return compiler.program(lambda value: functools.reduce(lambda v, m: m(v), modules, value))


def gated(
    program: Program, luck: float, rng: np.random.Generator, steps: int = STEPS
) -> tuple[Table, ...]:
    """Profiles that rise at random rates, give little with a chance of bad luck however long they
    run, and after the first module do nothing with an input below a gate at random."""
    levels = np.linspace(0.0, 1.0, LEVELS)
    times = np.arange(steps + 1, dtype=float)
    tables: list[Table] = []
    for place, call in enumerate(program.calls):
        rate, spread = rng.uniform(0.05, 0.25), 0.05
        rising = 1 - np.exp(-rate * times)
        gate = rng.uniform(0.3, 0.6)
        passed = 1 / (1 + np.exp(-(levels - gate) / 0.05)) if place else np.ones(1)
        mean = passed[:, None] * (0.3 + 0.7 * levels[:, None] if place else 1.0) * rising
        good, bad = _spread(mean, spread, levels), _spread(0.3 * mean, spread, levels)
        chances = (1 - luck) * good + luck * bad
        chances[:, 0] = np.eye(LEVELS)[0]
        if place:
            chances[0] = np.eye(LEVELS)[0]
        feeds = (program.calls[place - 1].label,) if place else ()
        tables.append(
            Table(
                call.label,
                call.module.name,
                feeds,
                levels,
                times,
                chances if place else chances[0],
                1.0,
            )
        )
    return tuple(tables)


def live(
    program: Program,
    tables: Sequence[Table],
    plan: Plan,
    objective: Objective,
    rng: np.random.Generator,
) -> tuple[float, float]:
    """What a plan is worth when it is lived by chance, and the standard error of that."""
    policy = Policy((plan,), {table.label: table.levels for table in tables}, {})
    worths = np.zeros(LIVES)
    for life in range(LIVES):
        left, known = plan.budget, dict[str, Known]()
        level: Mapping[str, int] = {}
        for table in tables:
            share = policy.share(program, plan, table.label, left, known).seconds
            moment = int(np.searchsorted(table.times, share + 1e-9, side="right")) - 1
            cell = tuple(level[feed] for feed in table.feeds)
            reached = int(rng.choice(len(table.levels), p=table.chances[(*cell, moment)]))
            level = {**level, table.label: reached}
            if reached:
                known[table.label] = Known(None, float(table.levels[reached]))
            left -= float(table.times[moment])
        quality = tables[-1].levels[[level[tables[-1].label]]]
        spent = np.asarray(plan.budget - left)
        worths[life] = float(objective.worth(quality, spent)[0])
    return float(worths.mean()), float(worths.std(ddof=1) / np.sqrt(LIVES)) + 1e-12


def _spread(mean: np.ndarray, spread: float, levels: np.ndarray) -> np.ndarray:
    """A distribution over levels around each mean, [..., L], of about this spread."""
    weights = np.exp(-0.5 * ((levels - mean[..., None]) / spread) ** 2)
    return weights / weights.sum(axis=-1, keepdims=True)
