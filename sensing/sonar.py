"""NAO's two sonars: how far the nearest thing in a cone is, with no word on its bearing.

Pure geometry over circles and straight walls. Lengths in metres, angles in radians
counterclockwise. Ranges by version are those of Aldebaran's documentation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from anytime.errors import AnytimeError

Circle = tuple[float, float, float]
"""x, y and radius."""
Wall = tuple[float, float, float, float]
"""x and y of one end, x and y of the other."""
Pose = tuple[float, float, float]
"""x, y and heading."""

PERIOD = 0.1
"""Seconds between two samples."""


@dataclass(frozen=True)
class Ranger:
    """What one version of the sonar can tell.

    nearest: below it an obstacle is only known to be there. farthest: up to which the range is
    measured. estimated: up to which there is an estimate, good to a tenth. spread: standard
    deviation of a measured range. missed: probability that an echo gets lost.
    """

    nearest: float
    farthest: float
    estimated: float
    resolution: float = 0.01
    spread: float = 0.01
    missed: float = 0.02

    def spread_at(self, distance: float) -> float:
        """Standard deviation of what is reported of something at that distance."""
        return self.spread if distance <= self.farthest else 0.1 * distance


VERSIONS = {
    "V4": Ranger(0.25, 2.55, 2.55),
    "V5": Ranger(0.20, 0.80, 3.00),
    "V6": Ranger(0.20, 0.80, 3.00),
}
"""By version of the robot."""

MOUNTS: tuple[Pose, Pose] = (
    (0.05, 0.04, math.radians(25.0)),
    (0.05, -0.04, math.radians(-25.0)),
)
"""Where the left and the right sonar sit in the robot's frame, and where they look."""


@dataclass(frozen=True)
class Surroundings:
    """What stands around a robot: solid circles, and walls."""

    circles: tuple[Circle, ...] = ()
    walls: tuple[Wall, ...] = ()


@dataclass(frozen=True)
class Cone:
    """All that lies within `half_angle` of a direction, seen from a point."""

    x: float
    y: float
    bearing: float
    half_angle: float

    def nearest(self, around: Surroundings) -> float:
        """Distance of the nearest point of anything that reaches into the cone; inf if none does.

        Exact: the point is looked for in the whole cone, not on rays, so nothing is too thin.
        """
        return min(
            min((self._to_circle(*circle) for circle in around.circles), default=math.inf),
            min((self._to_wall(*wall) for wall in around.walls), default=math.inf),
        )

    def bounds(self, reach: float) -> tuple[float, float, float, float]:
        """The least and greatest x, then y, of what of it is within `reach` metres."""
        angles = [self.bearing - self.half_angle, self.bearing + self.half_angle]
        turn = math.pi / 2
        first = math.ceil(angles[0] / turn)  # where the arc is farthest along an axis
        angles += [turn * quarter for quarter in range(first, math.floor(angles[1] / turn) + 1)]
        xs = [self.x, *(self.x + reach * math.cos(angle) for angle in angles)]
        ys = [self.y, *(self.y + reach * math.sin(angle) for angle in angles)]
        return min(xs), max(xs), min(ys), max(ys)

    def _local(self, x: float, y: float) -> tuple[float, float]:
        """A point seen from the apex, the axis being the first direction."""
        cos, sin = math.cos(self.bearing), math.sin(self.bearing)
        right, up = x - self.x, y - self.y
        return cos * right + sin * up, cos * up - sin * right

    def _to_circle(self, x: float, y: float, radius: float) -> float:
        ahead, aside = self._local(x, y)
        distance = math.hypot(ahead, aside)
        if distance <= radius:
            return 0.0
        if abs(math.atan2(aside, ahead)) <= self.half_angle:
            return distance - radius
        # Its middle is outside, so its nearest point in the cone lies on the edge on that side.
        along = ahead * math.cos(self.half_angle) + abs(aside) * math.sin(self.half_angle)
        chord = radius**2 - (distance**2 - along**2)
        return along - math.sqrt(chord) if along > 0 and chord >= 0 else math.inf

    def _to_wall(self, x0: float, y0: float, x1: float, y1: float) -> float:
        begin, end = self._local(x0, y0), self._local(x1, y1)
        low, high = 0.0, 1.0  # the part of the wall inside the cone, which is two half-planes
        cos, sin = math.cos(self.half_angle), math.sin(self.half_angle)
        for side in (1.0, -1.0):
            here = begin[0] * sin - side * begin[1] * cos
            there = end[0] * sin - side * end[1] * cos
            if here < 0 and there < 0:
                return math.inf
            if here < 0:
                low = max(low, here / (here - there))
            elif there < 0:
                high = min(high, here / (here - there))
        if low > high:
            return math.inf
        along = end[0] - begin[0], end[1] - begin[1]
        square = along[0] ** 2 + along[1] ** 2
        foot = -(begin[0] * along[0] + begin[1] * along[1]) / square if square > 0 else 0.0
        part = min(max(foot, low), high)
        return math.hypot(begin[0] + part * along[0], begin[1] + part * along[1])


@dataclass(frozen=True)
class Sonars:
    """The pair of sonars on NAO's chest. Raises AnytimeError for a version that there is not."""

    version: str = "V4"
    half_angle: float = math.radians(30.0)

    def __post_init__(self) -> None:
        if self.version not in VERSIONS:
            raise AnytimeError(
                f"sonar version is {self.version!r}; it must be one of {', '.join(VERSIONS)}"
            )
        if not 0.0 < self.half_angle <= math.pi / 4:
            raise AnytimeError(
                f"half angle of the sonar is {self.half_angle}; it must be in (0, pi/4] radians"
            )

    @property
    def ranger(self) -> Ranger:
        """What this version can tell."""
        return VERSIONS[self.version]

    def cones(self, pose: Pose) -> tuple[Cone, Cone]:
        """Where the left and the right sonar of a robot at that pose look."""
        x, y, heading = pose
        cos, sin = math.cos(heading), math.sin(heading)
        left, right = (
            Cone(
                x + cos * ahead - sin * aside,
                y + sin * ahead + cos * aside,
                heading + bearing,
                self.half_angle,
            )
            for ahead, aside, bearing in MOUNTS
        )
        return left, right

    def distances(self, pose: Pose, around: Surroundings) -> tuple[float, float]:
        """True distances of the nearest thing in the left and in the right cone; inf if none."""
        left, right = self.cones(pose)
        return left.nearest(around), right.nearest(around)

    def hear(
        self, distances: Iterable[float], rng: np.random.Generator | None = None
    ) -> tuple[float, float]:
        """What the sonars report of true distances; inf is no echo. Without `rng`, no noise.

        A range is rounded up to the resolution: an echo is noticed after it has come. The same
        number of draws is made whatever the distances are.
        """
        left, right = (self._report(distance, rng) for distance in distances)
        return left, right

    def _report(self, distance: float, rng: np.random.Generator | None) -> float:
        ranger = self.ranger
        luck, error = (rng.random(), rng.standard_normal()) if rng is not None else (1.0, 0.0)
        if luck < ranger.missed or distance > ranger.estimated:
            return math.inf
        told = distance + error * ranger.spread_at(distance)
        steps = math.ceil(told / ranger.resolution - 1e-9)
        return min(max(steps * ranger.resolution, ranger.nearest), ranger.estimated)
