"""Any robot, with faults as they were scheduled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from anytime.faults import CLOCK, MODULE, Schedule, faulty_module
from anytime.programs import Program
from compiler import CompiledProgram
from compiler.rebinding import rebound
from monitor.bodies import Robot
from monitor.reports import Frame
from monitor.states import Situation

ROBOT = {
    "blind": "what it senses cannot be read",
    "link": "nobody answers",
    "refuses": "no plan is begun",
    "deaf": "it does not stop when it is told to",
    "bumps": "the plan in execution is reported as broken off",
}
"""What may go wrong with a robot, by name."""

LOG = {"full": "a frame cannot be written"}
"""What may go wrong with a log."""


def kinds_of(program: Program) -> dict[str, dict[str, str]]:
    """What may go wrong in a mission: by what is faulty, the kinds and what they mean."""
    modules = {call.module.name: MODULE for call in program.calls}
    return {**modules, "robot": ROBOT, "clock": CLOCK, "log": LOG}


def faulty_program(
    program: CompiledProgram, schedule: Schedule, robot: FaultyRobot
) -> CompiledProgram:
    """A program whose modules go wrong as scheduled, on the time of a robot."""
    modules = {call.module.name: call.module for call in program.program.calls}
    faulty = {
        name: faulty_module(module, schedule, robot.time)
        for name, module in modules.items()
        if schedule.of(name)
    }
    return rebound(program, faulty)


class FaultyRobot:
    """A robot on which things go wrong. Implements `Robot`; without faults it is the robot."""

    def __init__(self, robot: Robot, schedule: Schedule) -> None:
        self.robot, self.schedule = robot, schedule
        self._origin = robot.clock.now()
        self._bumped = False  # since it set out

    def __getattr__(self, name: str) -> Any:
        # What a robot can do beyond the protocol (`avoid`) it still can.
        found = getattr(self.robot, name)
        return self._setting_out(found) if name == "avoid" else found

    @property
    def clock(self) -> Clock:
        return self.robot.clock

    def time(self) -> float:
        """Seconds since it was made faulty."""
        return self.clock.now() - self._origin

    def inputs(self) -> Mapping[str, Any]:
        if "blind" in self._struck():
            raise AnytimeError("the sensors tell nothing, as it was scheduled")
        return self.robot.inputs()

    def situation(self) -> Situation:
        kinds = self._struck()
        found = self.robot.situation()
        if "bumps" in kinds and found.in_hand > 0:
            self.robot.stop()
            self._bumped = True
            found = self.robot.situation()
        return replace(found, interrupted=found.interrupted or self._bumped)

    def begin(self, plan: Any, speed: float) -> None:
        if "refuses" in self._struck():
            raise AnytimeError("the motors refuse, as it was scheduled")
        self._setting_out(self.robot.begin)(plan, speed)

    def _setting_out(self, how: Callable[..., None]) -> Callable[..., None]:
        def anew(*asked: Any) -> None:
            self._bumped = False
            how(*asked)

        return anew

    def change_speed(self, speed: float) -> None:
        self._struck()
        self.robot.change_speed(speed)

    def learn(self, plan: Any) -> None:
        self.robot.learn(plan)

    def complete(self) -> None:
        self._struck()
        self.robot.complete()

    def work(self, seconds: float) -> None:
        self._struck()
        self.robot.work(seconds)

    def stop(self) -> None:
        if "deaf" in self._struck():
            raise AnytimeError("it does not hear, as it was scheduled")
        self.robot.stop()

    def driven(self) -> float:
        return self.robot.driven()

    def story(self) -> Mapping[str, Any]:
        return self.robot.story()

    def picture(self) -> Mapping[str, Any]:
        return self.robot.picture()

    def log(self, frame: Frame) -> None:
        """What a listener does that writes a log, as far as the schedule lets it."""
        if "full" in self.schedule.strikes("log", self.time()):
            raise OSError(28, "No space left on device, as it was scheduled")

    def _struck(self) -> set[str]:
        kinds = self.schedule.strikes("robot", self.time())
        if "link" in kinds:
            raise ConnectionError("nobody answers, as it was scheduled")
        return kinds
