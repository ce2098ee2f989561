"""The time of a NAO that lives in another process: real time, scaled, or as it is told."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from anytime.errors import AnytimeError


@dataclass(frozen=True)
class PacedClock:
    """Real time that runs at `rate` times its pace, from 0. Work takes as long as it takes."""

    rate: float = 1.0
    _origin: float = field(default_factory=time.perf_counter)

    def now(self) -> float:
        return self.rate * (time.perf_counter() - self._origin)

    def spend(self, module: str, work: float, step: int | None) -> None:
        """Nothing to do: real time has passed already."""

    def advance(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds / self.rate))


class ToldClock:
    """Time that stands still until somebody tells the next one."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def tell(self, now: float) -> None:
        """It is that late now; an earlier time than the one before changes nothing."""
        self._now = max(self._now, now)

    def spend(self, module: str, work: float, step: int | None) -> None:
        """Nothing to do: whoever works tells the time."""

    def advance(self, seconds: float) -> None:
        raise AnytimeError("in lock-step time is told, not waited for; call SimClock.settle")
