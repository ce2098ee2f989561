"""Comparing policies on the same seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float

    def under(self, key: str) -> dict[str, float]:
        """The figure as `key`, `key_low`, `key_high`."""
        return {key: self.value, f"{key}_low": self.low, f"{key}_high": self.high}


def bootstrap(
    columns: Sequence[Floats],
    figure: Callable[..., float],
    resamples: int = 2000,
    seed: int = 0,
) -> Estimate:
    """A figure of means over the same seeds, resampled together.

    columns: [seeds] each; figure: called with their means.
    """
    table = np.array(columns)
    value = float(figure(*table.mean(axis=1)))
    draws = np.random.default_rng(seed).integers(0, table.shape[1], (resamples, table.shape[1]))
    means = table[:, draws].mean(axis=2)
    sampled = np.array([figure(*means[:, i]) for i in range(resamples)])
    low, high = np.quantile(sampled, [0.025, 0.975])
    return Estimate(value, float(low), float(high))


def share_of_first(first: float, second: float) -> float:
    """(first − second) / first."""
    return (first - second) / first if first else 0.0


def margins(nets: Mapping[str, Floats]) -> dict[str, float]:
    """Paired margins of "monitored" over MIN, MAX and the fixed division, with intervals."""
    monitored = nets["monitored"]
    better = max(("min", "max"), key=lambda name: float(nets[name].mean()))
    found = bootstrap([monitored, nets[better]], share_of_first).under("value.margin")
    if "fixed" in nets:
        found |= bootstrap([monitored, nets["fixed"]], share_of_first).under("value.margin_fixed")
    worse = min(("min", "max"), key=lambda name: float(nets[name].mean()))
    found["value.worse_loses"] = share_of_first(float(monitored.mean()), float(nets[worse].mean()))
    return found
