"""The rover's thirteen modules: each is anytime, and the program runs within its budget."""

from __future__ import annotations

import numpy as np
import pytest

import anytime
from anytime import WorkClock
from compiler import compile
from experiments.rover import MACHINE, turn, turns


@pytest.fixture(scope="module")
def library():
    return anytime.measure(turn, turns(6), seconds=0.5, clock=lambda: WorkClock(MACHINE))


def test_thirteen_modules_improve_with_time(library):
    assert len(library) == len(turn.calls) == 13
    gains = {
        name: float(np.diff(profile.mean([profile.time_to(0.0), profile.times[-1]]))[0])
        for name, profile in library.items()
    }
    # On the best inputs some have little left to do: they are there for the bad ones.
    assert sum(gain > 0.01 for gain in gains.values()) >= 10, gains


def test_turns_are_the_same_for_the_same_seed_and_have_room_at_both_ends():
    for one, other in zip(turns(5, 3), turns(5, 3), strict=True):
        assert one.sensors.light.tobytes() == other.sensors.light.tobytes()
        assert not one.blocked[one.start]
        assert not one.blocked[one.goal]
    assert len({turn.clutter for turn in turns(5, 3)}) > 1


@pytest.mark.slow
def test_it_is_compiled_and_keeps_its_promises():
    known = anytime.measure(turn, turns(30), seconds=0.5, clock=lambda: WorkClock(MACHINE))
    compiled = compile(turn, known)
    found = compiled.validate(turns(30, 9), clock=lambda: WorkClock(MACHINE))
    assert found.rows[-1].achieved > found.rows[0].achieved
    assert sum(row.holds for row in found.rows) >= len(found.rows) - 1
    advice = compiled.advise(float(np.mean([row.seconds for row in found.rows])))
    assert len(advice.changes) == 39
