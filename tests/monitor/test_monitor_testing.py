"""The conformance kit passes our robots and names what another does not keep."""

import itertools

import numpy as np
import pytest

from anytime import Machine, WorkClock
from experiments import crossings
from monitor import Ending, Energy, Situation, testing
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE
from sensing.random_maps import corner_to_corner, uniform
from sensing.vision import Vision

pytest_plugins = ["monitor.fixtures"]

PROGRAM = crossings.compiled()


def grid_robot():
    free = uniform(48, 0.1, np.random.default_rng(3))
    start, goal = corner_to_corner(free)
    scene = Scene(free, start, goal, device=Vision(2, 24))
    return GridRobot(scene, Energy(0.2, 0.08, 0.03, 0.01), WorkClock(REFERENCE))


def planned(inputs):
    return PROGRAM.run(clock=WorkClock(REFERENCE), seconds=3.0, **inputs).value


def test_the_grid_robot_passes(robot_check):
    robot_check(grid_robot, planned, speed=2.0)


class Cart:
    """A robot on a rail that keeps its contract; each of those below breaks it once."""

    def __init__(self):
        self.clock = WorkClock(Machine("rail"))
        self.moved = self.left = 0.0
        self.since = self.clock.now()

    def settle(self):
        now = self.clock.now()
        went = min(now - self.since, self.left)
        self.moved, self.left, self.since = self.moved + went, self.left - went, now

    def inputs(self):
        return {"far": 4.0}

    def situation(self):
        self.settle()
        return Situation(energy=self.moved, to_go=0.0, in_hand=self.left)

    def begin(self, plan, speed):
        self.settle()
        self.left = plan / speed

    def change_speed(self, speed):
        self.settle()

    def learn(self, plan):
        pass

    def complete(self):
        self.settle()
        self.clock.advance(self.left)
        self.settle()

    def work(self, seconds):
        self.clock.advance(seconds)

    def stop(self):
        self.settle()
        self.left = 0.0

    def driven(self):
        self.settle()
        return self.moved

    def story(self):
        return {}

    def picture(self):
        return {}


class TellsNothing(Cart):
    def story(self):
        return None


class KnowsNoEnergy(Cart):
    def situation(self):
        return Situation(float("nan"), 1.0, 1.0)


class SaysHowItEnds(Cart):
    def situation(self):
        return Situation(0.0, 0.0, 0.0, ending="reached")  # pyright: ignore[reportArgumentType]


class EndsAtOnce(Cart):
    def situation(self):
        return Situation(0.0, 0.0, 0.0, ending=Ending.REACHED)


class LooksSlowly(Cart):
    def inputs(self):
        self.clock.advance(0.2)
        return super().inputs()


class WaitsInBegin(Cart):
    def begin(self, plan, speed):
        super().begin(plan, speed)
        self.clock.advance(0.5)


class WaitsForComplete(Cart):
    def settle(self):
        self.since = self.clock.now()

    def complete(self):
        self.clock.advance(self.left)
        self.moved, self.left = self.moved + self.left, 0.0


class CompletesForEver(Cart):
    def complete(self):
        super().complete()
        self.clock.advance(1.0)


class RollsOn(Cart):
    def stop(self):
        self.settle()


class DrawsAnew(Cart):
    numbers = itertools.count(1)

    def begin(self, plan, speed):
        super().begin(plan + next(self.numbers), speed)


def test_a_cart_that_keeps_its_contract_passes():
    testing.conforms(Cart, lambda inputs: inputs["far"], speed=1.0)


@pytest.mark.parametrize(
    ("robot", "check", "told"),
    [
        (TellsNothing, testing.tells_what_can_be, "story\\(\\) gives None"),
        (KnowsNoEnergy, testing.tells_what_can_be, "energy = nan"),
        (SaysHowItEnds, testing.tells_what_can_be, "ending = 'reached'"),
        (EndsAtOnce, testing.starts_standing, "has ended already"),
        (LooksSlowly, testing.reading_changes_nothing, "only complete and work may"),
        (WaitsInBegin, testing.orders_take_no_time, "must not wait for the robot"),
        (WaitsForComplete, testing.moves_with_the_clock, "it lives on its clock"),
        (CompletesForEver, testing.completes, "takes 1 s again"),
        (RollsOn, testing.stops, "after stop"),
        (DrawsAnew, testing.repeats, "draw from a seeded generator"),
    ],
    ids=lambda each: getattr(each, "__name__", None),
)
def test_what_a_robot_does_not_keep_is_named_in_one_line(robot, check, told):
    with pytest.raises(testing.ConformanceError, match=told) as raised:
        check(robot, lambda inputs: inputs["far"], speed=1.0)
    assert "\n" not in str(raised.value)
