"""A rover's whole turn, from photons to speeds: thirteen anytime modules on synthetic sensors.

It looks at its surroundings with a camera and a range sensor, finds out what is blocked, where it
stands and what ground it is on, plans a way to a beacon and drives it as fast as the ground allows.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

import anytime
import compiler
from anytime import Machine

Floats = NDArray[np.float64]
Cells = NDArray[np.intp]
SIZE = 32  # cells, and pixels, along a side
NOISE = 0.6  # of one exposure; obstacles are 1, free ground 0
REACH = 4  # cells that the rover may be off where it believes to be
TOUCHED = 6.0  # cells of way that one blocked cell on it costs
GROUNDS = (0.3, 0.6, 1.2)  # wavelengths of the texture in radians a cell: sand, gravel, rock
GRIP = (0.3, 0.6, 1.0)  # greatest sideways acceleration there, cells / s²
_SECONDS = {
    "expose": 2e-3,
    "scan": 1e-3,
    "denoise": 4e-4,
    "segment": 5e-4,
    "despeckle": 5e-4,
    "fuse": 6e-4,
    "classify": 2e-4,
    "localise": 5e-5,
    "inflate": 1e-3,
    "plan": 1e-5,
    "shortcut": 1e-4,
    "smooth": 1e-4,
    "speeds": 2e-4,
}  # of a unit of each module's work
MACHINE = Machine("rover")
for _name, _rate in _SECONDS.items():
    MACHINE = MACHINE.with_rate(_name, _rate)


@dataclass(frozen=True)
class Sensors:
    """What the rover can look at; only the modules that sense may. seed: of the noise."""

    light: Floats
    ranges: Floats
    seed: int


@dataclass(frozen=True)
class Turn:
    """A problem. blocked: [SIZE, SIZE]. start, goal: cells; offset: how far the rover is from
    where it believes to be. clutter: share of blocked cells. ground: index into `GROUNDS`."""

    name: str
    sensors: Sensors
    blocked: NDArray[np.bool_]
    start: tuple[int, int]
    goal: tuple[int, int]
    offset: tuple[int, int]
    clutter: float
    ground: int


def turns(count: int, seed: int = 0) -> list[Turn]:
    """Turns of the rover, drawn afresh; equal seeds give equal turns."""
    return [_turn(index, np.random.default_rng([seed, index]), seed) for index in range(count)]


def _turn(index: int, rng: np.random.Generator, seed: int) -> Turn:
    start, goal = (3, 3), (SIZE - 4, SIZE - 4)
    blocked = np.zeros((SIZE, SIZE), dtype=bool)
    for _ in range(int(rng.integers(4, 16))):
        row, column = rng.integers(0, SIZE - 4, size=2)
        height, width = rng.integers(2, 9, size=2)
        blocked[row : row + height, column : column + width] = True
    for cell in (start, goal):
        blocked[cell[0] - 3 : cell[0] + 4, cell[1] - 3 : cell[1] + 4] = False
    ground = int(rng.integers(3))
    row, column = rng.integers(-REACH, REACH + 1, size=2).tolist()
    offset = (row, column)
    wave = np.sin(GROUNDS[ground] * np.indices((SIZE, SIZE)).sum(axis=0) + rng.uniform(0, 6))
    light = blocked + np.where(blocked, 0.0, 0.25 * wave) + rng.uniform(-0.2, 0.2)
    # The range sensor turns with the rover, so that its picture is shifted by the offset.
    ranges = np.roll(blocked.astype(float), offset, axis=(0, 1))
    sensors = Sensors(light, ranges, int(rng.integers(2**31)))
    clutter = float(blocked.mean())
    return Turn(f"{seed}/{index}", sensors, blocked, start, goal, offset, clutter, ground)


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
    for threshold in (0.5, 0.4):
        anytime.charge(1)
        yield _costs(belief > threshold)
    total = np.zeros(belief.shape)
    for threshold in (0.2, 0.35, 0.5, 0.65, 0.8):
        total += _costs(belief > threshold)
        anytime.charge(1)
    yield total / 5


def _costs(blocked: NDArray[np.bool_]) -> Floats:
    free = (~blocked).astype(np.uint8)
    away = cv2.distanceTransform(free, cv2.DIST_L2, 3).astype(float)
    return 1.0 + np.where(blocked, TOUCHED, 2.0 * np.exp(-away))


# Moving


@dataclass(frozen=True)
class Way:
    """Points [n, 2] from start to goal, in cells."""

    points: Floats


def _walked(way: Way, turn: Turn) -> float:
    """Length of the way and what it touches, from where the rover really is."""
    steps = np.diff(way.points, axis=0)
    dense = np.concatenate([way.points[:-1] + steps * part for part in (0, 0.25, 0.5, 0.75)])
    cells = dense.round().astype(int).clip(0, SIZE - 1)
    touched = len({tuple(cell) for cell in cells[turn.blocked[cells[:, 0], cells[:, 1]]].tolist()})
    return float(np.hypot(*steps.T).sum()) + TOUCHED * touched


@anytime.module(cost=_walked)
def plan(costs: Floats, start: tuple[int, int], goal: tuple[int, int]) -> Iterator[Way]:
    """A*, greedy at first and then less so."""
    for greed in (4.0, 2.0, 1.4, 1.0):
        yield Way(_astar(costs, start, goal, greed))


def _astar(costs: Floats, start: tuple[int, int], goal: tuple[int, int], greed: float) -> Floats:
    best = {start: 0.0}
    parents: dict[tuple[int, int], tuple[int, int]] = {}
    frontier = [(0.0, start)]
    closed: set[tuple[int, int]] = set()
    while frontier:
        _, cell = heapq.heappop(frontier)
        if cell in closed:
            continue
        closed.add(cell)
        if cell == goal:
            break
        for row in (-1, 0, 1):
            for column in (-1, 0, 1):
                near = cell[0] + row, cell[1] + column
                if near in closed or not (0 <= near[0] < SIZE and 0 <= near[1] < SIZE):
                    continue
                reached = best[cell] + costs[near] * float(np.hypot(row, column))
                if reached < best.get(near, np.inf):
                    best[near], parents[near] = reached, cell
                    left = float(np.hypot(near[0] - goal[0], near[1] - goal[1]))
                    heapq.heappush(frontier, (reached + greed * left, near))
    anytime.charge(len(closed))
    way = [goal]
    while way[-1] != start:
        way.append(parents[way[-1]])
    return np.array(way[::-1], dtype=float)


def _believed(points: Floats, costs: Floats) -> float:
    """What a way costs by the costs of the cells under it."""
    steps = np.diff(points, axis=0)
    cells = (points[:-1] + steps / 2).round().astype(int)
    return float((np.hypot(*steps.T) * costs[cells[:, 0], cells[:, 1]]).sum())


@anytime.module(cost=_walked)
def shortcut(way: Way, costs: Floats, *, rng: np.random.Generator) -> Iterator[Way]:
    """Straight lines between points of the way chosen by chance, where the costs allow them."""
    anytime.charge(0.5)
    yield way
    points = way.points
    for upto in (4, 8, 16, 32):
        for _ in range(upto):
            anytime.charge(1)
            if len(points) < 4:
                break
            one, other = sorted(rng.choice(len(points), size=2, replace=False).tolist())
            count = max(2, round(float(np.hypot(*(points[other] - points[one])))) + 1)
            line = np.linspace(points[one], points[other], count)
            if _believed(line, costs) < _believed(points[one : other + 1], costs) - 1e-9:
                points = np.concatenate([points[:one], line, points[other + 1 :]])
        yield Way(points)


@anytime.module(cost=_walked)
def smooth(way: Way) -> Iterator[Way]:
    """Every point drawn to the middle of its neighbours, round after round."""
    anytime.charge(0.5)
    yield way
    points = way.points.copy()
    for _ in range(6):
        points[1:-1] += 0.3 * (points[:-2] + points[2:] - 2 * points[1:-1])
        anytime.charge(len(points) / 8)
        yield Way(points.copy())


@dataclass(frozen=True)
class Drive:
    """A way and how fast to drive it. speeds: [n] cells / s at its points."""

    way: Way
    speeds: Floats


def _bends(points: Floats) -> Floats:
    """Curvature at each point, 1 / cells."""
    along = np.gradient(points, axis=0)
    turned = np.gradient(np.unwrap(np.arctan2(along[:, 0], along[:, 1])))
    return np.abs(turned) / np.maximum(np.hypot(along[:, 0], along[:, 1]), 0.1)


def _driven(drive: Drive, turn: Turn) -> float:
    """Seconds of the drive: what is touched costs, and so does slipping in bends."""
    lengths = np.hypot(*np.diff(drive.way.points, axis=0).T)
    pace = np.maximum(drive.speeds[:-1], 0.1)
    slips = drive.speeds**2 * _bends(drive.way.points) > 1.2 * GRIP[turn.ground]
    touched = _walked(drive.way, turn) - lengths.sum()
    return float((lengths / pace).sum() + touched + 2.0 * slips.sum())


@anytime.module(cost=_driven)
def speeds(way: Way, chances: Floats) -> Iterator[Drive]:
    """As fast as the bends allow on the ground that it seems to be, at finer and finer points."""
    grip = GRIP[int(np.argmax(chances))]
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way.points, axis=0).T))])
    for count in (8, 16, 32, 64):
        at = np.linspace(0, gone[-1], count)
        points = np.stack([np.interp(at, gone, way.points[:, axis]) for axis in (0, 1)], axis=1)
        allowed = np.minimum(np.sqrt(grip / np.maximum(_bends(points), 1e-3)), 3.0)
        allowed = np.minimum(allowed, np.minimum(np.roll(allowed, 1), np.roll(allowed, -1)) + 1.0)
        anytime.charge(count / 8)
        yield Drive(Way(points), allowed)


@compiler.program
def turn(sensors, start, goal):
    """One turn of the rover."""
    image = denoise(expose(sensors))
    ranges = despeckle(scan(sensors))
    seen = segment(image)
    costs = inflate(fuse(seen, localise(ranges, seen)))
    way = smooth(shortcut(plan(costs, start, goal), costs))
    return speeds(way, classify(image))
