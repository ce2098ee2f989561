"""A figure of ours beside a rival's: what is compared with what, and which is better."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Figures = Mapping[str, float | int | None]


@dataclass(frozen=True)
class Comparison:
    """A row of the table: what of ours is compared with whose, and the figure that tells.

    key: of the figure, in its benchmark. reading: how it says how many times as good ours is.
    "times": it is that. "share": ours takes this share of what the rival takes. "more": ours is
    worth more by this share of theirs. "margin": by this share of ours. "gap": less, by this share
    of theirs.
    """

    benchmark: str
    key: str
    ours: str
    rival: str
    reading: Literal["times", "share", "more", "margin", "gap"] = "times"

    def told(self, figures: Figures) -> dict[str, Any] | None:
        """The row as JSON, None if it was not measured. figures: of its benchmark.

        `times`, `low` and `high` are how many times as good ours is; None is without bound.
        """
        if figures.get(self.key) is None:
            return None
        ends = [figures[f"{self.key}{end}"] for end in ("", "_low", "_high")]
        times, *bounds = map(self._times, ends)
        low, high = reversed(bounds) if self.reading in ("share", "gap") else bounds
        return {
            "benchmark": self.benchmark,
            "key": self.key,
            "ours": self.ours,
            "rival": self.rival,
            "times": times,
            "low": low,
            "high": high,
            "verdict": _verdict(low, high),
        }

    def _times(self, figure: float | None) -> float | None:
        if figure is None:
            return None
        above, below = {
            "times": (figure, 1.0),
            "share": (1.0, figure),
            "more": (1.0 + figure, 1.0),
            "margin": (1.0, 1.0 - figure),
            "gap": (1.0 - figure, 1.0),
        }[self.reading]
        return above / below if below > 0.0 else None


def _verdict(low: float | None, high: float | None) -> str:
    """Better or worse if the whole interval is; else equal, because no difference is shown."""
    if low is not None and low > 1.0:
        return "better"
    return "worse" if high is not None and high < 1.0 else "equal"
