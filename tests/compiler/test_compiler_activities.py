"""Activities: memory from call to call, drift, time divided anew."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
import compiler
from anytime import AnytimeError, Machine, WorkClock

MACHINE = Machine("m").with_rate("look", 0.01).with_rate("plan", 0.01)
SLOWED = Machine("slowed").with_rate("look", 0.02).with_rate("plan", 0.01)


@dataclass
class Scene:
    image: float


@anytime.module(quality=lambda seen: seen)
def look(image):
    for step in range(1, 7):
        anytime.charge(1)
        yield image * step / 6


@anytime.module(quality=lambda plan: plan)
def plan(seen, *, memory):
    best = memory.get("best", 0.0)
    if best:
        yield best
    for step in range(1, 9):
        anytime.charge(1)
        best = max(best, seen * step / 8)
        memory["best"] = best
        yield best


@compiler.program
def steer(image):
    return plan(look(image))


def compiled():
    scenes = [Scene(float(image)) for image in np.linspace(0.7, 1.0, 6)]
    library = anytime.measure(steer, scenes, seconds=1.0, clock=lambda: WorkClock(MACHINE))
    return compiler.compile(steer, library)


STEER = compiled()


def test_what_a_module_remembers_it_has_at_once_in_the_next_call():
    with STEER.start(clock=WorkClock(MACHINE)) as activity:
        first = activity.run(0.2, image=0.9)
        second = activity.run(0.2, image=0.1)
    assert first.value > 0.5
    assert second.value >= first.value  # kept, though nothing as good is seen now
    assert STEER.run(0.2, clock=WorkClock(MACHINE), image=0.1).value < 0.2


def test_two_activities_share_no_memory():
    one, other = (STEER.start(clock=WorkClock(MACHINE)) for _ in range(2))
    assert one.run(0.2, image=1.0).value > 0.5
    assert other.run(0.2, image=0.1).value < 0.2


def test_as_long_as_steps_take_what_they_took_nothing_is_divided_anew():
    activity = STEER.start(clock=WorkClock(MACHINE))
    for _ in range(20):
        activity.run(0.12, image=1.0)
    assert activity.program is STEER
    assert not activity.drift
    assert activity.why == "divided as compiled"


def test_a_module_of_more_results_than_a_recording_keeps_takes_what_it_took():
    @anytime.module(quality=lambda seen: seen, name="look")
    def often(image):
        for step in range(1, 301):
            yield image * step / 300

    @compiler.program
    def steer(image):
        return plan(often(image))

    machine = MACHINE.with_rate("look", 0.0002)
    scenes = [Scene(float(image)) for image in np.linspace(0.7, 1.0, 6)]
    library = anytime.measure(steer, scenes, seconds=1.0, clock=lambda: WorkClock(machine))
    with compiler.compile(steer, library).start(clock=WorkClock(machine)) as activity:
        for _ in range(6):
            activity.run(0.1, image=0.9)
        assert not activity.drift
        assert activity.ratios["look"] == pytest.approx(1.0, abs=0.05)


def test_steps_that_grow_are_no_faster_machine():
    @anytime.module(quality=lambda seen: seen, name="look")
    def growing(image):
        for step in range(1, 101):
            anytime.charge(step)
            yield image * step / 100

    machine = MACHINE.with_rate("look", 0.0001)
    scenes = [Scene(float(image)) for image in np.linspace(0.7, 1.0, 6)]
    library = anytime.measure(growing, scenes, seconds=1.0, clock=lambda: WorkClock(machine))
    with compiler.compile(growing, library).start(clock=WorkClock(machine)) as activity:
        for _ in range(20):
            activity.run(0.15, image=0.9)
        assert not activity.drift


def test_a_module_that_has_become_slower_is_noticed_and_time_divided_anew():
    activity = STEER.start(clock=WorkClock(SLOWED))
    for _ in range(30):
        activity.run(0.2, image=1.0)
    assert activity.drift["look"] == pytest.approx(2.0, rel=0.1)
    assert "plan" not in activity.drift
    assert "look takes" in activity.why
    assert activity.program.least > STEER.least
    assert activity.program.promise(0.1) < STEER.promise(0.1)


def test_a_module_that_is_itself_again_gets_its_old_share():
    slow, usual = WorkClock(SLOWED), WorkClock(MACHINE)
    activity = STEER.start(clock=slow)
    for _ in range(30):
        activity.run(0.2, image=1.0)
    activity._clock = usual
    for _ in range(60):
        activity.run(0.2, image=1.0)
    assert not activity.drift
    assert activity.program is STEER


def test_a_closed_activity_refuses_in_one_line():
    activity = STEER.start(clock=WorkClock(MACHINE))
    activity.close()
    with pytest.raises(AnytimeError, match="activity of 'steer' is closed; start another"):
        activity.run(0.2, image=1.0)


def test_it_says_how_things_stand():
    activity = STEER.start(clock=WorkClock(MACHINE))
    activity.run(0.2, image=1.0)
    assert repr(activity) == "<activity of steer, 1 calls: divided as compiled>"


def test_a_machine_that_was_too_slow_for_the_budget_is_tried_again():
    @anytime.module(quality=lambda value, problem: value, name="thirds")
    def thirds(x):
        for step in (1, 2, 3):
            anytime.charge(1)
            yield x * step / 3

    def machine(rate):
        return Machine("m").with_rate("thirds", rate)

    problems = [SimpleNamespace(x=0.1 * i) for i in range(5, 11)]
    library = anytime.measure(thirds, problems, seconds=1.0, clock=lambda: WorkClock(machine(0.01)))
    clock = WorkClock(machine(0.03))
    with compiler.compile(thirds, library).start(clock=clock) as activity:
        hot = [bool(activity.run(0.025, x=1.0)) for _ in range(100)]
        clock.machine = machine(0.01)
        cool = [activity.run(0.025, x=1.0).value for _ in range(100)]
        assert hot.count(True) < 30  # now and then it is tried
        assert cool[-50:] == [pytest.approx(2 / 3)] * 50
        assert not activity.drift


def test_problems_of_another_kind_are_not_another_machine():
    @anytime.module(quality=lambda value, problem: value, name="varied")
    def varied(x):
        count, each = (3, 6) if x < 0.75 else (12, 1)
        for step in range(count):
            anytime.charge(each)
            yield x * (step + 1) / count

    def clock(rate=0.004):
        return WorkClock(Machine("m").with_rate("varied", rate))

    problems = [SimpleNamespace(x=i / 10) for i in range(5, 11)]
    schedule = compiler.compile(varied, anytime.measure(varied, problems, seconds=1.0, clock=clock))
    for x in (0.5, 1.0):
        with schedule.start(clock=clock()) as activity:
            for _ in range(60):
                activity.run(0.08, x=x)
            assert not activity.drift
        with schedule.start(clock=clock(0.016)) as activity:
            for _ in range(60):
                activity.run(0.3, x=x)
            assert activity.drift
