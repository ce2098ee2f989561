"""A conformance kit for robots: plain functions that raise one clear line.

For whoever brings a body: call them from any test, or use the fixture of `monitor.fixtures`.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from anytime.clocks import is_number
from anytime.errors import AnytimeError
from anytime.testing import ConformanceError
from monitor.bodies import Robot, must_be_whole
from monitor.states import Situation, checked, loggable

Make = Callable[[], Robot]
Plan = Callable[[Mapping[str, Any]], Any]

TICK = 1e-9  # seconds that count as none, of a clock that is computed
READ = 0.05  # seconds that reading a robot may take in real time


class Check(Protocol):
    """One check: raises ConformanceError."""

    __name__: str

    def __call__(self, make: Make, plan: Plan, *, speed: float) -> None: ...


def conforms(make: Make, plan: Plan, *, speed: float) -> None:
    """Raise at the first of all checks that the robot fails.

    make: a function that makes a fresh robot, the same each time. plan: a function of its
    `inputs()` that returns a plan as the program would, one that takes a while to execute. speed:
    one that it can go.
    """
    for check in CHECKS:
        check(make, plan, speed=speed)


def tells_what_can_be(make: Make, plan: Plan, *, speed: float) -> None:
    """Has it all that a robot has, and is what it tells of itself of the right kinds?"""
    robot = make()
    try:
        must_be_whole(robot)
        checked(robot.situation())
        loggable(robot.story())
    except AnytimeError as error:
        raise ConformanceError(str(error)) from None
    for name in ("inputs", "picture"):
        told = getattr(robot, name)()
        if not isinstance(told, Mapping):
            raise ConformanceError(f"{name}() gives {told!r}; give a dict")
    moved: Any = robot.driven()
    if not is_number(moved):
        raise ConformanceError(f"driven() gives {moved!r}; give seconds")


def starts_standing(make: Make, plan: Plan, *, speed: float) -> None:
    """Is a fresh robot ready, at rest and not at its end?"""
    robot = make()
    if robot.driven() != 0:
        raise ConformanceError(f"a fresh robot has driven {robot.driven():g} s; it must be 0")
    ending = robot.situation().ending
    if ending is not None:
        raise ConformanceError(f"a fresh robot has ended already: {ending.name}")


def reading_changes_nothing(make: Make, plan: Plan, *, speed: float) -> None:
    """Do `inputs`, `situation`, `story`, `picture` and `driven` take no time and change nothing,
    while it stands and while it moves?"""
    robot = make()
    _reads_alike(robot, "standing")
    robot.begin(plan(robot.inputs()), speed)
    _reads_alike(robot, "moving")


def _reads_alike(robot: Robot, how: str) -> None:
    before, seen = robot.clock.now(), robot.situation()
    for name in ("inputs", "situation", "story", "picture", "driven"):
        getattr(robot, name)()
        passed = robot.clock.now() - before
        if passed > _no_time(robot):
            raise ConformanceError(
                f"{name}() of a robot {how} lets {passed:.3g} s pass; only complete and work may"
            )
    if _computed(robot) and robot.situation() != seen:
        raise ConformanceError(
            f"a robot {how} was asked twice at one moment and told {seen}, then "
            f"{robot.situation()}; asking must change nothing"
        )


def orders_take_no_time(make: Make, plan: Plan, *, speed: float) -> None:
    """Do `begin`, `change_speed`, `learn` and `stop` return at once?"""
    robot = make()
    way = plan(robot.inputs())
    orders: dict[str, Callable[[], None]] = {
        "begin": lambda: robot.begin(way, speed),
        "change_speed": lambda: robot.change_speed(speed),
        "learn": lambda: robot.learn(way),
        "stop": robot.stop,
    }
    for name, order in orders.items():
        before = robot.clock.now()
        order()
        passed = robot.clock.now() - before
        if passed > _no_time(robot):
            raise ConformanceError(
                f"{name}() lets {passed:.3g} s pass; it must not wait for the robot"
            )


def moves_with_the_clock(make: Make, plan: Plan, *, speed: float) -> None:
    """Does it move while whoever thinks lets time pass, and not more than that time?"""
    robot = make()
    whole = _time_of(make, plan, speed)
    began = robot.clock.now()
    robot.begin(plan(robot.inputs()), speed)
    robot.clock.advance(whole / 2)
    moved, passed = robot.driven(), robot.clock.now() - began
    if moved <= 0:
        raise ConformanceError(
            f"{passed:.3g} s after begin the robot has not moved; it lives on its clock, so bring "
            "it up to now whatever it is asked"
        )
    if moved > passed + _no_time(robot):
        raise ConformanceError(f"driven() says {moved:.3g} s of motion in {passed:.3g} s")


def completes(make: Make, plan: Plan, *, speed: float) -> None:
    """Does `complete` end the plan, so that a second one takes no time, and does energy only
    ever grow?"""
    robot = make()
    before = robot.situation().energy
    robot.begin(plan(robot.inputs()), speed)
    robot.complete()
    there = robot.clock.now()
    after = robot.situation()
    if after.energy < before:
        raise ConformanceError(f"energy fell from {before:g} to {after.energy:g}; it is used up")
    robot.complete()
    again = robot.clock.now() - there
    if again > _no_time(robot):
        raise ConformanceError(f"complete() of a plan that is done takes {again:.3g} s again")


def stops(make: Make, plan: Plan, *, speed: float) -> None:
    """Does it stand still once it is told to, and may it be told so at any time?"""
    robot = make()
    whole = _time_of(make, plan, speed)
    robot.stop()
    robot.begin(plan(robot.inputs()), speed)
    robot.clock.advance(whole / 3)
    robot.stop()
    moved = robot.driven()
    robot.clock.advance(whole / 3)
    further = robot.driven() - moved
    if further > (TICK if _computed(robot) else whole / 6):
        raise ConformanceError(f"the robot drives on for {further:.3g} s after stop()")
    robot.stop()


def repeats(make: Make, plan: Plan, *, speed: float) -> None:
    """Do two fresh robots live the same, so that a mission can be lived again?"""
    first, second = _lived(make, plan, speed), _lived(make, plan, speed)
    if first is not None and first != second:
        raise ConformanceError(
            f"two fresh robots end differently: {first} and {second}; draw from a seeded "
            "generator that belongs to the robot"
        )


CHECKS: tuple[Check, ...] = (
    tells_what_can_be,
    starts_standing,
    reading_changes_nothing,
    orders_take_no_time,
    moves_with_the_clock,
    completes,
    stops,
    repeats,
)
"""All checks, the simplest first."""


def _computed(robot: Robot) -> bool:
    """Whether its clock stands while nobody lets time pass on it."""
    return robot.clock.now() == robot.clock.now()


def _no_time(robot: Robot) -> float:
    return TICK if _computed(robot) else READ


def _time_of(make: Make, plan: Plan, speed: float) -> float:
    """Seconds that the plan takes a fresh robot."""
    robot = make()
    began = robot.clock.now()
    robot.begin(plan(robot.inputs()), speed)
    robot.complete()
    took = robot.clock.now() - began
    if took <= 0:
        raise ConformanceError(
            "complete() of a plan takes no time; give a plan that takes a while, or let it pass"
        )
    return took


def _lived(make: Make, plan: Plan, speed: float) -> tuple[float, Situation] | None:
    robot = make()
    if not _computed(robot):
        return None  # in real time nothing repeats
    robot.begin(plan(copy.deepcopy(robot.inputs())), speed)
    robot.complete()
    return robot.clock.now(), robot.situation()
