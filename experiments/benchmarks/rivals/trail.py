"""What a search did and when it got there, on the clock of its own thread."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from time import thread_time
from typing import Any

from anytime.errors import AnytimeError


@dataclass(frozen=True)
class Trail:
    """What one search cost and reached.

    seconds: CPU-seconds of the searching thread. best: the lowest value found. reached_seconds,
    reached_evaluations: when the target was first reached, None if it never was.
    """

    evaluations: int
    seconds: float
    best: float
    reached_seconds: float | None = None
    reached_evaluations: int | None = None

    @property
    def rate(self) -> float:
        """Evaluations a CPU-second."""
        return self.evaluations / self.seconds if self.seconds > 0.0 else 0.0


class Stop(BaseException):
    """The target is reached or the budget is spent: leave the library, whatever it is doing.

    Not an Exception: libraries catch those, log them or call them bad fitness values.
    """


class Restart(BaseException):
    """The search has stalled: begin again elsewhere."""


class Watch:
    """An objective under a stop-watch: counts, keeps the best, and stops its search in time.

    patience: evaluations without a gain of a hundredth after which the search is to begin again.
    The clock starts here; raises AnytimeError for a budget that is not positive.
    """

    def __init__(
        self,
        objective: Callable[[Any], float],
        budget_seconds: float,
        target: float,
        *,
        patience: float = math.inf,
    ) -> None:
        if not budget_seconds > 0.0:
            raise AnytimeError(f"budget_seconds={budget_seconds} is not positive")
        self._objective = objective
        self._target = target
        self._patience = patience
        self._stall, self._mark = patience, math.inf
        self._evaluations = 0
        self._best = math.inf
        self._reached: tuple[float, int] | None = None
        self._begin = self._now = thread_time()
        self._end = self._begin + budget_seconds

    def __call__(self, candidate: Any) -> float:
        """The candidate's value, infinite if it is not a number. Raises Stop and Restart."""
        value = float(self._objective(candidate))
        self._evaluations += 1
        self._now = thread_time()
        if value < self._best:
            self._best = value
            if value <= self._target:
                self._reached = self._now - self._begin, self._evaluations
                raise Stop
        if self._now >= self._end:
            raise Stop
        if value < self._mark:
            self._mark = value - 0.01 * abs(value)
            self._stall = self._evaluations + self._patience
        elif self._evaluations > self._stall:
            self._stall, self._mark = self._evaluations + self._patience, math.inf
            raise Restart
        return value if value == value else math.inf

    @property
    def trail(self) -> Trail:
        """The search until its last evaluation."""
        seconds, evaluations = self._reached or (None, None)
        return Trail(self._evaluations, self._now - self._begin, self._best, seconds, evaluations)
