"""Laws of divisions: optimal where it can be checked, and never below the plain ones."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compiler import equal_shares, maximal, minimal
from compiler.advising import advise
from compiler.baselines import divided
from compiler.division import divide, expected_quality, moments_within, output_chances
from compiler.explaining import explain
from compiler.tables import Table
from experiments.benchmarks.compiler_trees import mismatch, random_program

SHAPES = {
    "one": ([],),
    "chain": ([], [0]),
    "three": ([], [0], [1]),
    "tree": ([], [], [0, 1]),
    "shared": ([], [0], [0, 1]),
    "four": ([], [0], [1], [2]),
}


def chancy(feeds: list[list[int]], seed: int, rising: bool = True) -> tuple[Table, ...]:
    """Tables of modules whose results are left to chance; `rising`: as time goes they improve."""
    rng = np.random.default_rng(seed)
    tables: list[Table] = []
    for place, fed in enumerate(feeds):
        count, moments = int(rng.integers(2, 6)), int(rng.integers(2, 7))
        levels = np.concatenate([[0.0], np.sort(rng.random(count - 1))])
        times = np.concatenate([[0.0], np.cumsum(rng.random(moments - 1) + 0.05)])
        shape = [len(tables[f].levels) for f in fed]
        chances = rng.dirichlet(np.full(count, 0.5), size=(*shape, moments))
        if rising:  # stochastically larger with time: the chance of each level or less falls
            below = np.minimum.accumulate(chances.cumsum(axis=-1), axis=-2)
            chances = np.diff(below, prepend=0.0, axis=-1)
        chances[..., 0, :] = np.eye(count)[0]
        for axis in range(len(shape)):
            chances[(slice(None),) * axis + (0,)] = np.eye(count)[0]
        chances = np.clip(chances, 0.0, None)
        chances /= chances.sum(axis=-1, keepdims=True)
        labels = tuple(f"call {f}" for f in fed)
        tables.append(
            Table(f"call {place}", f"m{place}", labels, levels, times, chances, float(times[1]))
        )
    return tuple(tables)


programs = st.builds(
    chancy,
    st.sampled_from(list(SHAPES.values())),
    st.integers(0, 2**32),
    st.booleans(),
)


def total(tables) -> float:
    return float(sum(table.times[-1] for table in tables))


# Against brute force


@pytest.mark.parametrize("shared", [False, True])
def test_no_division_of_a_program_without_chance_beats_the_compiled_one(shared):
    rng = np.random.default_rng(11 + shared)
    assert sum(mismatch(random_program(rng, shared)) for _ in range(300)) == 0


def test_a_result_of_quality_zero_is_not_mistaken_for_no_result():
    """The first module's only result is worthless by itself, and yet the others need it."""
    quality = np.array([0.0, 0.0])
    sure = np.zeros((2, 2))
    sure[0, 0] = sure[1, 1] = 1.0
    fed = np.zeros((2, 2, 2))
    fed[..., 0] = 1.0
    fed[1, 1] = [0.0, 1.0]
    times = np.array([0.0, 1.0])
    tables = (
        Table("a", "a", (), quality, times, sure, 1.0),
        Table("b", "b", ("a",), quality, times, fed, 1.0),
        Table("c", "c", ("b",), np.array([0.0, 0.9]), times, fed, 1.0),
    )
    assert not mismatch(tables)
    assert divide(tables).promise(3.0) == 0.9


@given(
    st.builds(chancy, st.sampled_from([SHAPES["three"], SHAPES["shared"]]), st.integers(0, 2**32))
)
@settings(max_examples=12)
def test_what_is_called_exact_is_beaten_by_no_division(tables):
    frontier = divide(tables)
    assert frontier.exact
    assert (np.diff(frontier.budgets) > 0).all()
    assert (np.diff(frontier.promised) > 0).all()
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 1e-8


@given(st.builds(chancy, st.sampled_from([SHAPES["one"], SHAPES["chain"]]), st.integers(0, 2**32)))
def test_one_and_two_calls_are_divided_optimally_over_distributions(tables):
    frontier = divide(tables)
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 1e-8


@settings(max_examples=40)
@given(st.sampled_from([SHAPES["three"], SHAPES["tree"], SHAPES["shared"]]), st.integers(0, 2**32))
def test_three_calls_are_divided_nearly_optimally_over_distributions(feeds, seed):
    """No law: the pairwise exchange may miss a little. It must miss little."""
    tables = chancy(feeds, seed)
    frontier = divide(tables)
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 0.005


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_longer_chains_promise_at_least_the_best_of_random_divisions(seed):
    tables = chancy(SHAPES["four"], seed)
    frontier, rng = divide(tables), np.random.default_rng(seed)
    for budget in np.linspace(0.2, 1.0, 5) * total(tables):
        drawn = rng.dirichlet(np.ones(len(tables)), size=60) * budget
        best = max(expected_quality(tables, moments_within(tables, shares)) for shares in drawn)
        assert frontier.promise(budget) >= best - 0.005


# Laws at every budget


@given(programs)
def test_shares_fit_their_budget_and_keep_their_promise(tables):
    frontier = divide(tables)
    assert (np.diff(frontier.budgets) > 0).all()
    assert (frontier.shares >= 0).all()
    assert frontier.shares.sum(axis=1) == pytest.approx(frontier.budgets)
    for shares, promised in zip(frontier.shares, frontier.promised, strict=True):
        assert expected_quality(tables, moments_within(tables, shares)) == pytest.approx(promised)


@given(programs)
def test_more_time_never_promises_less(tables):
    frontier = divide(tables)
    budgets = np.linspace(0, 1.1 * total(tables), 60)
    promised = np.array([frontier.promise(budget) for budget in budgets])
    assert (np.diff(promised) >= 0).all()
    assert ((promised >= 0) & (promised <= 1)).all()


@given(programs)
def test_the_compiled_division_is_never_below_min_max_and_equal_shares(tables):
    frontier = divide(tables)
    budgets = np.linspace(0, 1.2 * total(tables), 80)
    promised = np.array([frontier.promise(budget) for budget in budgets])
    by_tables = divided(tables, frontier, budgets)
    assert (by_tables >= promised - 1e-8).all()
    for plain in (minimal, maximal, equal_shares):
        assert (promised >= plain(tables, budgets) - 1e-8).all(), plain.__name__


@given(programs, st.integers(0, 5), st.floats(1, 10))
def test_a_faster_module_never_promises_less(tables, place, factor):
    place %= len(tables)
    changed = [*tables]
    changed[place] = tables[place].faster(factor)
    before, after = divide(tables), divide(changed)
    exact = len(tables) <= 2
    for budget in np.linspace(0, total(tables), 12):
        assert after.promise(budget) >= before.promise(budget) - (1e-8 if exact else 0.005)


@settings(max_examples=30)
@given(programs, st.floats(0.1, 1.0))
def test_advice_and_prices_are_never_negative(tables, share):
    frontier = divide(tables)
    if not len(frontier.budgets):
        return
    budget = max(share * total(tables), float(frontier.budgets[0]))
    advice = advise("program", tables, frontier, budget)
    gains = [change.gain for change in advice.changes]
    assert gains == sorted(gains, reverse=True)
    assert min(gains) >= 0
    explanation = explain("program", tables, frontier, budget)
    assert all(price.gain >= 0 for price in explanation.prices)
    assert sum(price.share for price in explanation.prices) == pytest.approx(budget)
    assert explanation.less <= explanation.promised <= explanation.more


def test_flat_profiles_are_divided_the_same_way_every_time():
    tables = tuple(
        replace(t, chances=np.broadcast_to(t.chances[..., -1:, :], t.chances.shape))
        for t in chancy(SHAPES["three"], 3)
    )
    one, other = divide(tables), divide(tables)
    assert one.shares.tobytes() == other.shares.tobytes()
    assert one.promised.tobytes() == other.promised.tobytes()


def test_a_program_that_never_has_a_result_has_no_division():
    never = np.zeros((3, 1))
    never[:] = 1.0
    table = Table("a", "a", (), np.array([0.0]), np.array([0.0, 1, 2]), never, 2.0)
    assert len(divide((table,)).budgets) == 0
    fed = Table("b", "b", ("a",), np.array([0.0, 1.0]), np.array([0.0, 1]), np.ones((1, 2, 2)), 1.0)
    fed.chances[...] = [1.0, 0.0]
    assert len(divide((table, fed)).budgets) == 0
    last = replace(fed, label="c", feeds=("b",), chances=np.array([fed.chances[0]] * 2))
    assert len(divide((table, fed, last)).budgets) == 0


def test_a_poor_program_of_three_calls_still_has_a_result():
    """Each call rarely has a result, so that its mean is nearer to none than to any."""

    def rare(label, feeds):
        chances = np.zeros((*([2] * len(feeds)), 2, 2))
        chances[..., 0] = 1.0
        chances[(*([1] * len(feeds)), 1)] = [0.8, 0.2]
        return Table(label, label, feeds, np.array([0.0, 1.0]), np.array([0.0, 1.0]), chances, 1.0)

    tables = (rare("a", ()), rare("b", ("a",)), rare("c", ("b",)))
    assert divide(tables).promise(3.0) == pytest.approx(0.2**3)


@given(programs, st.data())
def test_chances_of_the_output_sum_to_one(tables, data):
    moments = [data.draw(st.integers(0, len(table.times) - 1)) for table in tables]
    chances = output_chances(tables, moments)
    assert chances.sum() == pytest.approx(1)
    assert chances @ tables[-1].levels == pytest.approx(expected_quality(tables, moments))


@given(programs, st.lists(st.floats(0, 5), min_size=4, max_size=4))
def test_the_moments_within_shares_are_the_last_that_they_reach(tables, shares):
    for table, share, moment in zip(
        tables, shares, moments_within(tables, shares[: len(tables)]), strict=False
    ):
        assert table.times[moment] <= share + 1e-9
        assert moment == len(table.times) - 1 or table.times[moment + 1] > share
