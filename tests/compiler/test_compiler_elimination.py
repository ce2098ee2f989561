"""Variable elimination against brute force, in both semirings."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compiler.elimination import (
    MIN_PLUS,
    SUM_PRODUCT,
    Factor,
    all_cheapest_levels,
    cheapest_levels,
    eliminate,
    order_of,
    times_to_levels,
)

NAMES = "abcde"


@st.composite
def networks(draw):
    """Up to six factors over up to five variables, and the variables to keep."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    sizes = {name: draw(st.integers(1, 3)) for name in NAMES}
    scopes = draw(
        st.lists(st.lists(st.sampled_from(NAMES), unique=True, max_size=3), min_size=1, max_size=6)
    )
    factors = [
        Factor(tuple(scope), np.asarray(rng.random([sizes[name] for name in scope])))
        for scope in scopes
    ]
    there = sorted({name for scope in scopes for name in scope})
    keep = draw(st.lists(st.sampled_from(there), unique=True, max_size=2)) if there else []
    return factors, tuple(keep), {name: sizes[name] for name in there}


def joined(factors, levels, join):
    value = None
    for factor in factors:
        cell = factor.table[tuple(levels[name] for name in factor.scope)]
        value = cell if value is None else join(value, cell)
    return float(value)


@pytest.mark.parametrize(
    ("semiring", "total"), [(MIN_PLUS, min), (SUM_PRODUCT, sum)], ids=["(min, +)", "(+, ×)"]
)
@given(network=networks())
def test_elimination_is_what_brute_force_gives(semiring, total, network):
    factors, keep, sizes = network
    result, _ = eliminate(factors, order_of(factors, keep), semiring)
    assert result.scope == keep
    assert result.table.shape == tuple(sizes[name] for name in keep)
    rest = [name for name in sizes if name not in keep]
    for kept in itertools.product(*(range(sizes[name]) for name in keep)):
        levels = dict(zip(keep, kept, strict=True))
        brute = total(
            joined(factors, {**levels, **dict(zip(rest, other, strict=True))}, semiring.join)
            for other in itertools.product(*(range(sizes[name]) for name in rest))
        )
        assert result.table[kept] == pytest.approx(brute)


@given(network=networks())
def test_the_cheapest_levels_reach_the_minimum(network):
    factors, keep, sizes = network
    result, steps = eliminate(factors, order_of(factors, keep), MIN_PLUS)
    for kept in itertools.product(*(range(sizes[name]) for name in keep)):
        levels = cheapest_levels(steps, dict(zip(keep, kept, strict=True)))
        assert set(levels) == set(sizes)
        assert joined(factors, levels, np.add) == pytest.approx(result.table[kept])
    if keep:
        cells = np.indices(result.table.shape).reshape(len(keep), -1)
        every = all_cheapest_levels(steps, dict(zip(keep, cells, strict=True)))
        assert {len(each) for each in every.values()} == {result.table.size}
    else:
        assert {len(each) for each in all_cheapest_levels(steps, {}).values()} <= {1}


def test_the_answer_does_not_depend_on_the_order_of_factors():
    rng = np.random.default_rng(0)
    factors = [Factor(("a", "b"), rng.random((2, 3))), Factor(("b", "c"), rng.random((3, 2)))]
    one, other = (
        eliminate(each, order_of(each, "c"), SUM_PRODUCT)[0] for each in (factors, factors[::-1])
    )
    assert one.table == pytest.approx(other.table)


@given(st.lists(st.lists(st.integers(0, 3), min_size=4, max_size=4), min_size=1, max_size=5))
def test_times_to_levels_are_the_first_at_which_exactly_that_level_is_there(rows):
    quality, times = np.array(rows, dtype=np.intp), np.array([0.0, 1.0, 2.5, 4.0])
    table = times_to_levels(quality, times, 4)
    for row, levels in enumerate(rows):
        for level in range(4):
            first = times[levels.index(level)] if level in levels else np.inf
            assert table[row, level] == first


def test_times_to_levels_are_found_for_every_combination_of_inputs():
    quality = np.random.default_rng(0).integers(0, 4, size=(2, 3, 5))
    times = np.arange(5.0)
    table = times_to_levels(quality, times, 4)
    assert table.shape == (2, 3, 4)
    for row in range(2):
        assert np.array_equal(table[row], times_to_levels(quality[row], times, 4))
