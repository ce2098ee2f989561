"""Sequences of contracts that make an interruptible algorithm, exact for a given profile.

An interrupted sequence has the result of the best contract that is done. [RZ91] doubles lengths;
here they are the best ones for a profile, by dynamic programming over what is done and when.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from compiler.curves import Curve
from compiler.deadlines import Survival

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class _Labels:
    """Sequences of contracts, each by what matters for its continuation.

    ends: [n] seconds when the last contract is done. worth: [n] what is to be as great as possible.
    levels: [n] the last contract's place in the curve, 0 = none. before: [n] the label it extends.
    """

    ends: Floats
    worth: Floats
    levels: Indices
    before: Indices


# (labels, ends after one contract more [n], its level) -> worth after it [n]
_Worth = Callable[[_Labels, Floats, int], Floats]


def best_sequence(curve: Curve, survival: Survival, ratio: float = math.inf) -> tuple[float, ...]:
    """Lengths of the contracts with the greatest expected quality at the interruption, in seconds.

    The optimum of [ZCC03] without a grid of times. Contracts whose length is no step of the curve,
    or that are not longer than one before, gain nothing, so a sequence is a rising choice of steps.
    ratio: at no time may it be behind a contract of that time / ratio. What follows where no
    interruption is expected any more doubles.
    Raises AnytimeError if no sequence keeps the ratio, or if every interruption is too early.
    """
    qualities = np.concatenate([[0.0], curve.qualities])

    def worth(labels: _Labels, ends: Floats, level: int) -> Floats:
        gained = qualities[level] - qualities[labels.levels]
        return labels.worth + survival(ends) * gained

    def hope(ends: Floats, level: int) -> Floats:
        """More than any continuation gains: the whole rest with the next step."""
        if level == len(curve.lengths):
            return np.zeros_like(ends)
        return survival(ends + curve.lengths[level]) * (qualities[-1] - qualities[level])

    labels = _extended(curve, worth, ratio, hope if math.isinf(ratio) else None)
    whole = np.flatnonzero(labels.levels == len(curve.lengths))
    ending = np.arange(len(labels.ends)) if math.isinf(ratio) else whole
    if not len(ending):
        raise AnytimeError(
            f"no sequence of contracts keeps within {ratio:g} times the time of one contract for "
            f"this profile; the least ratio is {least_ratio(curve):.4g}"
        )
    best = int(ending[np.argmax(labels.worth[ending])])
    if labels.worth[best] <= 0:
        raise AnytimeError(
            "every interruption comes before the first result, which takes "
            f"{curve.lengths[0]:.4g} s; there is no time to think"
        )
    lengths: list[float] = []
    while labels.levels[best]:
        lengths.insert(0, float(curve.lengths[labels.levels[best] - 1]))
        best = int(labels.before[best])
    while lengths[-1] < curve.lengths[-1]:
        lengths.append(min(2 * lengths[-1], float(curve.lengths[-1])))
    return tuple(lengths)


def least_ratio(curve: Curve) -> float:
    """The least acceleration ratio that a sequence can have for this profile: at most 4, and more
    only where lengths that were measured lie far apart."""
    following = curve.following

    def worth(labels: _Labels, ends: Floats, level: int) -> Floats:
        return np.minimum(labels.worth, -ends / following[labels.levels])

    labels = _extended(curve, worth, math.inf, None)
    return -float(labels.worth[labels.levels == len(curve.lengths)].max())


def expected_quality(curve: Curve, lengths: tuple[float, ...], survival: Survival) -> float:
    """Expected quality at the interruption of contracts run one after the other."""
    reached = np.maximum.accumulate(curve.quality(np.array(lengths)))
    return float(survival(np.cumsum(lengths)) @ np.diff(reached, prepend=0.0))


def acceleration_ratio(curve: Curve, lengths: tuple[float, ...]) -> float:
    """How many times as long as a single contract the sequence takes, at worst, to be as good
    [RZ91]; inf if there is a quality that it never reaches."""
    reached = np.searchsorted(curve.lengths, np.array(lengths) * (1 + 1e-12), side="right")
    before = np.concatenate([[0], np.maximum.accumulate(reached)])
    if before[-1] < len(curve.lengths):
        return math.inf
    gains = before[:-1] < len(curve.lengths)
    return float((np.cumsum(lengths) / curve.following[before[:-1]])[gains].max())


def doubled(curve: Curve, first: float) -> tuple[float, ...]:
    """Contracts each twice as long as the last, until one is as long as is of use [RZ91]."""
    lengths = [first]
    while lengths[-1] < curve.lengths[-1]:
        lengths.append(2 * lengths[-1])
    return tuple(lengths)


def tuned_doubling(curve: Curve, survival: Survival) -> tuple[float, ...]:
    """Doubling from the first length that is best for this interruption.

    Between two lengths at which some contract reaches a step of the curve, the shorter is better.
    """
    doublings = int(np.ceil(np.log2(curve.lengths[-1] / curve.lengths[0]))) + 1
    powers = 2.0 ** np.arange(doublings + 1)
    firsts = (curve.lengths[:, None] / powers).ravel()
    firsts = np.unique(firsts[firsts >= curve.lengths[0]])
    lengths = firsts[:, None] * powers
    gained = np.diff(curve.quality(lengths), axis=1, prepend=0.0)
    expected = (survival(np.cumsum(lengths, axis=1)) * gained).sum(axis=1)
    return doubled(curve, float(firsts[expected.argmax()]))


def _extended(
    curve: Curve,
    worth: _Worth,
    ratio: float,
    hope: Callable[[Floats, int], Floats] | None,
) -> _Labels:
    """All sequences worth having, level by level: of two that end with the same contract, one that
    is done no later and is worth no less is kept.

    hope: what a continuation may add at most; sequences that cannot become the best are dropped.
    """
    following = curve.following
    start = np.zeros(1, dtype=np.intp)
    labels = _Labels(np.zeros(1), np.zeros(1), start, start)
    best = -math.inf
    for level, length in enumerate(curve.lengths, start=1):
        ends = labels.ends + length
        value = worth(labels, ends, level)
        kept = np.flatnonzero(ends <= ratio * following[labels.levels] * (1 + 1e-12))
        if hope is not None and len(kept):
            best = max(best, float(value[kept].max()))
            kept = kept[value[kept] + hope(ends[kept], level) >= best - 1e-12]
        kept = kept[np.lexsort((-value[kept], ends[kept]))]
        ahead = np.maximum.accumulate(np.concatenate([[-math.inf], value[kept]]))[:-1]
        kept = kept[value[kept] > ahead + 1e-12]
        labels = _Labels(
            np.concatenate([labels.ends, ends[kept]]),
            np.concatenate([labels.worth, value[kept]]),
            np.concatenate([labels.levels, np.full(len(kept), level, dtype=np.intp)]),
            np.concatenate([labels.before, kept]),
        )
    return labels
