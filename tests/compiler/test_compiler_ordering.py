"""Orders of elimination: complete, and no dearer than they must be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compiler.ordering import elimination_order


def order(scopes, keep=(), levels=4):
    shapes = tuple((levels,) * len(scope) for scope in scopes)
    return elimination_order(tuple(scopes), shapes, tuple(keep))


@given(
    st.lists(
        st.lists(st.sampled_from("abcdef"), unique=True, max_size=3).map(tuple),
        min_size=1,
        max_size=8,
    ),
    st.sets(st.sampled_from("abcdef"), max_size=2),
)
def test_every_variable_but_the_kept_is_eliminated_once_and_every_factor_is_used_once(scopes, keep):
    found = order(scopes, sorted(keep))
    there = {name for scope in scopes for name in scope}
    assert sorted(bucket.variable for bucket in found.buckets) == sorted(there - keep)
    used = [number for bucket in found.buckets for number in bucket.members] + list(found.left)
    assert sorted(used) == list(range(len(scopes) + len(found.buckets)))
    for bucket in found.buckets:
        spoken = {name for number in bucket.members for name in found.scopes[number]}
        assert spoken == {bucket.variable, *bucket.scope}


def test_a_tree_joins_no_table_larger_than_those_of_its_calls():
    scopes = [("a",), ("b",), ("a", "b", "c"), ("d",), ("c", "d", "e")]
    assert order(scopes, "e").cells == 4**3
    assert order(scopes[::-1], "e").cells == 4**3


def test_a_long_chain_is_eliminated_in_the_order_of_its_calls():
    scopes = [("0",), *[(str(place), str(place + 1)) for place in range(99)]]
    found = order(scopes, ("99",))
    assert [bucket.variable for bucket in found.buckets] == [str(place) for place in range(99)]
    assert found.cells == 16
    assert [len(stage.buckets) for stage in found.stages] == [20] * 4 + [19]
    assert [bucket for stage in found.stages for bucket in stage.buckets] == [*found.buckets]


def test_where_tables_grow_large_a_better_order_than_the_greedy_one_is_looked_for():
    rng = np.random.default_rng(5)
    pairs = {tuple(sorted(map(str, rng.choice(16, size=2, replace=False)))) for _ in range(34)}
    grid = order(sorted(pairs), levels=16)
    assert grid.cells <= 16**7


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_result_used_once_is_marked_with_its_place_in_the_table_that_uses_it(axis):
    names = ("p", "q", "r")
    found = order([(names[axis],), names], keep=[n for n in names if n != names[axis]])
    (bucket,) = found.buckets
    assert bucket.blocks == (4**axis, 4, 4 ** (2 - axis))
