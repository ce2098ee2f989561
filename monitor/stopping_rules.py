"""Ways to learn when to stop from recorded runs; `monitor.stopping` chooses among them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monitor.stopping import (
    STOP,
    TINY,
    History,
    Learner,
    Runs,
    Stop,
    StoppingRule,
    Task,
    until,
)
from monitor.stopping_regressions import blended, forecast, regression, true_of_seen

Floats = NDArray[np.float64]

LEVELS = 24  # of seen quality, in the tables
SLIGHT = 0.1  # weight of a run that is not like the one seen, against one that is
STIFF = 0.05  # of the slope of a local line
FEWEST = 10  # looks before a curve is projected


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


# The preferred first: what learns most from few runs. The fixed contract stands beside them always.
LEARNERS: Mapping[str, Learner] = {
    "blended": blended,
    "forecast": forecast,
    "regression": regression,
    "dynamic_programming": dynamic_programming,
    "projection": projection,
    "myopic": myopic,
}
