"""The moving-peaks benchmark, scenario 2: the standard of optimising while the world changes.

Ten cones in five dimensions move, grow and shrink after every 5,000 evaluations; offline error is
the mean over all evaluations of the error of the best point found since the last change.
[Branke 1999], with the numbers of `deap.benchmarks.movingpeaks.SCENARIO_2`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from experiments.benchmarks.rivals.trail import Stop

DIMENSIONS, PEAKS, PERIOD = 5, 10, 5000
LOW, HIGH = 0.0, 100.0
SEVERITY = 1.0
"""Length of a peak's move at a change."""
_CORRELATION = 0.5
_HEIGHTS, _HEIGHT_SEVERITY, _FIRST_HEIGHT = (30.0, 70.0), 7.0, 50.0
_WIDTHS, _WIDTH_SEVERITY = (1.0, 12.0), 1.0

Floats = NDArray[np.float64]


def peaks(rng: Any, w: Any) -> float:
    """A point of the landscape, and how far below the highest peak it lies."""
    x0, x1 = rng.uniform("x", 0.0, 100.0), rng.uniform("x", 0.0, 100.0)
    x2, x3 = rng.uniform("x", 0.0, 100.0), rng.uniform("x", 0.0, 100.0)
    x4 = rng.uniform("x", 0.0, 100.0)
    highest = -math.inf
    for i in range(w.peak_count):
        d0, d1 = x0 - w.positions[i, 0], x1 - w.positions[i, 1]
        d2, d3 = x2 - w.positions[i, 2], x3 - w.positions[i, 3]
        d4 = x4 - w.positions[i, 4]
        apart = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3 + d4 * d4)
        value = w.heights[i] - w.widths[i] * apart
        if value > highest:
            highest = value
    return w.optimum - highest


def _reflected(values: Floats, low: float, high: float) -> tuple[Floats, NDArray[np.bool_]]:
    """The values folded back at the bounds that they cross, and which those are."""
    crossed = (values < low) | (values > high)
    folded = 2.0 * np.where(values < low, low, high) - values
    return np.where(crossed, folded, values), crossed


class Landscape:
    """The peaks of scenario 2: float arrays of positions [10, 5], heights [10], widths [10].

    Draws in the order of DEAP's MovingPeaks: from equal draws, an equal landscape for ever.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.positions: Floats = rng.uniform(LOW, HIGH, (PEAKS, DIMENSIONS))
        self.heights: Floats = np.full(PEAKS, _FIRST_HEIGHT)
        self.widths: Floats = rng.uniform(*_WIDTHS, PEAKS)
        self._shifts: Floats = rng.random((PEAKS, DIMENSIONS)) - 0.5

    @property
    def optimum(self) -> float:
        """The height of the highest peak."""
        return float(self.heights.max())

    def values(self, points: Floats) -> Floats:
        """The height [n] of the landscape at points [n, 5]."""
        apart = points[:, None, :] - self.positions
        return (self.heights - self.widths * np.sqrt((apart * apart).sum(axis=2))).max(axis=1)

    def world(self) -> dict[str, Any]:
        """What the program `peaks` reads."""
        return {
            "peak_count": PEAKS,
            "positions": self.positions.copy(),
            "heights": self.heights.copy(),
            "widths": self.widths.copy(),
            "optimum": self.optimum,
        }

    def change(self) -> None:
        """Move every peak by the severity, half along its last move; redraw height and width."""
        rng = self._rng
        shifts, (heights, widths) = np.empty_like(self._shifts), np.empty((2, PEAKS))
        for i in range(PEAKS):
            shifts[i] = rng.random(DIMENSIONS) - 0.5
            heights[i], widths[i] = rng.normal(), rng.normal()
        shifts *= SEVERITY / np.sqrt((shifts * shifts).sum(axis=1, keepdims=True))
        shifts = (1.0 - _CORRELATION) * shifts + _CORRELATION * self._shifts
        shifts *= SEVERITY / np.sqrt((shifts * shifts).sum(axis=1, keepdims=True))
        self.positions, crossed = _reflected(self.positions + shifts, LOW, HIGH)
        self._shifts = np.where(crossed, -shifts, shifts)
        self.heights, _ = _reflected(self.heights + _HEIGHT_SEVERITY * heights, *_HEIGHTS)
        self.widths, _ = _reflected(self.widths + _WIDTH_SEVERITY * widths, *_WIDTHS)


class Course:
    """A run of so many periods of 5,000 evaluations, and its offline error.

    An optimiser calls `evaluate`, or evaluates `landscape` natively and reports with `charge`;
    either raises Stop at the end. It is not told when the landscape changes, which happens between
    two evaluations, unless it looks at `changes`.
    """

    def __init__(self, landscape: Landscape, periods: int) -> None:
        if periods < 1:
            raise AnytimeError(f"{periods} periods; choose 1 or more")
        self.landscape = landscape
        self.changes = 0
        self.evaluations = 0
        self._end = periods * PERIOD
        self._error = math.inf
        self._sum = 0.0

    @property
    def remaining(self) -> int:
        """Evaluations before the landscape changes."""
        return PERIOD - self.evaluations % PERIOD

    @property
    def offline_error(self) -> float:
        """The mean over all evaluations of the best error since the last change."""
        return self._sum / self.evaluations if self.evaluations else math.inf

    def evaluate(self, points: Floats) -> Floats:
        """The heights [n] at points [n, 5], higher is better; each point is an evaluation."""
        heights = []
        while len(points):
            part, points = points[: self.remaining], points[self.remaining :]
            heights.append(self.landscape.values(part))
            self._account(self.landscape.optimum - heights[-1])
        return np.concatenate(heights) if heights else np.empty(0)

    def charge(self, errors: Floats) -> None:
        """Count evaluations made natively, whose errors [n] these are, in their order.

        Raises AnytimeError for more than `remaining`: the landscape changes between them.
        """
        if not 0 < len(errors) <= self.remaining:
            raise AnytimeError(
                f"{len(errors)} evaluations at once; charge 1 to {self.remaining}, as many as "
                "remain before the next change"
            )
        self._account(errors)

    def _account(self, errors: Floats) -> None:
        best = np.minimum.accumulate(np.minimum(errors, self._error))
        self._sum += float(best.sum())
        self._error = float(best[-1])
        self.evaluations += len(errors)
        if self.evaluations >= self._end:
            raise Stop
        if self.evaluations % PERIOD == 0:
            self.landscape.change()
            self.changes += 1
            self._error = math.inf


Optimiser = Callable[[Course, np.random.Generator], object]
"""Searches a course, drawing from the generator, until the course stops it."""


def offline_error(optimiser: Optimiser, seed: int, changes: int) -> float:
    """The optimiser's offline error over so many periods of the landscape of this seed."""
    peaks_rng, own_rng = (np.random.default_rng((seed, stream)) for stream in range(2))
    course = Course(Landscape(peaks_rng), changes)
    with suppress(Stop):
        optimiser(course, own_rng)
    return course.offline_error
