"""The table of a call, as the division sees it."""

from types import SimpleNamespace

import pytest

import anytime
import compiler
from anytime import Machine, WorkClock

MACHINE = Machine("test").with_rate("look", 0.01).with_rate("plan", 0.01)


@anytime.module(quality=lambda seen: seen)
def look(start):
    for seen in 0.2, 0.3, 0.4, 1.0:
        anytime.charge(1)
        yield seen


@anytime.module(quality=lambda plan: plan)
def plan(seen):
    for _ in range(10):
        anytime.charge(1)
        yield seen if seen > 0.9 else None


@compiler.program
def navigate(start):
    return plan(look(start))


def test_inputs_that_never_give_a_result_do_not_take_the_time_of_those_that_do():
    problems = [SimpleNamespace(name=f"p{i}", start=i) for i in range(10)]
    clock = lambda: WorkClock(MACHINE)  # noqa: E731
    library = anytime.measure(navigate, problems, seconds=1.0, clock=clock)
    schedule = compiler.compile(navigate, library)
    assert schedule.tables[1].first == pytest.approx(0.01)
    assert schedule.promise(0.06) == pytest.approx(1.0)
    assert schedule.run(0.06, clock=clock(), start=0).value == 1.0
