"""Bounds that hold at every moment at once."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.confidence import LEVELS, mean_bounds, problems_left, regret_bound, regret_bounds


def test_a_mean_rarely_exceeds_any_of_its_bounds():
    rng = np.random.default_rng(0)
    for mean in (0.0, 0.05, 0.3):
        # Values in {-1, 0, 1}: mostly 0, which tempts a bound to be too sure.
        chances = (0.1, 0.8 - mean, 0.1 + mean)
        values = rng.choice([-1.0, 0.0, 1.0], p=chances, size=(200, 200))
        bounds = mean_bounds(values, 0.1)
        assert np.mean((mean > bounds).any(axis=0)) <= 0.1


def test_choices_that_are_always_equal_are_soon_known_to_be():
    values = np.tile(np.random.default_rng(0).random((400, 1)), (1, 4))
    assert regret_bound(values, 2) <= 0.03


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 5), st.integers(1, 40), st.integers(0, 99))
def test_bounds_are_stated_levels_and_agree_for_the_choice_that_looks_best(choices, count, seed):
    values = np.random.default_rng(seed).random((count, choices))
    chosen, bounds = regret_bounds(values)
    assert set(bounds) <= set(LEVELS)
    assert regret_bound(values, int(chosen[-1])) == bounds[-1]
    assert chosen[-1] == values.sum(axis=0).argmax()


def test_nothing_is_left_when_the_bound_is_small_enough():
    assert problems_left(100, 0.04, 0.05) == 0
    assert problems_left(100, 0.1, 0.05) == 300
