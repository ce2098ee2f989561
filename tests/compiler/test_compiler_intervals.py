"""Intervals cover as often as they say, for skewed qualities and few problems too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import beta

from compiler.intervals import bootstrap_means, mean_interval

DISTRIBUTIONS = {
    "even": (lambda rng, shape: rng.random(shape), 0.5),
    "rarely nothing": (lambda rng, shape: 0.9 * (rng.random(shape) > 0.06), 0.9 * 0.94),
    "nearly always good": (lambda rng, shape: rng.beta(20, 1, shape), 20 / 21),
    "all or nothing": (lambda rng, shape: (rng.random(shape) < 0.3).astype(float), 0.3),
}


@pytest.mark.parametrize("name", DISTRIBUTIONS)
@pytest.mark.parametrize("count", [8, 30])
def test_intervals_cover_the_mean_of_any_distribution(name, count):
    draw, mean = DISTRIBUTIONS[name]
    low, high = mean_interval(draw(np.random.default_rng(0), (count, 1500)))
    assert ((low <= mean) & (mean <= high)).mean() >= 0.94


def test_the_interval_of_a_share_is_clopper_and_pearsons():
    for held in (0, 3, 20):
        low, high = mean_interval((np.arange(20) < held).astype(float)[:, None])
        assert high[0] == pytest.approx(
            beta.ppf(0.975, held + 1, 20 - held) if held < 20 else 1, abs=0.02
        )
        assert low[0] == pytest.approx(beta.ppf(0.025, held, 21 - held) if held else 0, abs=0.02)


@given(arrays(float, st.tuples(st.integers(1, 12), st.integers(1, 3)), elements=st.floats(0, 1)))
def test_an_interval_holds_its_mean_and_lies_between_0_and_1(values):
    low, high = mean_interval(values)
    mean = values.mean(axis=0)
    assert ((low >= 0) & (low <= mean) & (mean <= high + 1e-12) & (high <= 1)).all()


def test_more_problems_make_it_narrower():
    values = np.random.default_rng(0).random((400, 1))
    widths = [np.subtract(*mean_interval(values[:n])[::-1])[0] for n in (5, 20, 100, 400)]
    assert widths == sorted(widths, reverse=True)


def test_bootstrap_means_spread_as_the_standard_error_says():
    values = np.random.default_rng(0).normal(0.1, 0.2, (200, 1))
    assert bootstrap_means(values).std() == pytest.approx(values.std() / np.sqrt(200), rel=0.1)
