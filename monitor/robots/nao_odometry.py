"""What of a robot's odometry can be believed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from monitor.robots.nao_body import LinkLostError, Pose

_SLACK = 3.0  # times its speed that a robot may seem to move
_PLACE, _HEADING = 0.05, 0.3  # metres and radians that it may seem to move in no time
_BLIND = 1.0  # seconds that the last pose stands for what is none

FROZEN = 3.0
"""Seconds of walking that are not seen after which nobody knows where the robot goes."""


class Odometry:
    """A robot's pose without jumps, in the frame in which it was first told.

    Who falls, is carried away or starts anew, tells a pose that cannot follow from the one before.
    Then the frame is laid anew so that the robot is where it last was: goal, obstacles and plans
    stay where they are but for the few steps that nobody saw. What a robot walks while its pose
    stays the same is no jump when it is told at last. jumps: how often there was one. unseen:
    seconds that it said to move since the pose was last another one.
    """

    def __init__(self, speed: float, turn_rate: float) -> None:
        self.jumps = 0
        self.unseen = 0.0
        self._speed, self._turn_rate = speed, turn_rate
        self._anchor: Pose | None = None  # the robot's frame in ours; None if it is ours
        self._raw: Pose | None = None
        self._time = -math.inf  # when the pose last was one
        self._moving = False  # whether the robot said so then
        self._pose: Pose | None = None

    def believe(self, time: float, told: Sequence[Any], moving: bool) -> Pose:
        """The pose at a time, from what the robot told, and whether it said that it moves.

        What is no pose is passed over for a second; the last one stands. Raises LinkLostError
        after that, and when there was none before.
        """
        raw, before = _pose(told), self._raw
        if raw is None:
            if self._pose is None or time - self._time > _BLIND:
                raise LinkLostError(f"the robot does not tell where it is; it says {told!r}")
            return self._pose
        passed = time - self._time
        if before is not None and self._leaps(before, raw, passed + self.unseen):
            assert self._pose is not None
            self.jumps += 1
            self._anchor = compose(self._pose, inverse(raw))
        if raw != before:
            self.unseen = 0.0
        elif moving and self._moving:
            self.unseen += passed
        self._raw, self._time, self._moving = raw, time, moving
        self._pose = raw if self._anchor is None else compose(self._anchor, raw)
        return self._pose

    def _leaps(self, before: Pose, after: Pose, seconds: float) -> bool:
        far = math.dist(before[:2], after[:2])
        turned = abs(math.remainder(after[2] - before[2], math.tau))
        return (
            far > _PLACE + _SLACK * self._speed * seconds
            or turned > _HEADING + _SLACK * self._turn_rate * seconds
        )


def compose(first: Pose, second: Pose) -> Pose:
    """A pose that is told in the frame of the first, in the frame in which that one is told."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return (
        first[0] + cos * second[0] - sin * second[1],
        first[1] + sin * second[0] + cos * second[1],
        math.remainder(first[2] + second[2], math.tau),
    )


def inverse(pose: Pose) -> Pose:
    """The pose of the frame, in the frame of the pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return -cos * pose[0] - sin * pose[1], sin * pose[0] - cos * pose[1], -pose[2]


def _pose(told: Sequence[Any]) -> Pose | None:
    if not isinstance(told, list | tuple) or len(told) != 3:
        return None
    if not all(isinstance(each, float | int) and math.isfinite(each) for each in told):
        return None
    x, y, heading = map(float, told)
    return x, y, heading
