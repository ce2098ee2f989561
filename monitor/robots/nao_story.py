"""What a NAO tells of itself for the log and its page. Metres and radians in world, seconds since
the task was presented."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

from monitor.robots.nao_body import Pose, Reading
from sensing.sonar import Sonars

Way = Sequence[tuple[float, float]]
"""Places, one after the other."""

_STEP = 0.01  # metres between two poses of a track


class Story:
    """What happened in a frame, noted while it goes on.

    track: poses of the way, from where the frame began.
    """

    def __init__(self, pose: Pose) -> None:
        self.track: list[Pose] = [pose]
        self._plan: Way = ()  # where it leads, as it was foreseen when it was last compared
        self._comparisons: list[dict[str, Any]] = []
        self._events: list[tuple[float, str]] = []

    def moved(self, pose: Pose) -> None:
        """The robot is there now."""
        if math.dist(pose[:2], self.track[-1][:2]) > _STEP:
            self.track.append(pose)

    def compared(
        self,
        time: float,
        held: float,
        found: float,
        *,
        threshold: float,
        idle: bool,
        taken: bool,
        plan: Way,
        other: Way,
    ) -> None:
        """A plan was compared with the one in execution: see `monitor.log_lines.Comparison`.

        plan: where the one leads that is in execution from now on.
        """
        self._plan = plan
        self._comparisons.append(
            {
                "time": time,
                "held": held,
                "found": found,
                "threshold": threshold,
                "idle": idle,
                "taken": taken,
                "other": [list(place) for place in other],
            }
        )

    def happened(self, time: float, what: str) -> None:
        """Something that is worth a mark: a fall, a jump of the odometry."""
        self._events.append((time, what))

    def told(
        self,
        reading: Reading,
        *,
        executes: bool,
        goal: tuple[float, float],
        discs: Iterable[tuple[float, float, float]],
        clearance: float,
        radius: float,
        sonars: Sonars,
    ) -> Mapping[str, Any]:
        """The story of the frame that ends now; the next one begins where the robot is.

        executes: whether a plan is in execution. discs: obstacles believed (x, y, radius), from
        which the robot's middle keeps `clearance`. radius: of the robot.
        """
        if reading.pose_in_world != self.track[-1]:
            self.track.append(reading.pose_in_world)
        track, comparisons, events = self.track, self._comparisons, self._events
        self.track, self._comparisons, self._events = track[-1:], [], []
        return {
            "planned": 0.0,
            "length": sum(math.dist(a[:2], b[:2]) for a, b in pairwise(track)),
            "posture": reading.posture,
            "motion": {
                "track": [list(pose) for pose in track],
                "radius": radius,
                "plan": [list(place) for place in self._plan] if executes else [],
                "goal": list(goal),
                "discs": [list(map(float, disc)) for disc in discs],
                "clearance": clearance,
                "cones": _cones(reading, sonars),
                "comparisons": comparisons,
                "events": [list(event) for event in events],
            },
        }


def _cones(reading: Reading, sonars: Sonars) -> list[dict[str, float | None]]:
    """The sonars' cones, and what each heard: metres, or None for no echo. One that tells nothing
    has no cone."""
    return [
        {
            "x": cone.x,
            "y": cone.y,
            "bearing": cone.bearing,
            "half_angle": cone.half_angle,
            "reach": sonars.ranger.estimated,
            "heard": told if math.isfinite(told) else None,
        }
        for cone, told in zip(sonars.cones(reading.pose_in_world), reading.sonars, strict=True)
        if told > 0.0
    ]
