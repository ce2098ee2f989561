"""The little that is asked of a NAO, simulated or real.

Lengths in metres, angles in radians counterclockwise, times in seconds of the body's own time.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from anytime.errors import AnytimeError

Pose = tuple[float, float, float]
"""x, y and heading."""

UNKNOWN = "Unknown"
"""The posture of a NAO that is between two postures."""

LYING = "LyingBelly"
"""The posture of a NAO that has fallen."""


class Outcome(Enum):
    """How an action ended."""

    DONE = "done"
    """The body has done what it was told, as far as it knows; where it is, a reading tells."""
    REFUSED = "refused"
    """Not begun: the posture does not allow it, or the command makes no sense."""
    CANCELLED = "cancelled"
    """Broken off by `cancel`, by `stop` or by a later command."""
    FELL = "fell"
    LINK_LOST = "link lost"
    TIMEOUT = "timeout"
    """It took much longer than it can take."""
    FAILED = "failed"
    """Tried, and not achieved: it could not get up, or something is in the way."""


class LinkLostError(AnytimeError):
    """There is nobody to ask: the body is closed or out of reach."""


@dataclass(frozen=True)
class Reading:
    """What the body knows of itself at one moment.

    pose_in_world: by odometry, in the frame that the body was started in; heading in [-pi, pi].
    posture: one of `planners.nao.POSTURES`, or `UNKNOWN`, or `LYING`. moving: it walks or turns.
    sonars: left and right in metres; inf is no echo, NaN no information. They are sampled at about
    10 Hz and held.
    """

    time: float
    pose_in_world: Pose
    posture: str
    fallen: bool
    moving: bool
    sonars: tuple[float, float]


class Action(Protocol):
    """Something that the body does, or did."""

    def poll(self) -> Outcome | None:
        """How it ended, or None while it goes on. Neither blocks nor raises."""
        ...

    def cancel(self) -> None:
        """Break it off; nothing happens if it has ended."""
        ...


class NaoBody(Protocol):
    """A NAO. A new command takes the place of the one in execution, unless it is refused."""

    def now(self) -> float:
        """The body's time in seconds."""
        ...

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        ...

    def read(self) -> Reading:
        """Everything at one moment; changes nothing. Raises LinkLostError."""
        ...

    def walk(self, x: float, y: float, turn: float) -> Action:
        """Go x forward and y to the left on a straight line, turning meanwhile.

        In the robot's own frame where the walk begins, as NAOqi's `moveTo`; goes by its steps, and
        looks neither at odometry nor at the sonars on the way. Never raises.
        """
        ...

    def posture(self, name: str) -> Action:
        """Take a posture; a fallen NAO gets up first. Never raises."""
        ...

    def stop(self) -> None:
        """Break off what is in execution and keep still. Never raises."""
        ...

    def close(self) -> None:
        """Stop, and let go of the body."""
        ...
