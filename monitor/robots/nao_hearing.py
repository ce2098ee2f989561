"""What a NAO hears while it does something, as `sensing.sonar_map` wants to listen to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from monitor.robots.nao_body import Reading
from sensing.sonar import PERIOD, Sonars
from sensing.sonar_grid import Echoes, SonarMap

_MARGIN = 1e-6  # seconds that sums of times may be off


class Heard(Protocol):
    """What is asked of a body that one listens with: a part of `NaoBody`."""

    def now(self) -> float: ...

    def wait(self, seconds: float) -> None: ...

    def read(self) -> Reading: ...


class Hearing:
    """A body's sonars. A reading that is not due yet is waited for, so none is heard twice.

    known: the map to go on with; whoever takes over a better one sets it.
    """

    def __init__(self, body: Heard, sonars: Sonars, known: SonarMap | None = None) -> None:
        self.body = body
        self.sonars = sonars
        x, y, _ = body.read().pose_in_world
        self.known = known or SonarMap.around(x, y)
        self._due = body.now()

    def listen(self) -> Iterator[Echoes]:
        """One reading every `sensing.sonar.PERIOD` seconds of the body's time, for ever."""
        while True:
            early = self._due - self.body.now()
            if early > _MARGIN:
                self.body.wait(early)
            reading = self.body.read()
            self._due = reading.time + PERIOD
            yield Echoes(reading.time, reading.pose_in_world, reading.sonars)
