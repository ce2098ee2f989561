"""Watching a call while it runs: its policy is asked at every check-point whether it is to end."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from typing import Any

from anytime.clocks import INSTANT, Clock
from anytime.pictures import number
from anytime.results import Change
from compiler.policies import Share

Observer = Callable[[Any, Change], None]


class Watch:
    """A call that is watched. What it registers is passed on to an observer, if there is one.

    shown: of its last result, None while there is none. ended: seconds after which the policy ended
    it; None while it goes on.
    """

    def __init__(self, share: Share, clock: Clock, observer: Observer | None = None) -> None:
        self.shown: float | None = None
        self.ended: float | None = None
        self._share, self._clock, self._observer = share, clock, observer
        self._started = clock.now()
        # Lists, because a quick module asks every few microseconds.
        self._moments, self._ends = share.moments.tolist(), share.ends.tolist()
        self._level = 0

    def observe(self, value: Any, change: Change) -> None:
        """Take note of a result."""
        self.shown = 1.0 if change.estimate is None else change.estimate
        self._level = self._share.level(self.shown)
        if self._observer is not None:
            self._observer(value, change)

    def over(self) -> bool:
        """Whether the call is to end here; the event of its deadline."""
        if self.ended is None:
            elapsed = self._clock.now() - self._started
            moment = max(0, bisect_right(self._moments, elapsed + INSTANT) - 1)
            if self._ends[moment][self._level]:
                self.ended = elapsed
        return self.ended is not None

    @property
    def why(self) -> str:
        """Why the call was ended before the end of its share; empty where it was not."""
        if self.ended is None or self.ended >= self._share.seconds - INSTANT:
            return ""
        showed = "nothing" if self.shown is None else number(self.shown)
        return f" (ended by what it showed, {showed})"
