"""From photons to what it costs to cross each cell: nine anytime modules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

import anytime
from experiments.rover.turns import GROUNDS, NOISE, REACH, SIZE, TOUCHED, Floats, Sensors


def _close(value: Floats, truth: Floats) -> float:
    """1 at no error, 0 at that of a single exposure."""
    return float(np.clip(1 - np.sqrt(((value - truth) ** 2).mean()) / NOISE, 0, 1))


def _agreement(belief: Floats, truth: NDArray[np.bool_]) -> float:
    """Balanced accuracy of "more likely blocked than not", 0 for chance."""
    said = belief > 0.5
    right = (said[truth].mean() if truth.any() else 1.0) + (~said[~truth]).mean()
    return float(np.clip(right - 1, 0, 1))


def _exposures(truth: Floats, seed: int, noise: float) -> Iterator[Floats]:
    rng = np.random.default_rng(seed)
    total, taken = np.zeros(truth.shape), 0
    for upto in (1, 2, 3, 4, 6, 8, 12, 16):
        while taken < upto:
            total += truth + rng.normal(0, noise, truth.shape)
            taken += 1
            anytime.charge(1)
        yield total / taken


# Seeing


@anytime.module(quality=lambda image, turn: _close(image, turn.sensors.light))
def expose(sensors: Sensors) -> Iterator[Floats]:
    """The mean of more and more exposures."""
    yield from _exposures(sensors.light, sensors.seed, NOISE)


@anytime.module(quality=lambda ranges, turn: _close(ranges, turn.sensors.ranges))
def scan(sensors: Sensors) -> Iterator[Floats]:
    """The mean of more and more sweeps of the range sensor."""
    yield from _exposures(sensors.ranges, sensors.seed + 1, 0.8 * NOISE)


@anytime.module(quality=lambda image, turn: _close(image, turn.sensors.light))
def denoise(image: Floats) -> Iterator[Floats]:
    """Diffusion that stops at edges, sweep after sweep (Perona and Malik 1990)."""
    anytime.charge(0.5)
    yield image
    smoothed = image.copy()
    for _ in range(8):
        change = np.zeros(image.shape)
        for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
            slope = np.roll(smoothed, by, axis) - smoothed
            change += slope * np.exp(-((slope / 0.5) ** 2))
        smoothed = smoothed + 0.2 * change
        anytime.charge(1)
        yield smoothed


@anytime.module(quality=lambda belief, turn: _agreement(belief, turn.blocked))
def segment(image: Floats) -> Iterator[Floats]:
    """What is blocked, by two means, in coarse and then in finer patches."""
    for patch in (8, 4, 2, 1):
        small = cv2.resize(image, (SIZE // patch,) * 2, interpolation=cv2.INTER_AREA)
        low, high = np.quantile(small, (0.2, 0.95))
        for _ in range(4):
            middle = (low + high) / 2
            low, high = small[small <= middle].mean(), small[small >= middle].mean()
        belief = 1 / (1 + np.exp(-8 * (small - (low + high) / 2)))
        anytime.charge(1 + 8 / patch)
        yield cv2.resize(belief, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST)


@anytime.module(quality=lambda ranges, turn: _close(ranges, turn.sensors.ranges))
def despeckle(ranges: Floats) -> Iterator[Floats]:
    """Medians over growing windows."""
    anytime.charge(0.5)
    yield ranges
    for window in (3, 5):
        anytime.charge(window)
        yield cv2.medianBlur(ranges.astype(np.float32), window).astype(float)


def _texture(image: Floats, wavelength: float) -> float:
    """Power of the image along the diagonal at a wavelength."""
    phase = wavelength * np.indices(image.shape).sum(axis=0)
    return float(np.hypot((image * np.sin(phase)).mean(), (image * np.cos(phase)).mean()))


@anytime.module(quality=lambda chances, turn: float(chances[turn.ground]))
def classify(image: Floats) -> Iterator[Floats]:
    """What ground it is: the texture in a few patches, then in more of them."""
    votes = np.zeros(len(GROUNDS))
    rng = np.random.default_rng(0)
    for count in (1, 2, 4, 8, 16):
        for _ in range(count):
            row, column = rng.integers(0, SIZE - 12, size=2)
            patch = image[row : row + 12, column : column + 12]
            votes += [_texture(patch - patch.mean(), wave) for wave in GROUNDS]
        anytime.charge(count)
        chances = np.exp(12 * (votes / votes.max() - 1) * np.sqrt(count))
        yield chances / chances.sum()


# Knowing where


@dataclass(frozen=True)
class Aligned:
    """Ranges turned by the shift that fits, in cells."""

    ranges: Floats
    shift: tuple[int, int]


@anytime.module(
    quality=lambda aligned, turn: float(
        np.clip(1 - np.hypot(*np.subtract(aligned.shift, turn.offset)) / REACH, 0, 1)
    )
)
def localise(ranges: Floats, seen: Floats) -> Iterator[Aligned]:
    """How far the rover is off: the shift by which the ranges fit what the camera sees."""
    best, shift = -np.inf, (0, 0)
    tried: set[tuple[int, int]] = set()
    for stride in (4, 2, 1):
        for row in range(-REACH, REACH + 1, stride):
            for column in range(-REACH, REACH + 1, stride):
                if (row, column) in tried:
                    continue
                tried.add((row, column))
                fit = float((np.roll(ranges, (-row, -column), (0, 1)) * (seen - 0.5)).sum())
                anytime.charge(1)
                if fit > best:
                    best, shift = fit, (row, column)
        yield Aligned(np.roll(ranges, (-shift[0], -shift[1]), (0, 1)), shift)


@anytime.module(quality=lambda belief, turn: _agreement(belief, turn.blocked))
def fuse(seen: Floats, aligned: Aligned) -> Iterator[Floats]:
    """Camera and ranges as one belief, in which neighbours agree more and more (mean field)."""
    odds = 4 * (seen - 0.5) + 4 * (aligned.ranges - 0.5)
    belief = 1 / (1 + np.exp(-odds))
    anytime.charge(1)
    yield belief
    for _ in range(5):
        belief = 1 / (1 + np.exp(-(odds + 5 * (cv2.blur(belief, (3, 3)) - 0.5))))
        anytime.charge(1)
        yield belief


@anytime.module(
    quality=lambda costs, turn: float(
        np.clip(1 - np.abs(costs - _costs(turn.blocked)).mean() / 2, 0, 1)
    )
)
def inflate(belief: Floats) -> Iterator[Floats]:
    """What it costs to cross each cell, with a margin around what is blocked."""
    for patch in (4, 2, 1):
        small = cv2.resize(belief, (SIZE // patch,) * 2, interpolation=cv2.INTER_AREA)
        seen = cv2.resize(small, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST)
        anytime.charge(4 / patch)
        yield _costs(seen > 0.5)


def _costs(blocked: NDArray[np.bool_]) -> Floats:
    free = (~blocked).astype(np.uint8)
    away = cv2.distanceTransform(free, cv2.DIST_L2, 3).astype(float)
    return 1.0 + np.where(blocked, TOUCHED, 2.0 * np.exp(-away))
