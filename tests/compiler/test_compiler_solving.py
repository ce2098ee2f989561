"""The cheapest way to every level: exact, or between bounds that hold."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compiler import elimination, solving
from compiler.climbing import climbed, cost_of
from compiler.elimination import (
    MIN_PLUS,
    SUM_PRODUCT,
    Factor,
    all_cheapest_levels,
    eliminate,
    order_of,
)
from compiler.relaxation import Relaxation
from compiler.solving import Solution, cheapest


@st.composite
def programs(draw):
    """Factors of three to six calls with up to two inputs each; results are shared, some levels
    cannot be reached, and better input may be worse."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(3, 6))
    factors = []
    for place in range(count):
        inputs = min(place, draw(st.integers(1, 2)))
        fed = sorted(map(int, rng.choice(place, size=inputs, replace=False))) if place else []
        if place == count - 1 and count - 2 not in fed:
            fed = [*fed[:1], count - 2]
        table = rng.random((3,) * (len(fed) + 1))
        table[rng.random(table.shape) < draw(st.sampled_from([0.0, 0.2]))] = np.inf
        factors.append(Factor((*[f"call {each}" for each in fed], f"call {place}"), table))
    return factors, f"call {count - 1}"


def brute(factors, output):
    names = sorted({name for factor in factors for name in factor.scope})
    best = np.full(3, np.inf)
    for levels in itertools.product(range(3), repeat=len(names)):
        chosen = dict(zip(names, levels, strict=True))
        best[chosen[output]] = min(best[chosen[output]], cost_of(factors, chosen))
    return best


@given(programs())
@settings(deadline=None)
def test_branch_and_bound_finds_what_brute_force_finds(program):
    factors, output = program
    solution = cheapest(factors, output, cells=0)
    assert solution.method == "branch and bound"
    assert solution.seconds == pytest.approx(brute(factors, output))
    assert solution.exact


@pytest.mark.parametrize("cells", [0, 1e9])
@given(program=programs())
@settings(deadline=None)
def test_the_levels_of_a_solution_cost_what_it_says(cells, program):
    factors, output = program
    solution = cheapest(factors, output, cells)
    reached = np.flatnonzero(np.isfinite(solution.seconds))
    ways = solution.levels(reached)
    for place, level in enumerate(reached):
        way = {name: int(levels[place]) for name, levels in ways.items()}
        assert way[output] == level
        assert cost_of(factors, way) == pytest.approx(solution.seconds[level])


@given(programs())
@settings(deadline=None)
def test_the_bound_never_falls_and_never_passes_the_optimum(program):
    factors, output = program
    best = brute(factors, output)
    for level in range(3):
        relaxation = Relaxation(factors, {output: level})
        bounds = [relaxation.bound]
        for _ in range(4):
            relaxation.improve()
            bounds.append(relaxation.bound)
        assert np.isinf(bounds[-1]) or (np.diff(bounds) >= -1e-9).all()
        assert max(bounds) <= best[level] + 1e-9 or np.isinf(best[level])


@given(programs())
@settings(deadline=None)
def test_pruning_keeps_the_optimum(program):
    factors, output = program
    best = brute(factors, output)
    for level in np.flatnonzero(np.isfinite(best)):
        relaxation = Relaxation(factors, {output: int(level)})
        relaxation.improve()
        relaxation.prune(best[level])
        assert cost_of(factors, relaxation.eliminated()) == pytest.approx(best[level])


@given(programs())
@settings(deadline=None)
def test_climbing_never_loses_and_leaves_what_is_fixed(program):
    factors, output = program
    start = {name: 1 for factor in factors for name in factor.scope}
    found = climbed(factors, start, frozenset({output}))
    assert found[output] == 1
    assert cost_of(factors, found) <= cost_of(factors, start)


@given(programs())
@settings(deadline=None)
def test_out_of_work_the_bounds_still_hold_and_the_gap_says_what_may_be_missing(program):
    factors, output = program
    best = brute(factors, output)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(solving, "WORK", 1)
        solution = cheapest(factors, output, cells=0)
    assert (solution.bound <= best + 1e-9).all()
    assert (solution.seconds >= best - 1e-9).all()
    qualities = np.array([0.0, 0.4, 1.0])
    for budget in [*best[np.isfinite(best)], *solution.bound[np.isfinite(solution.bound)]]:
        found = qualities[solution.seconds <= budget + 1e-9].max(initial=0.0)
        possible = qualities[best <= budget].max(initial=0.0)
        assert possible - found <= solution.gap(qualities) + 1e-12


def test_the_gap_is_the_worst_over_budgets():
    solution = Solution("out", np.array([0.0, 2.0, 5.0]), np.array([0.0, 1.0, 5.0]), {}, "")
    assert not solution.exact
    assert solution.gap(np.array([0.0, 0.3, 0.9])) == pytest.approx(0.3)


@given(programs())
@settings(deadline=None)
def test_machine_code_gives_the_same_bits_and_walks_the_same_ways(program):
    factors, output = program

    def found(semiring):
        costs, steps = eliminate(factors, order_of(factors, (output,)), semiring)
        return costs.table, all_cheapest_levels(steps, {output: np.arange(len(costs.table))})

    for semiring in (MIN_PLUS, SUM_PRODUCT):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(elimination, "_machine_code", None)
            plain, ways = found(semiring)
            elimination.warm_up()
            warm, warm_ways = found(semiring)
        assert np.array_equal(warm, plain, equal_nan=True)
        if semiring is MIN_PLUS:
            assert all(np.array_equal(warm_ways[name], ways[name]) for name in ways)


@given(
    st.lists(st.integers(1, 5), min_size=2, max_size=30),
    st.lists(st.booleans(), min_size=30, max_size=30),
    st.sampled_from("CF"),
    st.integers(0, 2**32),
)
@settings(deadline=None)
def test_machine_code_goes_along_a_chain_of_unequal_tables_with_the_same_bits(
    sizes, turned, layout, seed
):
    rng = np.random.default_rng(seed)
    factors = [Factor(("0",), rng.random(sizes[0]))]
    for place, (before, after) in enumerate(itertools.pairwise(sizes)):
        scope, table = (str(place), str(place + 1)), rng.random((before, after))
        table = np.asarray(np.where(table < 0.2, np.inf, table), order=layout)
        factors.append(Factor(scope[::-1], table.T) if turned[place] else Factor(scope, table))
    output = str(len(sizes) - 1)
    wanted = {output: np.arange(sizes[-1])}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(elimination, "_machine_code", None)
        plain, steps = eliminate(factors, order_of(factors, (output,)), MIN_PLUS)
        ways = all_cheapest_levels(steps, wanted)
        elimination.warm_up()
        warm, warm_steps = eliminate(factors, order_of(factors, (output,)), MIN_PLUS)
        warm_ways = all_cheapest_levels(warm_steps, wanted)
    assert np.array_equal(warm.table, plain.table)
    assert all(np.array_equal(warm_ways[name], ways[name]) for name in ways)


def test_large_tables_are_joined_in_pieces_with_the_same_result():
    rng = np.random.default_rng(0)
    factors = [
        Factor(("a",), rng.random(20)),
        Factor(("a", "b", "c"), rng.random((20, 21, 22))),
        Factor(("a", "d"), rng.random((20, 23))),
        Factor(("a", "c", "d"), rng.random((20, 22, 23))),
    ]
    found = eliminate(factors, order_of(factors, "bcd"), MIN_PLUS)[0].table
    one, other, third, fourth = (factor.table for factor in factors)
    joined = (
        one[:, None, None, None]
        + other[..., None]
        + third[:, None, None, :]
        + fourth[:, None, :, :]
    )
    assert found == pytest.approx(joined.min(axis=0))


@pytest.mark.parametrize("semiring", [MIN_PLUS, SUM_PRODUCT], ids=["(min, +)", "(+, ×)"])
def test_a_variable_of_very_many_levels_is_summed_out(semiring):
    cells = np.random.default_rng(0).random(3 * elimination.PIECE)
    factors = [Factor(("a",), cells)]
    found = eliminate(factors, order_of(factors, ()), semiring)[0].table
    assert found == pytest.approx(semiring.total.reduce(cells))
