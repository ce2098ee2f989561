"""The little that the monitor asks of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from monitor.states import Situation


class Robot(Protocol):
    """A body on a clock. Whoever lets time pass on the clock moves the robot too.

    Nothing here blocks but `complete` and `work`.
    """

    @property
    def clock(self) -> Clock:
        """Whose time it lives in; the modules think on the same."""
        ...

    def inputs(self) -> Mapping[str, Any]:
        """The program's inputs for the next frame, as seen from where the robot is now."""
        ...

    def situation(self) -> Situation:
        """How things stand now."""
        ...

    def begin(self, plan: Any, speed: float) -> None:
        """Start to execute a plan at this speed; the robot must stand."""
        ...

    def change_speed(self, speed: float) -> None:
        """Go on at another speed."""
        ...

    def learn(self, plan: Any) -> None:
        """Take up what a plan's making found out, whether or not the plan is executed."""
        ...

    def complete(self) -> None:
        """Let time pass until the plan in execution is finished or broken off."""
        ...

    def work(self, seconds: float) -> None:
        """Do the job at the goal."""
        ...

    def stop(self) -> None:
        """Stand still where it is; never fails."""
        ...

    def driven(self) -> float:
        """Seconds in motion so far."""
        ...

    def story(self) -> Mapping[str, Any]:
        """What to log of the frame that just ended, as plain data.

        `planned` and `length`, of the plan and of what was really walked, are needed for
        calibration; `path`, `plan` and `motion`, a `monitor.log_lines.Motion`, are drawn.
        """
        ...

    def picture(self) -> Mapping[str, Any]:
        """What is too large to be kept of each frame, for those who listen while it lasts."""
        ...


class Reactive(Protocol):
    """A robot that can go on without a plan: the rung below the last good one."""

    def avoid(self, speed: float) -> None:
        """Start towards the goal by obstacle avoidance alone, further each time in a row."""
        ...


MEMBERS = tuple(name for name in vars(Robot) if not name.startswith("_"))


def must_be_whole(robot: Robot) -> None:
    """Raise AnytimeError if a robot lacks one of its members, or is a class."""
    if isinstance(robot, type):
        raise AnytimeError(f"the robot is the class {robot.__name__}; give one that it makes")
    # By the class where it can be: to ask a robot for its clock may raise what is its own matter.
    missing = [name for name in MEMBERS if not (hasattr(type(robot), name) or hasattr(robot, name))]
    if missing:
        raise AnytimeError(
            f"the robot, a {type(robot).__name__}, has no {', '.join(missing)}; a robot has "
            + ", ".join(MEMBERS)
        )
