"""The time of a server in lock-step: it lives up to where it is told, and stands still."""

from __future__ import annotations

from monitor.robots.naoqi_link import Link

_CHUNK = 5.0  # seconds that a server lives at once: it must answer within a call's time-out


class Lockstep:
    """One robot's share in lock-step; `SimClock` is the server's.

    time: the robot's, at its last tick. running: the number of the command in execution, else 0.
    """

    def __init__(self, link: Link, seed: int | None) -> None:
        self.time = 0.0
        self.running = 0
        self._link = link
        self._seed = seed
        self._commands = 0
        self._settled: float | None = None  # None until the scene began

    def begin(self, now: float) -> None:
        """Let the scene begin, unless it did and only the link was lost."""
        if self._settled is None or not self._link.call("SimClock", "begun"):
            self._link.call("SimClock", "begin", now, self._seed)
            self._settled = now
        self._commands = self._link.call("SimClock", "commands")
        self.settle(now, again=True)

    def command(self, now: float) -> int:
        """A command was sent: wait until it has come; its number."""
        self._commands += 1
        self.settle(now, again=True)
        return self._commands

    def settle(self, now: float, *, again: bool = False) -> bool:
        """Let the server live up to now; whether anything may have changed."""
        if self._settled is None or (now == self._settled and not again):
            return False
        while now - self._settled > _CHUNK:
            self._settled += _CHUNK
            self._link.call("SimClock", "settle", self._settled, self._commands)
        self.time, running = self._link.call("SimClock", "settle", now, self._commands)
        self._settled, self.running = now, int(running)
        return True
