"""Intervals that hold at every moment, so that one may stop when they look good."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def mean_radius(values: Floats, error: float) -> tuple[Floats, Floats]:
    """A confidence sequence of means: centres [n, …] and radii [n, …].

    values: [n, …], each in [0, 1], in the order in which they came; columns apart. With
    probability 1 - `error` the mean lies within the radius of the centre above (or below) at all n
    at once, so that stopping when one likes is allowed. Predictable plug-in empirical Bernstein
    [Waudby-Smith & Ramdas 2024, Theorem 2], one side.
    """
    count = np.arange(1, len(values) + 1, dtype=float).reshape(-1, *(1,) * (values.ndim - 1))
    middle = (0.5 + np.cumsum(values, axis=0)) / (count + 1)
    spread = (0.25 + np.cumsum((values - middle) ** 2, axis=0)) / (count + 1)
    before = np.concatenate([np.full_like(values[:1], 0.5), middle[:-1]])
    known = np.concatenate([np.full_like(values[:1], 0.25), spread[:-1]])
    budget = math.log(1.0 / error)
    bet = np.minimum(np.sqrt(2.0 * budget / (known * count * np.log1p(count))), 0.5)
    cost = (-np.log1p(-bet) - bet) / 4.0
    total = np.cumsum(bet, axis=0)
    centre = np.cumsum(bet * values, axis=0) / total
    risk = np.cumsum(4.0 * (values - before) ** 2 * cost, axis=0)
    return centre, (budget + risk) / total


def regret_bounds(values: Floats, error: float = 0.05) -> tuple[NDArray[np.intp], Floats]:
    """The choice that looks best after each problem [n], and what the best may be better [n].

    values: [n, choices] quality in [0, 1] of each choice on each problem, the same problems for
    all. With probability 1 - `error` every bound holds, at all n at once, whatever was chosen: the
    error is shared by all ordered pairs, whose differences are paired by problem.
    """
    count, choices = values.shape
    chosen = np.argmax(np.cumsum(values, axis=0), axis=1)
    if choices < 2:
        return chosen, np.zeros(count)
    pairs = choices * (choices - 1)
    bounds = np.zeros(count)
    for choice in np.unique(chosen):
        differences = (values - values[:, [choice]] + 1.0) / 2.0
        centre, radius = mean_radius(differences, error / pairs)
        upper = np.minimum(2.0 * (centre + radius) - 1.0, 1.0)
        upper[:, choice] = 0.0
        here = chosen == choice
        bounds[here] = np.maximum(upper, 0.0).max(axis=1)[here]
    return chosen, bounds


def problems_left(count: int, bound: float, wanted: float) -> int:
    """About how many problems more it takes until a bound is small enough: it shrinks like the
    root of their number."""
    if bound <= wanted:
        return 0
    return math.ceil(count * (bound / wanted) ** 2) - count
