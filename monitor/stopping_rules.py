"""Ways to learn when to stop from recorded runs; `monitor.stopping` chooses among them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monitor.stopping import (
    STOP,
    History,
    Learner,
    Runs,
    Stop,
    StoppingRule,
    Task,
)

Floats = NDArray[np.float64]

LEVELS = 24  # of seen quality, in the tables
SLIGHT = 0.1  # weight of a run that is not like the one seen, against one that is
STIFF = 0.05  # of the slope of a local line
LAGS = (0.0125, 0.0375, 0.1, 0.25)  # shares of the times over which slopes are taken
WINDOW = 0.25  # share of the times at either side that is pooled
RIDGE, RIDGE_OF_VALUES = 0.1, 0.2  # of standardised features, times the number of runs
FEWEST = 10  # looks before a curve is projected
TINY = 1e-9


def until(now: float, then: float) -> float:
    """Seconds from one time of a grid to a later one, as a rule returns them."""
    return max(then - now, TINY)


def true_of_seen(runs: Runs) -> tuple[float, float]:
    """Quality as intercept + slope × seen, by least squares over the recorded runs."""
    seen, quality = runs.seen.ravel(), runs.quality.ravel()
    spread = float(seen.var())
    slope = float(np.cov(seen, quality, bias=True)[0, 1]) / spread if spread > 0 else 0.0
    return float(quality.mean() - slope * seen.mean()), slope


def likeness(runs: Runs, index: int) -> tuple[Floats, Floats]:
    """Levels of seen quality at a time, [K], and the weight of each run at each level, [K, N].

    Weighting the runs' values is a local line fitted to them: counting transitions between bins
    learns noise from a few dozen runs, and a local mean would draw the extremes towards the middle.
    Rows sum to one.
    """
    seen = runs.seen[:, index]
    levels = np.linspace(seen.min(), seen.max(), LEVELS)
    width = max(float(seen.std()), TINY)
    off = (seen - levels[:, None]) / width
    weights = np.exp(-0.5 * np.square(off)) + SLIGHT
    total, first = weights.sum(axis=1, keepdims=True), (weights * off).sum(axis=1, keepdims=True)
    second = (weights * np.square(off)).sum(axis=1, keepdims=True) + STIFF * total
    weights = weights * (second - first * off)
    return levels, weights / weights.sum(axis=1, keepdims=True)


def nearest(levels: Floats, seen: Floats) -> NDArray[np.intp]:
    """Index of the nearest of equally spaced levels."""
    step = max(float(levels[1] - levels[0]), TINY)
    return np.clip(np.rint((seen - levels[0]) / step), 0, len(levels) - 1).astype(np.intp)


def dynamic_programming(runs: Runs, task: Task) -> StoppingRule:
    """When to look next, and whether to stop then or to decide anew.

    V(q, t) = max over the seconds to go on of the expected utility of stopping then, and of
    the expected V of having looked, less the cost of the look. Hansen & Zilberstein, Monitoring and
    control of anytime algorithms, Artificial Intelligence 126 (2001).
    """
    utilities, count = runs.utilities(task), len(runs.seconds)
    # What the level of each run at each time is worth beyond stopping there. Gains and not values
    # are averaged over like runs: a value would be smoothed once more at each step back in time.
    beyond = np.zeros(utilities.shape)
    scales: list[Floats] = []
    after = np.zeros((count, LEVELS), np.int64)  # steps to go on
    stops = np.ones((count, LEVELS), bool)
    for index in range(count - 1, -1, -1):
        levels, alike = likeness(runs, index)
        scales.append(levels)
        gains = utilities[:, index:] - utilities[:, index, None]
        stopping = alike @ gains
        looking = np.full_like(stopping, -np.inf)
        looking[:, 1:] = alike @ (gains + beyond[:, index:])[:, 1:] - task.look
        best = np.where(stopping >= looking, stopping, looking)
        after[index] = best.argmax(axis=1)
        chosen = np.arange(LEVELS), after[index]
        stops[index] = stopping[chosen] >= looking[chosen]
        beyond[:, index] = best[chosen][nearest(levels, runs.seen[:, index])]
    scales.reverse()
    blind = utilities.mean(axis=0)
    first = (utilities + beyond).mean(axis=0) - task.look

    def rule(history: History) -> float | Stop:
        if not len(history.seconds):
            if blind.max() >= first.max():
                return Stop(float(runs.seconds[blind.argmax()]))
            return until(0.0, float(runs.seconds[first.argmax()]))
        now = float(history.seconds[-1])
        index = min(int(np.searchsorted(runs.seconds, now - TINY)), count - 1)
        level = int(nearest(scales[index], history.quality[-1]))
        seconds = until(now, float(runs.seconds[index + after[index, level]]))
        if not stops[index, level]:
            return seconds
        return Stop(seconds) if after[index, level] > 0 else STOP

    return rule


def myopic(runs: Runs, task: Task) -> StoppingRule:
    """Stop as soon as the next look is not expected to be worth its cost.

    Right if gains never grow again. Hansen & Zilberstein (2001), section 3.
    """
    utilities = runs.utilities(task)
    gains: list[tuple[Floats, Floats]] = []
    for index in range(len(runs.seconds) - 1):
        levels, alike = likeness(runs, index)
        gains.append((levels, alike @ (utilities[:, index + 1] - utilities[:, index]) - task.look))

    def rule(history: History) -> float | Stop:
        if not len(history.seconds):
            return until(0.0, float(runs.seconds[0]))
        now = float(history.seconds[-1])
        index = int(np.searchsorted(runs.seconds, now - TINY))
        if index >= len(gains):
            return STOP
        levels, gain = gains[index]
        if gain[int(nearest(levels, history.quality[-1]))] <= 0:
            return STOP
        return until(now, float(runs.seconds[index + 1]))

    return rule


def projection(runs: Runs, task: Task) -> StoppingRule:
    """Fit a arctan(t + b) + c to what was seen, and stop when the best of the curve is past.

    Recorded runs tell only how true quality goes with the seen one. Svegliato, Wray & Zilberstein,
    Meta-level control of anytime algorithms with online performance prediction, IJCAI 2018.
    """
    base, slope = true_of_seen(runs)
    count = len(runs.seconds)
    unit = float(np.median(np.diff(runs.seconds))) if count > 1 else 1.0
    shifts = np.concatenate([-np.geomspace(1, count, 12)[::-1], [0.0], np.geomspace(1, count, 12)])
    curves = np.arctan(runs.seconds / unit + shifts[:, None])  # [B, T]

    def rule(history: History) -> float | Stop:
        seen = len(history.seconds)
        now = float(history.seconds[-1]) if seen else 0.0
        index = int(np.searchsorted(runs.seconds, now - TINY)) if seen else -1
        if index + 1 >= count:
            return STOP
        ahead = until(now, float(runs.seconds[index + 1]))
        if seen < FEWEST:
            return ahead
        fitted = np.arctan(history.seconds / unit + shifts[:, None])
        level = fitted - fitted.mean(axis=1, keepdims=True)
        quality = history.quality - history.quality.mean()
        spread = np.maximum(np.square(level).sum(axis=1), TINY)
        steepness = level @ quality / spread
        missed = np.square(quality - steepness[:, None] * level).sum(axis=1)
        best = int(missed.argmin())
        projected = history.quality[-1] + steepness[best] * (
            curves[best, index:] - curves[best, index]
        )
        worth = task.utility(base + slope * projected, runs.seconds[index:])
        return ahead if worth[1:].max() - task.look > worth[0] else STOP

    return rule


class _Features:
    """What regressions see of a run: its quality, and its mean slopes over the last times."""

    def __init__(self, runs: Runs) -> None:
        self.seconds = runs.seconds
        count = len(runs.seconds)
        self.lags = np.unique(np.maximum(1, np.rint(np.array(LAGS) * count))).astype(int)

    def of_runs(self, runs: Runs) -> Floats:
        """[N, T, F]."""
        times = np.arange(len(self.seconds))
        before = np.maximum(times[:, None] - self.lags, 0)
        over = np.maximum(times[:, None] - before, 1)
        slopes = (runs.seen[:, :, None] - runs.seen[:, before]) / over
        return np.concatenate([runs.seen[:, :, None], slopes], axis=2)

    def now(self, history: History) -> tuple[int, Floats]:
        """(Index of the present time, [F])."""
        index = int(np.searchsorted(self.seconds, history.seconds[-1] - TINY))
        index = min(index, len(self.seconds) - 1)
        before = np.maximum(index - self.lags, 0)
        seen = history.quality[-1]
        then = np.interp(self.seconds[before], history.seconds, history.quality)
        return index, np.append(seen, (seen - then) / np.maximum(index - before, 1))


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


def regression(runs: Runs, task: Task) -> StoppingRule:
    """Regress what going on was worth on what was seen, backwards in time, and stop at ≤ 0.

    Least-squares Monte Carlo (Longstaff & Schwartz 2001), with a ridge because runs are few.
    """
    features = _Features(runs)
    seen, utilities = features.of_runs(runs), runs.utilities(task)
    count = len(runs.seconds)
    beyond = np.zeros(len(runs))
    models: list[tuple[Floats, Floats]] = []
    for index in range(count - 2, -1, -1):
        gain = utilities[:, index + 1] - utilities[:, index] - task.look + beyond
        rows = np.column_stack([np.ones(len(runs)), seen[:, index]])
        base, slopes = _ridge(rows.T @ rows, rows.T @ gain[:, None], RIDGE_OF_VALUES)
        models.append((base, slopes))
        beyond = np.where((base + seen[:, index] @ slopes)[:, 0] > 0, gain, 0.0)
    models.reverse()

    def rule(history: History) -> float | Stop:
        if not len(history.seconds):
            return until(0.0, float(runs.seconds[0]))
        index, now = features.now(history)
        if index >= len(models):
            return STOP
        base, slopes = models[index]
        if float((base + now @ slopes)[0]) <= 0:
            return STOP
        return until(float(history.seconds[-1]), float(runs.seconds[index + 1]))

    return rule


def forecast(runs: Runs, task: Task) -> StoppingRule:
    """Forecast how much quality each further time will bring, and stop when none is worth it.

    One ridge regression a time, on all runs at the times around it, gives the gain to expect at
    every later time. It forecasts quality and not what going on is worth, as `regression` does:
    gains are a smoother thing to learn, so that neighbouring times can be pooled. It also sees for
    how long quality has not risen: runs have plateaus.
    """
    features, count = _Features(runs), len(runs.seconds)
    unit = float(np.median(np.diff(runs.seconds))) if count > 1 else 1.0
    plateau = np.log1p(waited(runs.seconds, runs.seen) / unit)
    seen = np.concatenate([features.of_runs(runs), plateau[:, :, None]], axis=2)
    models = _gains(seen, runs.quality, max(1, round(WINDOW * count)))
    intercept, slope = true_of_seen(runs)

    def rule(history: History) -> float | Stop:
        if not len(history.seconds):
            return until(0.0, float(runs.seconds[0]))
        index, now = features.now(history)
        if index >= len(models):
            return STOP
        base, slopes = models[index]
        still = waited(history.seconds, history.quality[None])[0, -1]
        now = np.append(now, np.log1p(still / unit))
        quality = np.array(intercept + slope * history.quality[-1])
        stay = task.utility(quality, runs.seconds[index])
        go = task.utility(quality + base + now @ slopes, runs.seconds[index + 1 :])
        if go.max() - task.look <= stay:
            return STOP
        return until(float(history.seconds[-1]), float(runs.seconds[index + 1]))

    return rule


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


# The preferred first: what learns most from few runs. The fixed contract stands beside them always.
LEARNERS: Mapping[str, Learner] = {
    "forecast": forecast,
    "regression": regression,
    "dynamic_programming": dynamic_programming,
    "projection": projection,
    "myopic": myopic,
}
