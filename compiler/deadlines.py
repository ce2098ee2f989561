"""Deadlines that are not known: how likely it is that an interruption has not yet come."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from compiler.curves import Curve

Floats = NDArray[np.float64]
Survival = Callable[[Floats], Floats]  # seconds [n] -> probability that there is still time, [n]
WORST = 4.0  # acceleration ratio of doubling, and of the best sequence for any profile [ZCC03]


@runtime_checkable
class Distribution(Protocol):
    """Any distribution of seconds with a survival function, such as those of scipy.stats."""

    def sf(self, x: Any, /) -> Any: ...


Interruption = float | Sequence[float] | Distribution


def survival_of(interruption: Interruption) -> Survival:
    """The survival function of an interruption: a time that is predicted, times that were observed,
    or a distribution.

    Raises AnytimeError for times that are not finite and positive, and for a function that is none.
    """
    if isinstance(interruption, Distribution):
        distribution = interruption
        around = np.concatenate([[0.0], np.geomspace(1e-6, 1e9, 61)])
        chances = np.asarray(distribution.sf(around), dtype=float)
        if chances.shape != around.shape or not _falls(chances):
            raise AnytimeError(
                f"{interruption!r}.sf is no survival function; it must fall from 1 towards 0"
            )
        return lambda seconds: np.asarray(distribution.sf(seconds), dtype=float)
    times = np.sort(np.atleast_1d(np.asarray(interruption, dtype=float)))
    if times.ndim != 1 or not len(times) or not (np.isfinite(times) & (times > 0)).all():
        raise AnytimeError(
            "an interruption is a time in seconds, a list of observed times, or a distribution "
            f"with .sf, as those of scipy.stats; not {interruption!r}"[:200]
        )
    # What is finished at the very moment of the interruption is there.
    return lambda seconds: 1 - np.searchsorted(times, seconds * (1 - 1e-12)) / len(times)


def _falls(chances: Floats) -> bool:
    steady = bool((np.diff(chances) <= 1e-9).all())
    return steady and 0 < chances[0] <= 1 + 1e-9 and float(chances.min()) >= -1e-9


def log_uniform(curve: Curve) -> Survival:
    """An interruption of which nothing is known: no order of magnitude is likelier than another,
    from the shortest contract until the longest one is done whatever the sequence."""
    low, high = float(curve.lengths[0]), WORST * float(curve.lengths[-1])
    span = math.log(high / low)
    return lambda seconds: 1 - np.clip(np.log(np.maximum(seconds, low) / low) / span, 0.0, 1.0)
