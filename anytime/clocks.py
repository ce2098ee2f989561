"""Time: one clock for thinking and acting, and deadlines upon it."""

from __future__ import annotations

import math
import numbers
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

from anytime.errors import AnytimeError
from anytime.machines import Machine


class Clock(Protocol):
    """What tells the time, and what thinking costs on it."""

    def now(self) -> float:
        """Seconds since the clock's origin; never decreases."""
        ...

    def spend(self, module: str, work: float, step: int | None) -> None:
        """Account for `work` units of `module`; `step`: its index, if it counts no work itself."""
        ...

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass."""
        ...


@dataclass(frozen=True)
class WallClock:
    """Real time. Work takes as long as it takes. All wall clocks are equal."""

    def now(self) -> float:
        return time.perf_counter()

    def spend(self, module: str, work: float, step: int | None) -> None:
        """Nothing to do: real time has passed already."""

    def advance(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))


def is_number(value: object) -> bool:
    """Whether it is a number of seconds at all."""
    # To Python a truth value is a number; as a time it is a slip.
    return isinstance(value, numbers.Real) and not isinstance(value, bool)  # pyright: ignore[reportUnnecessaryIsInstance]


DECIMALS, INSTANT = 12, 1e-12
"""Decimals of a second that moments are kept to, and how far apart two of them are one: sums of the
same steps in another order differ in the last bit."""


class WorkClock:
    """Simulated time, which advances by each module's own rate on a given machine.

    A mission on a work clock, its decisions and its bugs repeat bit for bit, and faster than
    real time. Whoever acts instead of thinking calls `advance`.
    """

    def __init__(self, machine: Machine, start: float = 0.0) -> None:
        if not isinstance(machine, Machine):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(f"a work clock of {machine!r}; give a Machine")
        self.machine = machine
        self._now = start
        self._beside: list[Callable[[float], None]] = []

    def now(self) -> float:
        return self._now

    def spend(self, module: str, work: float, step: int | None) -> None:
        if work:  # nothing costs nothing, for a module without a rate as well
            self._pass(self.machine.seconds(module, work, step))

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass. Raises AnytimeError for a negative or non-finite time."""
        if not 0 <= seconds < math.inf:
            raise AnytimeError(f"time cannot advance by {seconds} s; give a finite number >= 0")
        self._pass(seconds)

    @contextmanager
    def beside(self, work: Callable[[float], None]) -> Generator[None]:
        """While this is open, call `work(seconds)` whenever so much time has passed.

        So background work is interleaved by whoever lets time pass; nothing runs in threads.
        """
        self._beside.append(work)
        try:
            yield
        finally:
            self._beside.remove(work)

    def _pass(self, seconds: float) -> None:
        self._now += seconds
        for work in tuple(self._beside):
            work(seconds)


@dataclass(frozen=True)
class Deadline:
    """An absolute time on one clock, or an event that nobody can date, whichever comes first.

    at: seconds on the clock; `inf` is no deadline; one that has passed means stop now.
    event: asked at every check-point; true interrupts.
    """

    clock: Clock
    at: float = math.inf
    event: Callable[[], bool] | None = None

    @classmethod
    def after(cls, seconds: float, clock: Clock | None = None) -> Deadline:
        """The deadline `seconds` from now; zero or negative means stop now, never "no limit"."""
        if not is_number(seconds) or math.isnan(seconds):
            raise AnytimeError(
                f"seconds is {seconds!r}; give the time that may be spent, 0 = stop now"
            )
        clock = clock or WallClock()
        return cls(clock, clock.now() + seconds)

    def remaining(self) -> float:
        """Seconds left as far as is known: negative when it has passed, 0 once interrupted."""
        left = self.at - self.clock.now()
        return min(left, 0.0) if self.interrupted() else left

    def interrupted(self) -> bool:
        """Whether the event has come."""
        return self.event is not None and self.event()

    def expired(self) -> bool:
        return self.clock.now() >= self.at or self.interrupted()

    def sooner(self, seconds: float) -> Deadline:
        """This deadline or the one `seconds` from now, whichever comes first."""
        return replace(self, at=min(self.at, self.clock.now() + seconds))

    def earlier(self, other: Deadline) -> Deadline:
        """This deadline or another, whichever comes first; of one on another clock, whose times
        cannot be compared, the event alone."""
        at = min(self.at, other.at) if other.clock == self.clock else self.at
        return Deadline(self.clock, at, _either(self.event, other.event))


def _either(
    one: Callable[[], bool] | None, other: Callable[[], bool] | None
) -> Callable[[], bool] | None:
    if one is None or other is None or one == other:
        return one or other
    return lambda: one() or other()
