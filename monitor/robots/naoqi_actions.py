"""What a NAO over NAOqi was told to do, and how far it has come with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

from monitor.robots.nao_body import Outcome, Pose
from monitor.robots.nao_odometry import compose, inverse

Call = tuple[str, str, tuple[Any, ...]]
"""Service, method and arguments."""


class Attendant(Protocol):
    """Who looks after an action."""

    def attend(self) -> None:
        """Look how the action in execution is getting on."""
        ...

    def stop(self) -> None:
        """Break it off."""
        ...


@dataclass(frozen=True)
class Way:
    """Where a walk leads from where it began."""

    start: Pose
    x: float
    y: float
    turn: float

    @property
    def length(self) -> float:
        return math.hypot(self.x, self.y)

    def rest(self, here: Pose) -> Pose:
        """What is left of it, in the robot's frame."""
        target = compose(self.start, (self.x, self.y, self.turn))
        x, y, turn = compose(inverse(here), target)
        left = self.turn * min(math.hypot(x, y) / self.length, 1.0) if self.length else self.turn
        return x, y, left + math.remainder(turn - left, math.tau)  # a turn may be more than pi


@dataclass
class Piece:
    """The part of a walk that the robot was told to go."""

    length: float
    rest: float  # of the way, when it was told
    jumps: int  # of odometry, when it was told

    @property
    def beyond(self) -> float:
        """What is left of the way after it."""
        return self.rest - self.length


@dataclass(eq=False)
class NaoqiAction:
    """A command to a NAO over NAOqi."""

    body: Attendant = field(repr=False)
    outcome: Outcome | None = None
    way: Way | None = None  # of a walk
    name: str = ""  # of a posture
    rising: bool = False  # it began on the floor, and the robot has not got up yet
    deadline: float = math.inf
    calls: list[Call] = field(default_factory=list)  # still to be made
    future: Any = None  # of the call in execution
    unseen: float = 0.0  # seconds that odometry had not seen when it was made
    number: int = 0  # of it, in lock-step
    piece: Piece | None = None

    def poll(self) -> Outcome | None:
        self.body.attend()
        return self.outcome

    def cancel(self) -> None:
        self.body.attend()
        if self.outcome is None:
            self.body.stop()
