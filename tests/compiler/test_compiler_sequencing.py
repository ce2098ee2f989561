"""The best sequences of contracts, against all that there are and against doubling."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats

from anytime import AnytimeError
from compiler.curves import Curve
from compiler.deadlines import log_uniform, survival_of
from compiler.sequencing import (
    acceleration_ratio,
    best_sequence,
    doubled,
    expected_quality,
    least_ratio,
    tuned_doubling,
)


@st.composite
def curves(draw, most=7):
    steps = draw(st.lists(st.floats(0.05, 3.0), min_size=1, max_size=most))
    gains = draw(st.lists(st.floats(0.02, 1.0), min_size=len(steps), max_size=len(steps)))
    lengths, rises = np.cumsum(steps), np.cumsum(gains)
    return Curve(lengths, rises / rises[-1])


@st.composite
def interruptions(draw):
    kind = draw(st.sampled_from(["uniform", "exponential", "normal", "observed", "predicted"]))
    scale = draw(st.floats(0.5, 12.0))
    return {
        "uniform": lambda: stats.uniform(0, scale),
        "exponential": lambda: stats.expon(scale=scale),
        "normal": lambda: stats.norm(scale, scale / 8),
        "observed": lambda: draw(st.lists(st.floats(0.1, 20.0), min_size=1, max_size=8)),
        "predicted": lambda: scale,
    }[kind]()


def rising(curve, whole=False):
    """Every rising choice of the curve's lengths; the whole ones reach its last."""
    for count in range(1, len(curve.lengths) + 1):
        for chosen in itertools.combinations(curve.lengths.tolist(), count):
            if not whole or chosen[-1] == curve.lengths[-1]:
                yield chosen


@given(curve=curves(), when=interruptions())
def test_no_sequence_is_better(curve, when):
    survival = survival_of(when)
    best = max(expected_quality(curve, chosen, survival) for chosen in rising(curve))
    assume(best > 1e-9)
    found = expected_quality(curve, best_sequence(curve, survival), survival)
    assert found == pytest.approx(best, abs=1e-9)


@given(curve=curves(), when=interruptions(), ratio=st.floats(1.0, 8.0))
def test_no_sequence_that_keeps_a_ratio_is_better(curve, when, ratio):
    survival = survival_of(when)
    kept = [s for s in rising(curve, whole=True) if acceleration_ratio(curve, s) <= ratio]
    if not kept:
        with pytest.raises(AnytimeError, match="least ratio is"):
            best_sequence(curve, survival, ratio)
        return
    best = max(expected_quality(curve, chosen, survival) for chosen in kept)
    assume(best > 1e-9)
    found = best_sequence(curve, survival, ratio)
    assert acceleration_ratio(curve, found) <= ratio * (1 + 1e-9)
    assert expected_quality(curve, found, survival) == pytest.approx(best, abs=1e-9)


@given(curve=curves())
def test_the_least_ratio_is_that_of_some_sequence_and_of_none_less(curve):
    ratios = [acceleration_ratio(curve, chosen) for chosen in rising(curve, whole=True)]
    assert least_ratio(curve) == pytest.approx(min(ratios))


@given(curve=curves(most=30))
def test_four_is_always_possible_and_doubling_keeps_it(curve):
    assert least_ratio(curve) <= 4
    assert acceleration_ratio(curve, doubled(curve, float(curve.lengths[0]))) <= 4 + 1e-9
    best_sequence(curve, log_uniform(curve), 4.0)


@given(curve=curves(most=30), when=interruptions())
def test_it_is_at_least_as_good_as_doubling_from_any_length(curve, when):
    survival = survival_of(when)
    tuned = expected_quality(curve, tuned_doubling(curve, survival), survival)
    for first in np.geomspace(curve.lengths[0], 2 * curve.lengths[-1], 25):
        assert expected_quality(curve, doubled(curve, float(first)), survival) <= tuned + 1e-9
    if tuned > 1e-9:
        best = expected_quality(curve, best_sequence(curve, survival), survival)
        assert best >= tuned - 1e-9


@settings(max_examples=30)
@given(curve=curves(most=20), when=interruptions())
def test_what_is_expected_is_the_mean_over_interruptions(curve, when):
    lengths = doubled(curve, float(curve.lengths[0]))
    if isinstance(when, float | list):
        times = np.atleast_1d(when)
    else:
        times = when.ppf((np.arange(4000) + 0.5) / 4000)
    done = np.searchsorted(np.cumsum(lengths), times * (1 + 1e-12), side="right")
    reached = np.concatenate([[0.0], np.maximum.accumulate(curve.quality(np.array(lengths)))])
    expected = expected_quality(curve, lengths, survival_of(when))
    assert expected == pytest.approx(reached[done].mean(), abs=1e-3)


@given(curve=curves(most=20))
def test_a_ratio_is_that_of_the_worst_moment(curve):
    """Looked for at every moment: just before a contract is done it is approached."""
    lengths = doubled(curve, float(curve.lengths[0]))
    ends = np.cumsum(lengths)
    worst = 0.0
    for moment in [*(ends * (1 - 1e-9)), *np.linspace(0, ends[-1], 200)]:
        done = [length for length, end in zip(lengths, ends, strict=True) if end <= moment]
        level = np.searchsorted(curve.lengths, max(done, default=0.0) * (1 + 1e-12), side="right")
        if level < len(curve.lengths):  # a contract of less than this is not ahead of it
            worst = max(worst, moment / curve.lengths[level])
    assert acceleration_ratio(curve, lengths) == pytest.approx(worst, rel=1e-6)


@pytest.mark.parametrize("robustness", [4.0, 5.0, 8.0])
@pytest.mark.parametrize("at", [30.0, 100.0, 700.0])
def test_a_good_prediction_brings_what_theory_says(robustness, at):
    """[AK21]: at the predicted time t a contract of t (r + √(r² − 4r)) / 2r is done."""
    curve = Curve(np.geomspace(1, 1000, 120), np.arange(1, 121) / 120)
    lengths = np.array(best_sequence(curve, survival_of(at), robustness))
    longest = lengths[np.cumsum(lengths) <= at * (1 + 1e-9)].max()
    share = (robustness + math.sqrt(robustness**2 - 4 * robustness)) / (2 * robustness)
    grain = curve.lengths[1] / curve.lengths[0]
    assert longest * grain >= at * share
    assert acceleration_ratio(curve, tuple(lengths)) <= robustness * (1 + 1e-9)


def test_where_no_interruption_is_expected_any_more_it_doubles():
    curve = Curve(np.array([1.0, 2, 4, 8, 16, 32]), np.arange(1, 7) / 6)
    assert best_sequence(curve, survival_of(4.5)) == (4.0, 8.0, 16.0, 32.0)


def test_an_interruption_that_always_comes_too_early_leaves_nothing_to_do():
    curve = Curve(np.array([3.0]), np.array([0.7]))
    with pytest.raises(AnytimeError, match="before the first result, which takes 3 s"):
        best_sequence(curve, survival_of(2.0))


def test_a_profile_of_one_step_needs_one_contract():
    curve = Curve(np.array([3.0]), np.array([0.7]))
    assert best_sequence(curve, log_uniform(curve), 4.0) == (3.0,)
    assert least_ratio(curve) == 1.0


def test_a_sequence_that_never_reaches_the_best_has_no_ratio():
    curve = Curve(np.array([1.0, 2.0]), np.array([0.5, 1.0]))
    assert acceleration_ratio(curve, (1.0,)) == math.inf


def test_a_ratio_that_nothing_keeps_is_refused_and_the_least_is_named():
    curve = Curve(np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.6, 1.0]))
    with pytest.raises(AnytimeError, match=r"the least ratio is 2$"):
        best_sequence(curve, log_uniform(curve), 1.2)


@given(steps=st.lists(st.floats(0.05, 3.0), min_size=2, max_size=20))
def test_where_only_some_lengths_were_measured_the_ratio_counts_lengths_alone(steps):
    """What lies between them may be as good as the next: time over the longest that is done."""
    lengths = np.cumsum(steps)
    curve = Curve(lengths, np.arange(1, len(steps) + 1) / len(steps), sampled=True)
    sequence = doubled(curve, float(lengths[0]))
    known = lengths[np.searchsorted(lengths, np.array(sequence) * (1 + 1e-12), side="right") - 1]
    rises = np.flatnonzero(np.diff(np.maximum.accumulate(known), prepend=0.0) > 0)
    longest = np.concatenate([known[:1], np.maximum.accumulate(known)[:-1]])
    until = int(rises[-1]) + 1  # once it has the best, nothing is behind any more
    worst = (np.cumsum(sequence) / longest)[:until].max()
    assert acceleration_ratio(curve, sequence) == pytest.approx(worst)
    assert acceleration_ratio(curve, sequence) >= least_ratio(curve) - 1e-9
