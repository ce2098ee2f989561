"""What a benchmark hands back: named figures, how they were obtained, and with which seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import beta, binom

Figures = dict[str, float | int | None]
RESAMPLES = 2000
UNBOUNDED = (
    "without bound: what it is divided by may be nothing, or the level is not always reached"
)


@dataclass(frozen=True)
class Benchmark:
    """The outcome of one benchmark.

    `figures` maps dotted names (`paper.q_128_r20`) to numbers; None means "not measurable here",
    and then `settings["not_measured"][name]` gives the reason. `picture` draws the benchmark into a
    file, for those that can be drawn.
    """

    name: str
    figures: Mapping[str, float | int | None]
    settings: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    picture: Callable[[Path], Path] | None = None


def reasons(found: Benchmark) -> dict[str, str]:
    """Why each figure that is None is; an end of an interval that is None has no bound."""
    told: Any = found.settings.get("not_measured", {})
    ends = (key for key, value in found.figures.items() if value is None)
    return {key: UNBOUNDED for key in ends if key.endswith(("_low", "_high"))} | told


def share_interval(key: str, held: Sequence[bool]) -> Figures:
    """A share as a figure, `key`, with its bounds `key_low`, `key_high`. held: of each instance, at
    least one."""
    count, successes = len(held), sum(held)
    low, high = share_bounds(successes, count)
    return {key: successes / count, f"{key}_low": low, f"{key}_high": high}


def share_bounds(successes: int, count: int) -> tuple[float, float]:
    """A 95 % interval of a share: Clopper and Pearson's, which covers at least as often as that."""
    low = float(beta.ppf(0.025, successes, count - successes + 1)) if successes else 0.0
    high = float(beta.ppf(0.975, successes + 1, count - successes)) if successes < count else 1.0
    return low, high


def median_interval(key: str, values: ArrayLike) -> Figures:
    """A median as a figure, with its bounds. values: of each repetition, at least one.

    The bounds are order statistics, which cover a median at least 95 times in 100 whatever the
    distribution is; of fewer than six repetitions they are the extremes, which cover less often.
    """
    ordered = np.sort(np.asarray(values, float))
    outside = max(1, int(binom.ppf(0.025, len(ordered), 0.5)))
    low, high = ordered[outside - 1], ordered[-outside]
    return {key: float(np.median(ordered)), f"{key}_low": float(low), f"{key}_high": float(high)}


def ratio_interval(key: str, first: ArrayLike, second: ArrayLike) -> Figures:
    """The mean of the first over that of the second as a figure, with its bounds.

    first, second: [instances] on the same instances, resampled together. None where the second may
    be 0 as well.
    """
    pairs = np.column_stack([first, second]).astype(float)
    drawn = np.random.default_rng(0).integers(len(pairs), size=(RESAMPLES, len(pairs)))
    one, other = pairs[drawn].mean(axis=1).T
    return bounded(key, _divided(*pairs.mean(axis=0)), _divided(one, other))


def bounded(key: str, value: float | np.ndarray, drawn: ArrayLike) -> Figures:
    """A figure with what 95 % of its resamples lie between; None for what is not finite."""
    seen = np.asarray(drawn, float)
    low = np.quantile(seen, 0.025, method="lower")
    high = np.quantile(seen, 0.975, method="higher")
    told = {key: float(value), f"{key}_low": float(low), f"{key}_high": float(high)}
    return {name: number if np.isfinite(number) else None for name, number in told.items()}


def _divided(one: ArrayLike, other: ArrayLike) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(one, float) / np.asarray(other, float)
