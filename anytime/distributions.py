"""A distribution of quality, in which having no result at all is a level of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Distribution:
    """A distribution of quality: values [n] in [0, 1], NaN = no result; weights [n], sum 1."""

    values: Floats
    weights: Floats

    @property
    def mean(self) -> float:
        """Expected quality; no result counts 0."""
        return float(self.weights @ np.nan_to_num(self.values))

    @property
    def no_result(self) -> float:
        """Probability that there is no result at all."""
        return float(self.weights[np.isnan(self.values)].sum())

    def at_least(self, quality: float) -> float:
        """Probability of a result of this quality or better."""
        return float(self.weights[np.nan_to_num(self.values, nan=-1.0) >= quality].sum())

    def quantile(self, share: float) -> float:
        """The quality that a share of the runs stays below; NaN where that is no result.

        Raises AnytimeError for a share outside [0, 1].
        """
        if not 0 <= share <= 1:
            raise AnytimeError(f"a share of {share} of the runs; give one in [0, 1]")
        order = np.argsort(np.nan_to_num(self.values, nan=-1.0), kind="stable")
        order = order[self.weights[order] > 0]
        cumulative = np.cumsum(self.weights[order])
        index = min(int(np.searchsorted(cumulative, share - 1e-12)), len(order) - 1)
        return float(self.values[order[index]])
