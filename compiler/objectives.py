"""What a division of time is chosen for: an expectation, a probability, a quantile, a tail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError

Floats = NDArray[np.float64]
Utility = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class Objective:
    """What the distribution of a result's quality is worth; made by the functions below.

    kind: expected, at_least, quantile or cvar. parameter: quality or share. utility: of
    `expected`, of arrays of quality and of seconds since the start; None for the quality itself.
    """

    kind: str
    parameter: float = 0.0
    utility: Utility | None = None

    def __repr__(self) -> str:
        if self.kind == "expected":
            return "expected quality" if self.utility is None else "expected utility"
        return f"{self.kind}({self.parameter:g})"

    @property
    def additive(self) -> bool:
        """Whether it is the mean of something over what may come, which a policy can maximise."""
        return self.kind in ("expected", "at_least")

    @property
    def timeless(self) -> bool:
        """Whether it does not matter when the result comes, so long as it is in time."""
        return self.utility is None

    def worth(self, levels: Floats, seconds: Floats) -> Floats:
        """Of an additive objective, the worth of each level [L] at each time [...], [..., L].

        levels[0] stands for no result, which has quality 0. Raises AnytimeError for a utility
        that does not take arrays or gives what is not finite.
        """
        times = np.asarray(seconds, dtype=float)[..., None]
        if self.kind == "at_least":
            enough = (levels >= self.parameter) & (np.arange(len(levels)) > 0)
            return np.broadcast_to(enough.astype(float), (*times.shape[:-1], len(levels)))
        if self.utility is None:
            return np.broadcast_to(levels, (*times.shape[:-1], len(levels)))
        quality, times = np.broadcast_arrays(levels, times)
        try:
            found = np.broadcast_to(np.asarray(self.utility(quality, times), float), quality.shape)
        except Exception as error:
            raise AnytimeError(
                f"the utility failed on arrays of quality and seconds: {error}; write it with "
                "numpy, say numpy.maximum instead of max"
            ) from error
        if not np.isfinite(found).all():
            raise AnytimeError("the utility gives numbers that are not finite")
        return found

    def value(self, chances: Floats, levels: Floats, seconds: Floats) -> Floats:
        """The value of distributions over levels [..., L] that come at seconds [...]."""
        if self.additive:
            return np.asarray((chances * self.worth(levels, seconds)).sum(axis=-1))
        below = np.cumsum(chances, axis=-1)
        if self.kind == "quantile":
            place = (below < self.parameter - 1e-12).sum(axis=-1)
            return levels[np.minimum(place, len(levels) - 1)]
        tail = np.minimum(below, self.parameter)  # the worst runs, up to that share of all
        return np.diff(tail, axis=-1, prepend=0.0) @ levels / self.parameter


EXPECTED = Objective("expected")


def expected(utility: Utility | None = None) -> Objective:
    """The expected quality, or the expectation of a utility of quality and seconds.

    utility: called with arrays, say `lambda quality, seconds: quality - .1 * seconds`. With one,
    a program ends when more time is not worth it. No result has quality 0.
    """
    return Objective("expected", utility=utility)


def at_least(quality: float) -> Objective:
    """The probability of a result of this quality or better. Raises AnytimeError outside (0, 1]."""
    return Objective("at_least", _within("quality", quality))


def quantile(share: float) -> Objective:
    """The quality that all but a share of the runs reach. Raises AnytimeError outside (0, 1]."""
    return Objective("quantile", _within("share", share))


def cvar(share: float) -> Objective:
    """The mean quality of the worst share of the runs. Raises AnytimeError outside (0, 1]."""
    return Objective("cvar", _within("share", share))


def _within(name: str, value: float) -> float:
    if not 0 < value <= 1:
        raise AnytimeError(f"{name}={value}; give a number in (0, 1]")
    return float(value)
