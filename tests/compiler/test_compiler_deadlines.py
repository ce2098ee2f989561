"""Interruptions: predicted, observed, distributed, or unknown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from anytime import AnytimeError
from compiler.curves import Curve
from compiler.deadlines import log_uniform, survival_of


def test_what_is_done_at_the_predicted_time_is_in_time():
    survival = survival_of(0.2)
    assert survival(np.array([0.0, 0.1, 0.2, 0.2001])).tolist() == [1, 1, 1, 0]


@given(times=st.lists(st.floats(0.01, 9.0), min_size=1, max_size=20), at=st.floats(0, 10))
def test_observed_times_speak_once_each(times, at):
    if min(abs(time - at) for time in times) > 1e-9:
        assert survival_of(times)(np.array([at]))[0] == pytest.approx(
            np.mean([time > at for time in times])
        )


def test_a_distribution_of_scipy_is_taken_as_it_is():
    when = stats.norm(0.2, 0.05)
    times = np.linspace(0, 0.5, 20)
    assert survival_of(when)(times).tolist() == when.sf(times).tolist()


def test_nothing_known_means_that_no_order_of_magnitude_is_likelier():
    curve = Curve(np.array([0.1, 10.0]), np.array([0.5, 1.0]))
    survival = log_uniform(curve)
    still = survival(0.1 * np.array([0.5, 1.0, 400**0.5, 400.0, 1e6]))
    assert still.tolist() == pytest.approx([1, 1, 0.5, 0, 0])


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf"), [], [0.1, -1], "soon"])
def test_times_that_are_none_are_refused(wrong):
    with pytest.raises((AnytimeError, ValueError), match=r"interruption|convert"):
        survival_of(wrong)


def test_a_function_that_rises_is_no_survival_function():
    class Backwards:
        def sf(self, x):
            return 1 - np.exp(-x)

    with pytest.raises(AnytimeError, match="must fall from 1"):
        survival_of(Backwards())
