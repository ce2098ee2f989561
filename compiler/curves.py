"""What contracts of different lengths are worth, as the sequences of them need it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.profiles import Profile
from compiler.tables import SHORTEST

Floats = NDArray[np.float64]
POINTS = 96  # lengths of a contract that are considered, at most


@dataclass(frozen=True)
class Curve:
    """A step function: the expected quality of a contract of each length.

    lengths: [K] seconds at which it rises, increasing. qualities: [K] from there on, increasing.
    Between two lengths a contract is worth what the shorter one is, so no others need be tried.
    sampled: only the lengths are known, as those of a contract module are that was measured at some
    lengths; what lies between them may be better than is promised.
    """

    lengths: Floats
    qualities: Floats
    sampled: bool = False

    @property
    def following(self) -> Floats:
        """The shortest contract that may be better than each step, [K + 1]: than none, than the
        first, …, than the last."""
        after = self.lengths[:-1] if self.sampled else self.lengths[1:]
        return np.concatenate([self.lengths[:1], after, [np.inf]])

    def quality(self, lengths: Floats) -> Floats:
        """Expected quality of contracts of these lengths, [n]; 0 below the shortest."""
        steps = np.concatenate([[0.0], self.qualities])
        return steps[np.searchsorted(self.lengths, lengths * (1 + 1e-12), side="right")]


def curve_of(profile: Profile) -> Curve:
    """The curve of a contract module's profile, measured at some lengths. Raises AnytimeError if it
    never has a result."""
    times = profile.times
    return replace(curve(times, profile.mean(times), profile.module), sampled=True)


def curve(lengths: Floats, qualities: Floats, name: str) -> Curve:
    """The curve through these points [n], where it rises; at most `POINTS` of them."""
    best = np.maximum.accumulate(qualities)
    rises = np.flatnonzero(np.diff(best, prepend=0.0) > 1e-9)
    if not len(rises):
        raise AnytimeError(
            f"{name!r} never has a result in its profile; measure it with more seconds"
        )
    lengths, best = np.maximum(lengths[rises], SHORTEST), best[rises]
    if len(best) > POINTS:
        kept = _spread(np.log(lengths)) | _spread(best)
        lengths, best = lengths[kept], best[kept]
    return Curve(lengths, best)


def _spread(values: Floats) -> NDArray[np.bool_]:
    """Half of the points, evenly over an increasing quantity [n]; the first and last are kept."""
    wanted: Floats = np.linspace(float(values[0]), float(values[-1]), POINTS // 2)
    chosen = np.zeros(len(values), dtype=np.bool_)
    chosen[np.clip(np.searchsorted(values, wanted), 0, len(values) - 1)] = True
    return chosen
