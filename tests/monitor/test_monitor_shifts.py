"""Shifts: a module against itself before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError, Machine, ProfileLibrary
from anytime.profiles import Profile
from anytime.programs import program_of
from anytime.recordings import Recording
from compiler import compile
from monitor.shifts import GROUPS, SAME, shifts_of_libraries, shifts_of_schedules
from sensing.vision import see

PROGRAM = program_of(see)


def recording(problem, pace, best=0.9):
    work = np.arange(1.0, 21.0)
    quality = best * (1 - np.exp(-work / 6))
    unknown = np.full(len(work), np.nan)
    return Recording(
        problem, "see", {}, {}, pace * work, work, quality, unknown, (20 * pace, 20.0), True
    )


def library(paces, best=0.9, machine="lab"):
    runs = tuple(recording(f"p{index}", pace, best) for index, pace in enumerate(paces))
    return ProfileLibrary(profiles={"see": Profile("see", (), runs)}, machine=Machine(machine))


def shift(before, after):
    return shifts_of_libraries(PROGRAM, before, after).all["see"]


def test_nothing_changed_is_the_same_whatever_is_left_out():
    found = shifts_of_libraries(PROGRAM, library([1.0] * 20), library([1.0] * 20))
    assert [found.all["see"], *(found.without(out)["see"] for out in range(GROUPS))] == [SAME] * 13


@settings(max_examples=15, deadline=None)
@given(st.floats(0.2, 5.0), st.floats(0.5, 1.0))
def test_a_module_that_is_slower_and_worse_is_told_by_how_much(slower, worse):
    found = shift(
        library([1.0, 1.3, 0.8]), library(slower * np.array([1.0, 1.3, 0.8]), 0.9 * worse)
    )
    assert found.slower == pytest.approx(slower)
    assert found.quality == pytest.approx(worse)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0.5, 2.0), min_size=4, max_size=4), st.floats(0.4, 1.0))
def test_neither_side_is_favoured(paces, best):
    one, other = library([1.0, 1.3, 0.8, 1.1]), library(paces, best)
    there, back = shift(one, other), shift(other, one)
    assert there.slower * back.slower == pytest.approx(1.0)
    assert there.quality * back.quality == pytest.approx(1.0)


def test_between_machines_of_different_names_work_is_compared():
    assert shift(library([1.0] * 5), library([7.0] * 5, machine="robot")) == SAME


def test_a_module_does_not_answer_for_what_feeds_it():
    """The input is worse, and so are the results on it; on equal inputs they are as before."""

    def fed(qualities):
        runs = [
            replace(recording(f"p{index}", 1.0, quality), inputs={"sensor": quality})
            for index in range(6)
            for quality in qualities
        ]
        profile = Profile("see", ("sensor",), tuple(runs))
        return ProfileLibrary(profiles={"see": profile}, machine=Machine("lab"))

    assert shift(fed([0.6, 0.8]), fed([0.5, 0.7, 0.9])).quality == pytest.approx(1.0, abs=0.02)


def test_compiled_programs_tell_their_shift_without_problems():
    one, other = (compile(PROGRAM, library([pace] * 8)) for pace in (1.0, 1.5))
    found = shifts_of_schedules(one, other)
    assert found.without(3) == found.all
    assert found.all["see"].slower == pytest.approx(1.5)


def test_a_library_without_the_module_is_refused():
    with pytest.raises(
        AnytimeError, match=r"the library after has no profile of 'see'; it has none"
    ):
        shifts_of_libraries(PROGRAM, library([1.0]), ProfileLibrary())
