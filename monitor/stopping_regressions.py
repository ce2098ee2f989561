"""When to stop, by regressions on recorded runs: of what going on is worth, or will bring."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monitor.stopping import STOP, TINY, History, Runs, Stop, StoppingRule, Task, until

Floats = NDArray[np.float64]

LAGS = (0.0125, 0.0375, 0.1, 0.25)  # shares of the times over which slopes are taken
WINDOW = 0.25  # share of the times at either side that is pooled
RIDGE, RIDGE_OF_VALUES = 0.5, 0.2  # of standardised features, times the number of runs


def true_of_seen(runs: Runs) -> tuple[float, float]:
    """Quality as intercept + slope × seen, by least squares over the recorded runs."""
    seen, quality = runs.seen.ravel(), runs.quality.ravel()
    spread = float(seen.var())
    slope = float(np.cov(seen, quality, bias=True)[0, 1]) / spread if spread > 0 else 0.0
    return float(quality.mean() - slope * seen.mean()), slope


def blended(runs: Runs, task: Task) -> StoppingRule:
    """Stop when `forecast` and `regression` on average expect nothing of going on.

    From a few dozen runs each learns errors of its own, and half of them cancel. The regression is
    on what runs were worth that this very average stops.
    """
    features = _Features(runs)
    other = _by_forecast(runs, task, features)
    return _rule(runs, features, _by_values(runs, task, features, other))


def forecast(runs: Runs, task: Task) -> StoppingRule:
    """Forecast how much quality each further time will bring, and stop when none is worth it.

    One ridge regression a time, on all runs at the times around it, gives the gain to expect at
    every later time. It forecasts quality and not what going on is worth, as `regression` does:
    gains are a smoother thing to learn, so that neighbouring times can be pooled. It also sees for
    how long quality has not risen: runs have plateaus.
    """
    features = _Features(runs)
    return _rule(runs, features, _by_forecast(runs, task, features))


def regression(runs: Runs, task: Task) -> StoppingRule:
    """Regress what going on was worth on what was seen, backwards in time, and stop at ≤ 0.

    Least-squares Monte Carlo (Longstaff & Schwartz 2001), with a ridge because runs are few.
    """
    features = _Features(runs)
    return _rule(runs, features, _by_values(runs, task, features))


Expectation = Callable[[int, Floats], Floats]
"""What going on from the time of an index, not the last, is expected to be worth beyond stopping
there, [N], by the features of runs at that time, [N, F]."""


def _rule(runs: Runs, features: _Features, expected: Expectation) -> StoppingRule:
    def rule(history: History) -> float | Stop:
        if not len(history.seconds):
            return until(0.0, float(runs.seconds[0]))
        index, now = features.now(history)
        if index + 1 >= len(runs.seconds) or expected(index, now[None])[0] <= 0:
            return STOP
        return until(float(history.seconds[-1]), float(runs.seconds[index + 1]))

    return rule


def _by_forecast(runs: Runs, task: Task, features: _Features) -> Expectation:
    width = max(1, round(WINDOW * len(runs.seconds)))
    models = _gains(features.of_runs(runs), runs.quality, width)
    intercept, slope = true_of_seen(runs)

    def expected(index: int, seen: Floats) -> Floats:
        base, slopes = models[index]
        quality = intercept + slope * seen[:, :1]
        stay = task.utility(quality, runs.seconds[index])
        go = task.utility(quality + base + seen @ slopes, runs.seconds[index + 1 :])
        return (go - stay).max(axis=1) - task.look

    return expected


def _by_values(
    runs: Runs, task: Task, features: _Features, other: Expectation | None = None
) -> Expectation:
    """other: whose expectations are averaged with these."""
    seen, utilities = features.of_runs(runs), runs.utilities(task)
    beyond = np.zeros(len(runs))
    models: dict[int, tuple[Floats, Floats]] = {}

    def expected(index: int, seen: Floats) -> Floats:
        base, slopes = models[index]
        own = (base + seen[:, :-1] @ slopes)[:, 0]
        return own if other is None else (own + other(index, seen)) / 2

    for index in range(len(runs.seconds) - 2, -1, -1):
        gain = utilities[:, index + 1] - utilities[:, index] - task.look + beyond
        # Without the plateau: values of a single time are too few to learn one thing more.
        rows = np.column_stack([np.ones(len(runs)), seen[:, index, :-1]])
        models[index] = _ridge(rows.T @ rows, rows.T @ gain[:, None], RIDGE_OF_VALUES)
        beyond = np.where(expected(index, seen[:, index]) > 0, gain, 0.0)
    return expected


def _gains(seen: Floats, quality: Floats, width: int) -> list[tuple[Floats, Floats]]:
    """What quality gains from each time but the last to every later one, by what is seen then: a
    ridge regression each, intercepts [D] and slopes [F, D].

    seen: [N, T, F]. It learns from all runs at the times up to `width` around its own, the time
    being one more thing that is seen. Neighbouring regressions share most of their rows, so what
    they need of them, sums of products, is added up once for each time.
    """
    runs, count, _ = seen.shape
    times = np.arange(count)
    centre = seen.mean(axis=(0, 1))  # of numbers far from 0 sums of squares are inexact
    clock = np.broadcast_to(times[:, None], (runs, count, 1))
    rows = np.concatenate([np.ones((runs, count, 1)), seen - centre, clock - count / 2], axis=2)
    squares = np.zeros((count, rows.shape[2], rows.shape[2]))
    products = np.zeros((count, rows.shape[2], count - 1))
    for time in times[:-1]:
        now, later = rows[:, time], np.minimum(time + times[1:], count - 1)
        squares[time + 1] = squares[time] + now.T @ now
        gains = quality[:, later] - quality[:, time, None]
        products[time + 1] = products[time] + now.T @ gains
    models: list[tuple[Floats, Floats]] = []
    for time in times[:-1]:
        first, last = max(0, time - width), min(count - 1, time + width + 1)
        later = count - 1 - time
        base, slopes = _ridge(
            squares[last] - squares[first], (products[last] - products[first])[:, :later], RIDGE
        )
        base = base - centre @ slopes[:-1] + (time - count / 2) * slopes[-1]
        models.append((base, slopes[:-1]))
    return models


class _Features:
    """What regressions see of a run: its quality, its mean slopes over the last times, and for how
    long it has not risen."""

    def __init__(self, runs: Runs) -> None:
        self.seconds = runs.seconds
        count = len(runs.seconds)
        self.unit = float(np.median(np.diff(runs.seconds))) if count > 1 else 1.0
        self.lags = np.unique(np.maximum(1, np.rint(np.array(LAGS) * count))).astype(int)

    def of_runs(self, runs: Runs) -> Floats:
        """[N, T, F]."""
        times = np.arange(len(self.seconds))
        before = np.maximum(times[:, None] - self.lags, 0)
        over = np.maximum(times[:, None] - before, 1)
        slopes = (runs.seen[:, :, None] - runs.seen[:, before]) / over
        plateau = np.log1p(waited(runs.seconds, runs.seen) / self.unit)
        return np.concatenate([runs.seen[:, :, None], slopes, plateau[:, :, None]], axis=2)

    def now(self, history: History) -> tuple[int, Floats]:
        """(Index of the present time, [F])."""
        index = int(np.searchsorted(self.seconds, history.seconds[-1] - TINY))
        index = min(index, len(self.seconds) - 1)
        before = np.maximum(index - self.lags, 0)
        seen = history.quality[-1]
        then = np.interp(self.seconds[before], history.seconds, history.quality)
        slopes = (seen - then) / np.maximum(index - before, 1)
        still = waited(history.seconds, history.quality[None])[0, -1]
        return index, np.concatenate([[seen], slopes, [np.log1p(still / self.unit)]])


def waited(seconds: Floats, seen: Floats) -> Floats:
    """Seconds since quality rose last, at each time; seen: [N, T], result [N, T]."""
    rises = np.diff(seen, axis=1, prepend=seen[:, :1]) > TINY
    last = np.maximum.accumulate(np.where(rises, np.arange(len(seconds)), 0), axis=1)
    return seconds - seconds[last]


def _ridge(squares: Floats, products: Floats, penalty: float) -> tuple[Floats, Floats]:
    """Intercepts [D] and slopes [F, D] of a ridge regression on standardised features.

    squares: [1 + F, 1 + F], sums over its rows of products of a one and the features; products:
    [1 + F, D], of these with what is wanted.
    """
    rows, mean = squares[0, 0], squares[0, 1:] / squares[0, 0]
    middle = products[0] / rows
    spread = squares[1:, 1:] / rows - np.outer(mean, mean)
    joint = products[1:] / rows - np.outer(mean, middle)
    scale = np.sqrt(np.maximum(spread.diagonal(), 0.0)) + TINY
    spread = spread / np.outer(scale, scale) + penalty * np.eye(len(mean))
    slopes = np.linalg.solve(spread, joint / scale[:, None]) / scale[:, None]
    return middle - mean @ slopes, slopes
