"""Watching a call while it runs: its policy is asked at every check-point whether it is to end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from anytime.clocks import Clock
from anytime.pictures import number
from anytime.results import Change
from compiler.policies import Share

Observer = Callable[[Any, Change], None]


@dataclass
class Watch:
    """A call that is watched. What it registers is passed on to an observer, if there is one.

    shown: of its last result, None while there is none. ended: seconds after which the policy ended
    it; None while it goes on.
    """

    share: Share
    clock: Clock
    started: float
    observer: Observer | None = None
    shown: float | None = None
    ended: float | None = None

    def observe(self, value: Any, change: Change) -> None:
        """Take note of a result."""
        self.shown = 1.0 if change.estimate is None else change.estimate
        if self.observer is not None:
            self.observer(value, change)

    def over(self) -> bool:
        """Whether the call is to end here; the event of its deadline."""
        if self.ended is None:
            elapsed = self.clock.now() - self.started
            if self.share.over(elapsed, self.shown):
                self.ended = elapsed
        return self.ended is not None

    @property
    def why(self) -> str:
        """Why the call was ended before the end of its share; empty where it was not."""
        if self.ended is None or self.ended >= self.share.seconds - 1e-9:
            return ""
        showed = "nothing" if self.shown is None else number(self.shown)
        return f" (ended by what it showed, {showed})"
