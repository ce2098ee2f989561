"""What a budget is divided into."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from anytime.pictures import duration, number


@dataclass(frozen=True)
class Allocation:
    """Who gets how much of a budget, and what is expected of it.

    shares: seconds by call; what is left of the budget is the last call's.
    """

    seconds: float
    shares: Mapping[str, float]
    promised: float

    def __repr__(self) -> str:
        parts = ", ".join(f"{label} {duration(s)}" for label, s in self.shares.items())
        return f"{duration(self.seconds)}: {parts} → {number(self.promised)}"
