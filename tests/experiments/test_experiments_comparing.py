"""Comparisons are paired on common seeds."""

import numpy as np
import pytest

from experiments.comparing import bootstrap, margins, share_of_first


def test_a_constant_difference_has_an_interval_of_no_width_although_seeds_differ():
    seeds = np.random.default_rng(0).normal(100, 30, size=200)
    found = bootstrap([seeds + 5, seeds], lambda a, b: a - b)
    assert found.value == pytest.approx(5)
    assert found.high - found.low == pytest.approx(0, abs=1e-9)


def test_the_margin_is_over_the_better_of_min_and_max():
    nets = {
        "monitored": np.full(10, 80.0),
        "min": np.full(10, 60.0),
        "max": np.full(10, 40.0),
        "fixed": np.full(10, 72.0),
    }
    found = margins(nets)
    assert found["value.margin"] == pytest.approx(0.25)
    assert found["value.margin_fixed"] == pytest.approx(0.1)
    assert found["value.worse_loses"] == pytest.approx(0.5)
    assert share_of_first(0.0, 1.0) == 0.0
