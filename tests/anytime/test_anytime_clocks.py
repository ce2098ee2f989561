"""Clocks and deadlines upon them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError, Deadline, Machine, WallClock, WorkClock

MACHINE = Machine("m").with_rate("see", 0.25)


def test_a_work_clock_stands_until_somebody_works_or_waits():
    clock = WorkClock(MACHINE)
    assert [clock.now(), clock.now()] == [0, 0]
    clock.spend("see", 8, None)
    clock.advance(1)
    assert clock.now() == 3


def test_work_of_an_unknown_module_is_refused_and_no_work_is_free():
    clock = WorkClock(MACHINE)
    clock.spend("unheard", 0, None)
    assert clock.now() == 0
    with pytest.raises(AnytimeError, match=r"no rate for module 'unheard' \(known: see\)"):
        clock.spend("unheard", 1, None)


@pytest.mark.parametrize("seconds", [-1.0, math.nan, math.inf])
def test_time_goes_forward_by_finite_amounts(seconds):
    with pytest.raises(AnytimeError, match="finite number >= 0"):
        WorkClock(MACHINE).advance(seconds)


def test_a_wall_clock_never_goes_back_and_all_are_one():
    clock = WallClock()
    before = clock.now()
    clock.spend("anything", 10, None)
    clock.advance(-1)
    assert WallClock().now() >= before
    assert WallClock() == clock


@given(spent=st.lists(st.floats(0, 100), max_size=20), seconds=st.floats(-100, 1000))
def test_what_remains_falls_as_the_clock_goes(spent, seconds):
    clock = WorkClock(MACHINE)
    deadline = Deadline.after(seconds, clock)
    left = [deadline.remaining()]
    for some in spent:
        clock.advance(some)
        left.append(deadline.remaining())
    assert left == sorted(left, reverse=True)
    assert deadline.expired() == (clock.now() >= deadline.at)


def test_zero_seconds_have_passed_already():
    assert Deadline.after(0, WorkClock(MACHINE)).expired()
    assert Deadline.after(-3, WorkClock(MACHINE)).expired()


def test_no_deadline_never_comes():
    clock = WorkClock(MACHINE)
    never = Deadline(clock)
    clock.advance(1e12)
    assert not never.expired()
    assert never.remaining() == math.inf


@given(first=st.floats(0, 10), second=st.floats(-5, 20))
def test_the_sooner_deadline_is_never_later_than_either(first, second):
    deadline = Deadline.after(first, WorkClock(MACHINE))
    sooner = deadline.sooner(second)
    assert sooner.at == min(first, second)
    assert sooner.clock is deadline.clock


def test_a_deadline_that_is_no_number_is_refused():
    with pytest.raises(AnytimeError, match="seconds is nan"):
        Deadline.after(math.nan)


# Events


def test_an_event_is_a_deadline_that_nobody_can_date():
    pressed = []
    clock = WorkClock(MACHINE)
    deadline = Deadline(clock, event=lambda: bool(pressed))
    assert (deadline.remaining(), deadline.expired()) == (math.inf, False)
    pressed.append("bumper")
    assert (deadline.remaining(), deadline.expired()) == (0.0, True)
    assert deadline.interrupted()


def test_a_deadline_that_has_passed_stays_so_whatever_the_event():
    clock = WorkClock(MACHINE)
    deadline = Deadline(clock, 1.0, event=lambda: True)
    clock.advance(3.0)
    assert deadline.remaining() == -2.0


def test_a_sooner_deadline_hears_of_the_same_event():
    pressed = []
    sooner = Deadline(WorkClock(MACHINE), event=lambda: bool(pressed)).sooner(1.0)
    assert sooner.remaining() == 1.0
    pressed.append("bumper")
    assert sooner.expired()


@given(at=st.floats(0, 9), other_at=st.floats(0, 9), pressed=st.booleans(), heard=st.booleans())
def test_the_earlier_of_two_deadlines_is_over_when_either_is(at, other_at, pressed, heard):
    clock = WorkClock(MACHINE)
    one = Deadline(clock, at, event=lambda: pressed)
    other = Deadline(clock, other_at, event=(lambda: heard) if heard else None)
    clock.advance(4.5)
    both = one.earlier(other)
    assert both.at == min(at, other_at)
    assert both.expired() == (one.expired() or other.expired())


def test_of_a_deadline_on_another_clock_only_the_event_counts():
    one, other = Deadline(WorkClock(MACHINE), 5.0), WorkClock(MACHINE)
    both = one.earlier(Deadline(other, 1.0, event=lambda: True))
    assert both.at == 5.0
    assert both.expired()


def test_a_work_clock_is_that_of_a_machine():
    with pytest.raises(AnytimeError, match="a work clock of 'fast'; give a Machine"):
        WorkClock("fast")
