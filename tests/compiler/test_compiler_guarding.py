"""The deadline guard: which steps are still worth starting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
from anytime import Deadline, Machine, Profile, WorkClock
from anytime.profiles import Recording
from anytime.running import execute
from compiler.guarding import STEPS, Steps, guard, steps_of

MACHINE = Machine("m").with_rate("see", 1.0)
STEADY = Steps((1.0, 2.0, 4.0), (1.5, 3.0, 6.0))


def recorded(*rows):
    return Profile(
        "see",
        (),
        tuple(
            Recording(
                f"p{i}",
                "see",
                {},
                {},
                np.array(row, dtype=float),
                np.array(row, dtype=float),
                np.full(len(row), 0.5),
                np.full(len(row), np.nan),
                (max(row, default=0.0), max(row, default=0.0)),
                True,
            )
            for i, row in enumerate(rows)
        ),
    )


def results(may_step, work=(1, 2, 4, 8, 16), hard=1e9):
    """How many results a ladder of these steps registers under a guard."""

    @anytime.module(name="see")
    def see():
        for units in work:
            anytime.charge(units)
            yield units

    result, _ = execute(see, (), Deadline(WorkClock(MACHINE), hard), may_step=may_step)
    return len(result.history)


def test_steps_are_the_gaps_between_results():
    steps = steps_of(recorded([1, 3, 7], [1, 5, 9], [3, 4]))
    assert steps.median == pytest.approx((1.0, 2.0, 4.0))
    assert steps.p95[0] == pytest.approx(np.quantile([1, 1, 3], 0.95))


@given(st.lists(st.lists(st.floats(0, 5), max_size=50), min_size=1, max_size=6))
def test_late_steps_share_the_last_place_and_the_tail_is_never_below_the_median(gaps):
    steps = steps_of(recorded(*[np.cumsum(row) for row in gaps]))
    assert len(steps.median) == len(steps.p95) == min(max(map(len, gaps)), STEPS)
    assert all(p95 >= median for median, p95 in zip(steps.median, steps.p95, strict=True))
    assert all(median >= 0 for median in steps.median)


def test_without_a_profile_there_is_no_guard():
    assert guard(None, 1.0, 2.0) is None
    assert guard(Steps((), ()), 1.0, 2.0) is None


def test_the_median_of_the_next_step_is_held_against_the_share():
    assert results(guard(STEADY, share_ends=3.0, hard_end=100.0)) == 2
    assert results(guard(STEADY, share_ends=2.9, hard_end=100.0)) == 1
    assert results(guard(STEADY, share_ends=7.0, hard_end=100.0)) == 3


def test_its_tail_is_held_against_the_end_that_is_hard():
    assert results(guard(STEADY, share_ends=50.0, hard_end=9.0)) == 3
    assert results(guard(STEADY, share_ends=50.0, hard_end=8.9)) == 2
    assert results(guard(STEADY, share_ends=50.0, hard_end=3.9)) == 1


def test_the_first_result_is_never_refused_before_the_hard_end():
    assert results(guard(STEADY, share_ends=0.0, hard_end=0.5)) == 1
    assert results(guard(STEADY, share_ends=0.0, hard_end=0.0)) == 0


@given(st.floats(0, 40), st.floats(0, 40))
def test_more_time_never_means_fewer_steps(share, more):
    few = results(guard(STEADY, share, 100.0))
    assert results(guard(STEADY, share + more, 100.0)) >= few
