"""The deadline guard: which steps are still worth starting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
from anytime import Deadline, Machine, Profile, WorkClock
from anytime.recordings import Recording
from anytime.running import execute
from compiler.guarding import STEPS, Steps, guard, last_guard, steps_of

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


def test_results_that_a_recording_left_out_count_as_evenly_spread():
    whole = recorded(np.arange(1, 201))
    thinned = whole.recordings[0]
    kept = np.unique(np.linspace(0, 199, 20).round().astype(int))
    few = replace(
        whole,
        recordings=(
            replace(
                thinned,
                seconds=thinned.seconds[kept],
                work=thinned.work[kept],
                raw=thinned.raw[kept],
                estimates=thinned.estimates[kept],
                results=200,
            ),
        ),
    )
    assert steps_of(few).median == pytest.approx(steps_of(whole).median)


def test_a_step_without_a_result_is_part_of_the_next():
    @anytime.module(name="see")
    def now_and_then():
        for value in (0.5, None, 1.0):
            anytime.charge(1)
            yield value

    steps = steps_of(recorded([1, 3]))
    result, _ = execute(
        now_and_then, (), Deadline(WorkClock(MACHINE), 3.0), may_step=last_guard(steps, 3.0)
    )
    assert result.value == 1.0


def test_the_last_step_of_a_run_may_find_that_nothing_is_left_to_do():
    run = recorded([1, 2])
    ended = replace(run, recordings=(replace(run.recordings[0], end=(6.0, 6.0)),))
    assert steps_of(ended).median == pytest.approx((1.0, 1.0, 4.0))


def test_a_last_call_that_can_be_ended_between_results_is_not_held_to_them():
    searched = recorded([1, 6], [1, 7])
    some = (replace(run, steps=12) for run in searched.recordings)
    steps = steps_of(replace(searched, recordings=tuple(some)))
    assert not steps.whole
    assert last_guard(steps, 3.0) is None
    assert last_guard(steps_of(searched), 3.0) is not None


def test_without_a_profile_there_is_no_guard():
    for unknown in (None, Steps((), ())):
        assert guard(unknown, 1.0, 2.0) is None
        assert last_guard(unknown, 1.0) is None


def test_the_last_call_begins_no_step_that_is_known_to_be_too_long():
    ladder = Steps((1.0, 2.0, 4.0, 8.0), (1.5, 3.0, 6.0, 12.0))
    for ends, count in ((1.0, 1), (3.9, 1), (4.0, 2), (8.9, 2), (9.0, 3), (18.9, 3), (19.0, 4)):
        assert results(last_guard(ladder, ends), hard=ends) == count


def test_steps_may_take_longer_for_who_has_been_slower_than_nearly_all():
    slow = (3, 6, 12)  # twice as long as the longest usual steps
    assert results(last_guard(STEADY, 8.9), slow, hard=8.9) == 1
    assert results(last_guard(STEADY, 9.0), slow, hard=9.0) == 2


def test_beyond_the_steps_that_are_known_it_goes_by_those_of_the_run():
    assert results(last_guard(Steps((1.0,), (1.0,)), 10.0), (1,) * 20, hard=10.0) == 10


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
