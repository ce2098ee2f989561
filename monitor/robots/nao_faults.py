"""A NAO on which things go wrong as they were planned to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from anytime.errors import AnytimeError
from anytime.faults import Fault
from monitor.robots.nao_body import LYING, Action, LinkLostError, NaoBody, Outcome, Reading
from monitor.robots.nao_odometry import compose

KINDS = {
    "link": "nobody answers",
    "posture": "every posture is refused",
    "stiffness": "a walk is done at once, without a motion",
    "fall": "it lies, though it touched nothing",
    "fall-event": "that it fell is not told; its posture is",
    "sonar-nan": "the sonars tell NaN",
    "sonar-zero": "the sonars tell 0",
    "sonar-stuck": "the sonars go on telling what they told when it began",
    "sonar-swapped": "left is right",
    "odometry-jump": "from then on the pose is told 1 m ahead, 0.5 m to the right and turned",
    "odometry-nan": "the pose is NaN",
    "odometry-frozen": "the pose stays what it was when it began",
}
"""What can go wrong, by name."""

_JUMP = (1.0, -0.5, 0.8)


def read_fault(text: str) -> Fault:
    """A fault as KIND[:FROM[:TO]], seconds. Raises AnytimeError."""
    kind, *times = text.split(":")
    try:
        begins, ends = [*map(float, times), *(0.0, math.inf)[len(times) :]]
    except ValueError:
        raise AnytimeError(f"{text!r} is no fault; give KIND[:FROM[:TO]] in seconds") from None
    return _known(Fault(kind, begins, ends))


def _known(fault: Fault) -> Fault:
    if fault.kind not in KINDS:
        raise AnytimeError(f"no fault {fault.kind!r}; there are {', '.join(KINDS)}")
    return fault


class _FaultyAction:
    """An action that goes on unseen while the link is lost."""

    def __init__(self, body: Faulty, action: Action) -> None:
        self._body = body
        self._action = action
        self._lost = False

    def poll(self) -> Outcome | None:
        self._lost = self._lost or (self._body.has("link") and self._action.poll() is None)
        return Outcome.LINK_LOST if self._lost else self._action.poll()

    def cancel(self) -> None:
        if not self._body.has("link"):
            self._action.cancel()


class _Ended:
    """An action that had ended before it began."""

    def __init__(self, outcome: Outcome) -> None:
        self._outcome = outcome

    def poll(self) -> Outcome:
        return self._outcome

    def cancel(self) -> None:
        """It has ended."""


class Faulty:
    """A body with faults. Implements `NaoBody`; without faults it is the body itself."""

    def __init__(self, body: NaoBody, faults: Iterable[Fault] = ()) -> None:
        self.body = body
        self._faults = tuple(map(_known, faults))
        self._origin = body.now()
        self._kept: dict[str, Reading] = {}  # the first reading under a fault

    def has(self, kind: str) -> bool:
        """Whether that is wrong now."""
        time = self.body.now() - self._origin
        return any(each.kind == kind and each.begins <= time < each.ends for each in self._faults)

    def now(self) -> float:
        return self.body.now()

    def wait(self, seconds: float) -> None:
        self.body.wait(seconds)

    def read(self) -> Reading:
        if self.has("link"):
            raise LinkLostError("the link is lost, as it was planned")
        reading = self.body.read()
        if not self._faults:
            return reading
        return self._of_the_floor(self._of_the_sonars(self._of_the_falls(reading)))

    def walk(self, x: float, y: float, turn: float) -> Action:
        if self.has("link"):
            return _Ended(Outcome.LINK_LOST)
        if self.has("stiffness"):
            return _Ended(Outcome.DONE)
        if self.has("fall"):
            return _Ended(Outcome.REFUSED)
        return _FaultyAction(self, self.body.walk(x, y, turn))

    def posture(self, name: str) -> Action:
        if self.has("link"):
            return _Ended(Outcome.LINK_LOST)
        if self.has("posture") or self.has("fall"):
            return _Ended(Outcome.REFUSED)
        return _FaultyAction(self, self.body.posture(name))

    def stop(self) -> None:
        if not self.has("link"):
            self.body.stop()

    def close(self) -> None:
        self.body.close()

    def _of_the_falls(self, reading: Reading) -> Reading:
        if self.has("fall"):
            self.body.stop()
            reading = replace(reading, posture=LYING, fallen=True, moving=False)
        return replace(reading, fallen=False) if self.has("fall-event") else reading

    def _of_the_sonars(self, reading: Reading) -> Reading:
        left, right = reading.sonars
        if self._kept_for("sonar-stuck", reading):
            left, right = self._kept["sonar-stuck"].sonars
        if self.has("sonar-swapped"):
            left, right = right, left
        if self.has("sonar-nan"):
            left = right = math.nan
        if self.has("sonar-zero"):
            left = right = 0.0
        return replace(reading, sonars=(left, right))

    def _of_the_floor(self, reading: Reading) -> Reading:
        pose = reading.pose_in_world
        if self._kept_for("odometry-frozen", reading):
            pose = self._kept["odometry-frozen"].pose_in_world
        if self.has("odometry-jump"):
            pose = compose(_JUMP, pose)
        if self.has("odometry-nan"):
            pose = (math.nan, math.nan, math.nan)
        return replace(reading, pose_in_world=pose)

    def _kept_for(self, kind: str, reading: Reading) -> bool:
        if not self.has(kind):
            self._kept.pop(kind, None)
            return False
        self._kept.setdefault(kind, reading)
        return True
