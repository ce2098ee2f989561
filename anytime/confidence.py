"""Bounds that hold at every moment, so that one may stop when they look good."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEVELS = np.concatenate([[0.001], np.linspace(0.0025, 0.1, 40), np.linspace(0.11, 1.0, 60)])
"""Bounds that can be stated."""
BOLDEST = 0.75  # share of the wealth that is bet on one value, at most


def mean_bounds(values: Floats, error: float) -> Floats:
    """An upper confidence sequence of means, [n, …], each one of `LEVELS`.

    values: [n, …], each in [-1, 1], in the order in which they came; columns apart. With
    probability 1 - `error` the mean lies below the bound at all n at once, so that stopping when
    one likes is allowed. Who bets against each level that values will lie below it cannot expect
    to gain while the mean is at least that, so a wealth of 1/`error` refutes it [Waudby-Smith &
    Ramdas 2024, §4]. The bet is the one that would have grown fastest on the values before.
    """
    count = np.arange(1, len(values) + 1, dtype=float).reshape(-1, *(1,) * (values.ndim - 1))
    mean = np.cumsum(values, axis=0) / (count + 1)
    spread = (0.25 + np.cumsum((values - mean) ** 2, axis=0)) / (count + 1)
    mean = np.concatenate([np.zeros_like(values[:1]), mean[:-1]])
    spread = np.concatenate([np.full_like(values[:1], 0.25), spread[:-1]])
    bounds = np.ones_like(values, dtype=float)
    refuted = np.ones(values.shape, dtype=bool)
    # From above: a bound stands on every level above it, else a lucky one among many would do.
    for level in LEVELS[::-1]:
        ahead = level - mean
        bet = np.clip(ahead / (spread + ahead**2), 0.0, BOLDEST)
        wealth = np.cumsum(np.log1p(bet * (level - values)), axis=0)
        refuted &= wealth >= math.log(1.0 / error)
        if not refuted.any():
            break
        bounds[refuted] = level
    return bounds


def regret_bounds(values: Floats, error: float = 0.05) -> tuple[NDArray[np.intp], Floats]:
    """The choice that looks best after each problem [n], and what the best may be better [n].

    values: [n, choices] quality in [0, 1] of each choice on each problem, the same problems for
    all. With probability 1 - `error` every bound holds, at all n at once, whatever was chosen: the
    error is shared by all ordered pairs, whose differences are paired by problem.
    """
    chosen = np.argmax(np.cumsum(values, axis=0), axis=1)
    bounds = np.zeros(len(values))
    for choice in np.unique(chosen):
        here = chosen == choice
        bounds[here] = _regrets(values, int(choice), error)[here]
    return chosen, bounds


def regret_bound(values: Floats, choice: int, error: float = 0.05) -> float:
    """What the best choice may be better than a given one, after all problems: `regret_bounds` for
    a choice that was found in some other way."""
    return float(_regrets(values, choice, error)[-1])


def _regrets(values: Floats, choice: int, error: float) -> Floats:
    count, choices = values.shape
    if choices < 2:
        return np.zeros(count)
    others = np.delete(values, choice, axis=1)
    return mean_bounds(others - values[:, [choice]], error / (choices * (choices - 1))).max(axis=1)


def problems_left(count: int, bound: float, wanted: float) -> int:
    """About how many problems more it takes until a bound is small enough, at most: it shrinks at
    least like the root of their number, and like their number where choices hardly differ."""
    if bound <= wanted:
        return 0
    return math.ceil(count * (bound / wanted) ** 2) - count
