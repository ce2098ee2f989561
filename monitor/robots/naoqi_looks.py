"""What a NAO answers when it is asked for everything at once, and what of it can be believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from monitor.robots.nao_body import LYING, UNKNOWN, LinkLostError, Pose
from monitor.robots.nao_odometry import Odometry
from monitor.robots.naoqi_link import Link, RemoteError
from monitor.robots.naoqi_names import FALLEN, NO_ECHO, SONARS
from planners.nao import POSTURES


@dataclass(frozen=True)
class Look:
    """How a robot was at one moment; the fields are those of `nao_body.Reading`.

    awake: the motors are on.
    """

    pose: Pose
    posture: str
    fallen: bool
    moving: bool
    sonars: tuple[float, float]
    awake: bool


class Looks:
    """Looks at a robot over a link."""

    def __init__(self, link: Link, odometry: Odometry) -> None:
        self._link = link
        self._odometry = odometry

    def ask(self) -> list[Any]:
        """Ask for everything at once: one after the other would take as many times the way."""
        send = self._link.send
        return [
            send("ALMotion", "getRobotPosition", True),
            send("ALMotion", "moveIsActive"),
            send("ALMotion", "robotIsWakeUp"),
            send("ALRobotPosture", "getPosture"),
            send("ALMemory", "getListData", [FALLEN, *SONARS]),
        ]

    def look(self, futures: Sequence[Any], now: float) -> Look:
        """What was answered to `ask`, waited for. Raises LinkLostError."""
        try:
            told, moving, awake, posture, (fell, left, right) = self._link.values(futures)
        except RemoteError as error:
            raise LinkLostError(f"the robot does not tell how it is: {error}") from None
        except (TypeError, ValueError):
            raise LinkLostError("the robot does not tell how it is: answers are missing") from None
        lies = str(posture).startswith("Lying")
        posture = LYING if lies else posture if posture in POSTURES else UNKNOWN
        # The key may be missing or late, and on a robot it may outlive the fall: posture counts.
        fallen = lies or (bool(fell) and posture not in POSTURES)
        sonars = _heard(left), _heard(right)
        pose = self._odometry.believe(now, told, bool(moving))
        return Look(pose, posture, fallen, bool(moving), sonars, bool(awake))


def _heard(value: Any) -> float:
    """What a sonar told, in metres: inf is no echo, NaN no information."""
    if not isinstance(value, float | int) or not value > 0.0:
        return math.nan
    return math.inf if value >= NO_ECHO else float(value)
