"""Deciding inside a call: against every way of stopping, and never worth less than not looking."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import compiler
from anytime.programs import Call
from compiler.adaptive import plan_for
from compiler.division import divide
from compiler.seeing import only_asked
from compiler.stopping import transitions
from compiler.tables import Courses, Table
from experiments.benchmarks.compiler_adaptive import chain
from experiments.benchmarks.compiler_constructs import random_tables, read, sketch
from experiments.benchmarks.compiler_watching import chained, counted, drawn, live

COST = 0.07  # of a second
BUDGET = 6.0


def with_runs(table: Table, rng: np.random.Generator, runs: int = 6) -> Table:
    """A call's table that counts random runs, each of which begins without a result."""
    cells, (moments, size) = table.chances.shape[:-2], table.chances.shape[-2:]
    levels = rng.integers(0, size, size=(runs, moments))
    levels[:, 0] = 0
    weights = rng.random((*cells, runs)) * (rng.random((*cells, runs)) < 0.7)
    for axis in range(len(cells)):
        weights[(slice(None),) * axis + (0,)] = 0  # no input, no result
    weights /= np.maximum(weights.sum(axis=-1, keepdims=True), 1e-12)
    chances = np.stack([weights @ (levels == level) for level in range(size)], axis=-1)
    chances[..., 0] += 1 - chances.sum(axis=-1)
    return replace(table, chances=chances, courses=Courses(levels, weights))


def pair(rng: np.random.Generator) -> tuple[Table, Table]:
    """Tables of two calls after each other, of three levels and four moments."""

    def table(label: str, feeds: tuple[str, ...], shape: tuple[int, ...]) -> Table:
        levels = np.array([0.0, *np.sort(rng.random(2))])
        times = np.array([0.0, 1.0, 2.0, 4.0])
        plain = Table(label, label, feeds, levels, times, np.zeros((*shape, 4, 3)), 1.0)
        return with_runs(plain, rng)

    return table("module 0", (), ()), table("module 1", ("module 0",), (3,))


def ends(chain: list[list[list[float]]], stops: dict[tuple[int, int], bool]):
    """Where a run of a call ends that stops as it says: (moment, level) → chance."""
    going = {0: 1.0}
    found: dict[tuple[int, int], float] = {}
    for moment in range(len(chain) + 1):
        onward: dict[int, float] = {}
        for level, chance in going.items():
            if moment == len(chain) or stops[moment, level]:
                found[moment, level] = chance
                continue
            for to, share in enumerate(chain[moment][level]):
                if share > 0:
                    onward[to] = onward.get(to, 0.0) + chance * share
        going = onward
    return found


LOOKS = [(0, 0), *itertools.product((1, 2), range(3))]
WAYS = [
    dict(zip(LOOKS, stops, strict=True))
    for stops in itertools.product((True, False), repeat=len(LOOKS))
]


def best_way(table: Table, cell: tuple[int, ...], spent: float, worth) -> float:
    """The best of all ways of stopping that look at the moment and at the level."""
    chain = transitions(table)[(slice(None), *cell)].tolist()
    values: list[float] = []
    for stops in WAYS:
        found = ends(chain, stops)
        if all(spent + table.times[moment] <= BUDGET for moment, _ in found):
            values.append(
                sum(c * worth(level, spent + table.times[m]) for (m, level), c in found.items())
            )
    return max(values)


@settings(max_examples=12)
@given(st.integers(0, 2**32))
def test_it_is_the_best_of_all_ways_of_stopping(seed):
    first, second = pair(np.random.default_rng(seed))

    def final(level: int, spent: float) -> float:
        return float(second.levels[level]) - COST * spent

    known: dict[tuple[int, float], float] = {}

    def between(level: int, spent: float) -> float:
        if (level, spent) not in known:
            known[level, spent] = (
                best_way(second, (level,), spent, final) if level else -COST * spent
            )
        return known[level, spent]

    expected = max(best_way(first, (), 0.0, between), 0.0)
    objective = compiler.expected(lambda quality, seconds: quality - COST * seconds)
    steps = {table.label: transitions(table) for table in (first, second)}
    plan = plan_for(chain(2), (first, second), BUDGET, objective, steps)
    assert plan.value == pytest.approx(expected, abs=1e-9)


@settings(max_examples=15)
@given(st.integers(0, 2**32), st.sampled_from(["branch", "loop", "choose", "tests"]), st.booleans())
def test_it_is_never_worth_less_than_deciding_at_boundaries(seed, kind, costly):
    rng = np.random.default_rng(seed)
    program = read(sketch(kind, rng))
    hidden = only_asked(program)
    tables = tuple(
        with_runs(table, rng) if isinstance(node, Call) and table.label not in hidden else table
        for node, table in zip(program.nodes, random_tables(program, rng), strict=True)
    )
    steps = {table.label: transitions(table) for table in tables if table.courses}
    utility = compiler.expected(lambda quality, seconds: quality - 0.02 * seconds)
    objective = utility if costly else compiler.expected()
    for budget in (6.0, 10.0, 20.0):  # whole ticks, as the times of the tables are
        plain = plan_for(program, tables, budget, objective).value
        inside = plan_for(program, tables, budget, objective, steps).value
        assert inside >= plain - 1e-9
        assert inside >= divide(tables, objective).promise(budget) - 1e-9


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.booleans())
def test_where_levels_say_nothing_there_is_nothing_to_watch_for(seed, costly):
    """Runs that are all alike until their last result."""
    rng = np.random.default_rng(seed)
    first, second = pair(rng)

    def alike(table: Table) -> Table:
        levels = np.tile(table.courses.levels[0], (len(table.courses.levels), 1))
        levels[:, -1] = rng.integers(0, 3, size=len(levels))
        weights = table.courses.weights
        chances = np.stack([weights @ (levels == level) for level in range(3)], axis=-1)
        chances[..., 0] += 1 - chances.sum(axis=-1)
        return replace(table, chances=chances, courses=Courses(levels, weights))

    tables = alike(first), alike(second)
    cost = COST if costly else 0.0
    objective = compiler.expected(lambda quality, seconds: quality - cost * seconds)
    steps = {table.label: transitions(table) for table in tables}
    plain = plan_for(chain(2), tables, BUDGET, objective)
    inside = plan_for(chain(2), tables, BUDGET, objective, steps)
    assert inside.value == pytest.approx(plain.value, abs=1e-9)


@settings(max_examples=25)
@given(st.integers(0, 2**32))
def test_transitions_carry_the_table_from_moment_to_moment(seed):
    for table in pair(np.random.default_rng(seed)):
        steps = transitions(table)
        assert steps.min() >= 0
        assert np.allclose(steps.sum(axis=-1), 1)
        for moment, chances in enumerate(steps):
            carried = (table.chances[..., moment, None, :] @ chances)[..., 0, :]
            assert np.allclose(carried, table.chances[..., moment + 1, :])


def test_from_a_level_without_runs_it_goes_as_from_the_nearest_with_some():
    runs = np.array([[0, 2, 2], [0, 2, 3]])
    levels, times = np.array([0.0, 0.2, 0.4, 0.6, 0.8]), np.array([0.0, 1.0, 2.0])
    chances = np.stack([(runs == level).mean(axis=0) for level in range(5)], axis=-1)
    courses = Courses(runs, np.array([0.5, 0.5]))
    after = transitions(Table("a", "a", (), levels, times, chances, 1.0, courses=courses))[1]
    assert after[2].tolist() == [0, 0, 0.5, 0.5, 0]
    assert after[1].tolist() == [0, 0.5, 0.5, 0, 0]  # one lower to begin with, and so after
    assert after[3].tolist() == [0, 0, 0, 0.5, 0.5]
    assert after[4].tolist() == [0, 0, 0, 0, 1]
    assert after[0].tolist() == [0.5, 0.5, 0, 0, 0]


def test_a_run_counts_half_for_the_levels_next_to_its_own():
    """The only run at a level stays there, most of those at the next rise."""
    runs = np.array([[0, 2, 2]] + [[0, 3, 4]] * 5 + [[0, 3, 3]] * 4)
    levels, times = np.linspace(0.0, 1.0, 6), np.array([0.0, 1.0, 2.0])
    chances = np.stack([(runs == level).mean(axis=0) for level in range(6)], axis=-1)
    courses = Courses(runs, np.full(10, 0.1))
    after = transitions(Table("a", "a", (), levels, times, chances, 1.0, courses=courses))[1]
    assert after[2, 2] > 0.2
    assert after[2, 3] > 0.2


@pytest.mark.parametrize("cost", [0.0, 0.004])
def test_a_policy_that_watches_is_worth_what_it_says_when_lived(cost):
    rng = np.random.default_rng(7)
    program = chain()
    tables = counted(program, drawn(program, 0.4, rng), 30, rng)
    steps = {table.label: transitions(table) for table in tables}
    objective = compiler.expected(lambda quality, seconds: quality - cost * seconds)
    plan = plan_for(program, tables, 60.0, objective, steps)
    lived, error = live(program, tables, plan, objective, chained(tables, steps, rng), 500)
    assert lived == pytest.approx(plan.value, abs=4 * error)
