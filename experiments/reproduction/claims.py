"""What a paper claims, and whether it holds of us."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from experiments.benchmarks.figures import share_bounds
from experiments.reproduction.ways import Way

ENOUGH = 30
"""Draws below which nothing is said to hold."""
_ALWAYS = 0.95  # share of the seeds that show a behaviour which the paper claims


@dataclass(frozen=True)
class Value:
    """One figure of a claim.

    kind: "mean", over what the paper ran; "drawing", what it printed of a single run; "behaviour",
    1 where a run shows it. better: which side of the paper's figure is better, "less", "more", or
    "neither". name: "" of the claim's main figure.
    """

    paper: float
    kind: Literal["mean", "drawing", "behaviour"]
    better: Literal["less", "more", "neither"] = "neither"
    name: str = ""


@dataclass(frozen=True)
class Claim:
    """A claim: what the paper says, its figures, and how one draw of them is measured.

    draw: given a seed and the way in which plans are made, one number for each of `values`; NaN
    if this seed shows nothing.
    """

    name: str
    text: str
    values: tuple[Value, ...]
    draw: Callable[[int, Way], tuple[float, ...]]


@dataclass(frozen=True)
class Verdict:
    """Our figure, its bounds, and whether the paper's holds.

    Of a mean and a behaviour, `low` and `high` are a 95 % interval; of a drawing, `ours` is the
    median, and they are the 5th and the 95th percentile.
    """

    ours: float
    low: float
    high: float
    held: bool


def behaviour(claim: str, text: str, draw: Callable[[int, Way], bool]) -> Claim:
    """A claim that the robot, or the search, always does something."""
    return Claim(claim, text, (Value(1.0, "behaviour"),), _Shown(draw))


@dataclass(frozen=True)
class _Shown:
    draw: Callable[[int, Way], bool]

    def __call__(self, seed: int, way: Way) -> tuple[float, ...]:
        return (float(self.draw(seed, way)),)


def judge(value: Value, draws: Sequence[float]) -> Verdict:
    """Whether a figure of the paper holds, by the rule of its kind.

    A mean: our interval contains it, or lies on its better side. A drawing: it lies between our
    5th and 95th percentile, or our median is better. A behaviour: 95 % of the draws show it.
    Fewer than `ENOUGH` draws that show anything hold nothing.
    """
    seen = np.array([draw for draw in draws if not math.isnan(draw)])
    if len(seen) == 0:
        return Verdict(math.nan, math.nan, math.nan, False)
    if value.kind == "drawing":
        low, ours, high = (float(q) for q in np.quantile(seen, [0.05, 0.5, 0.95]))
        held = low <= value.paper <= high or _better(value, ours)
    else:
        ours = float(seen.mean())
        low, high = _interval(seen)
        holds = low <= value.paper <= high or _better(value, low) or _better(value, high)
        held = ours >= _ALWAYS if value.kind == "behaviour" else holds
    return Verdict(ours, low, high, held and len(seen) >= ENOUGH)


def _better(value: Value, ours: float) -> bool:
    if value.better == "neither":
        return False
    return ours <= value.paper if value.better == "less" else ours >= value.paper


def _interval(seen: np.ndarray) -> tuple[float, float]:
    """95 % around a mean; exact where it is a share."""
    if np.isin(seen, (0.0, 1.0)).all():
        return share_bounds(int(seen.sum()), len(seen))
    half = 1.96 * float(seen.std(ddof=1)) / math.sqrt(len(seen))
    return float(seen.mean()) - half, float(seen.mean()) + half
