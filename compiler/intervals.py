"""How sure a mean is: 95 % intervals that hold for any distribution of quality."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
CONFIDENCE = 0.95
DRAWS = 2000


def mean_interval(values: Floats, confidence: float = CONFIDENCE) -> tuple[Floats, Floats]:
    """An interval of the means of qualities, [n, k] of n problems: low [k], high [k].

    Gaffke's bounds: the quantiles of Bayesian bootstrap means to which the worst that could be,
    0 for the low end and 1 for the high one, is added as one more value. For shares it is Clopper
    and Pearson's interval, and no distribution on [0, 1] is known for which it covers less often
    than it says, however skewed and however few the problems. [Gaffke 2005; Learned-Miller and
    Thomas 2020, "A new confidence interval for the mean of a bounded random variable"]
    """
    weights = _weights(len(values))
    means = weights[:, 1:] @ values
    tail = (1.0 - confidence) / 2.0
    low = np.quantile(means, tail, axis=0)
    high = np.quantile(means + weights[:, :1], 1.0 - tail, axis=0)
    middle = values.mean(axis=0)
    return np.clip(low, 0.0, middle), np.clip(high, middle, 1.0)


def bootstrap_means(values: Floats) -> Floats:
    """Means [draws, k] of values [n, k] of n problems by the Bayesian bootstrap."""
    return _weights(len(values) - 1) @ values


@cache
def _weights(count: int) -> Floats:
    """Weights of the Bayesian bootstrap, [DRAWS, 1 + count], the first that of the end."""
    return np.random.default_rng(0).dirichlet(np.ones(1 + count), size=DRAWS)
