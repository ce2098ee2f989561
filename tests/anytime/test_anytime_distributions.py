"""Distributions of quality."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from anytime.distributions import Distribution


@st.composite
def distributions(draw):
    values = draw(st.lists(st.one_of(st.floats(0, 1), st.just(np.nan)), min_size=1, max_size=8))
    counts = draw(st.lists(st.integers(0, 4), min_size=len(values), max_size=len(values)))
    weights = np.array(counts, dtype=float)
    weights[draw(st.integers(0, len(values) - 1))] += 1
    return Distribution(np.array(values), weights / weights.sum())


@given(distributions(), st.floats(0, 1), st.floats(0, 1))
def test_a_greater_share_stays_below_a_quality_that_is_no_less(distribution, one, other):
    low, high = (np.nan_to_num(distribution.quantile(q), nan=-1.0) for q in sorted((one, other)))
    assert low <= high


@given(distributions(), st.floats(0.001, 1))
def test_so_large_a_share_has_at_least_the_quality_above_its_quantile(distribution, share):
    quality = distribution.quantile(1 - share)
    if np.isnan(quality):
        assert distribution.no_result >= 1 - share - 1e-9
    else:
        assert distribution.at_least(quality) >= share - 1e-9


@given(distributions(), st.floats(0, 1))
def test_whatever_has_a_result_has_one_of_quality_0(distribution, quality):
    assert distribution.at_least(quality) <= distribution.at_least(0.0) + 1e-9
    assert distribution.at_least(0.0) == pytest.approx(1 - distribution.no_result)


@given(distributions())
def test_the_mean_lies_between_no_result_and_the_best(distribution):
    best = np.nan_to_num(distribution.quantile(1.0))
    assert 0 <= distribution.mean <= best + 1e-9


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_a_quantile_is_of_a_share_of_the_runs(share):
    with pytest.raises(AnytimeError, match="share of"):
        Distribution(np.array([0.5]), np.array([1.0])).quantile(share)


def test_a_distribution_is_what_its_weights_say():
    distribution = Distribution(np.array([np.nan, 0.5, 1.0]), np.array([0.5, 0.25, 0.25]))
    assert distribution.mean == 0.375
    assert distribution.no_result == 0.5
    assert np.isnan(distribution.quantile(0.5))
    assert [distribution.quantile(share) for share in (0.6, 0.9, 1.0)] == [0.5, 1.0, 1.0]


def test_what_has_no_weight_is_no_quantile():
    assert Distribution(np.array([0.1, 0.5]), np.array([0.0, 1.0])).quantile(0.0) == 0.5
