"""What a NAO fell over: sonars are deaf to what is that near, so it is believed for a while."""

from __future__ import annotations

import math

from monitor.robots.nao_body import Pose
from planners.nao_plan import Action

_RADIUS = 0.1  # metres, of something that it fell over
_BELIEVED = 45.0  # seconds for which that is taken to be there


class Touched:
    """The places where a walk ran into something, and until when each is believed."""

    def __init__(self) -> None:
        self._places: list[tuple[float, float, float]] = []  # x, y in world, until when

    def __bool__(self) -> bool:
        return bool(self._places)

    def fell(self, pose_in_world: Pose, walk: Action, radius: float, now: float) -> None:
        """A robot of that radius ran into something on a walk: it is where the walk led to."""
        x, y, heading = pose_in_world
        towards = heading + math.atan2(walk.left, walk.ahead)
        apart = radius + _RADIUS
        place = x + apart * math.cos(towards), y + apart * math.sin(towards)
        self._places.append((*place, now + _BELIEVED))

    def doubt(self) -> None:
        """Believe in none of them any more: that may have gone."""
        self._places.clear()

    def discs(self, now: float) -> list[tuple[float, float, float]]:
        """x, y and radius, in metres, of what is believed now."""
        return [(x, y, _RADIUS) for x, y, until in self._places if now < until]
