"""From the costs of cells to a drive, as fast as the ground allows."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import anytime
from experiments.rover.turns import GRIP, POINTS, SIZE, TOUCHED, Floats, Turn


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
    worst = np.zeros(len(steps))
    for part in (0.0, 0.25, 0.5, 0.75):
        cells = (points[:-1] + part * steps).round().astype(int)
        worst = np.maximum(worst, costs[cells[:, 0], cells[:, 1]])
    return float((np.hypot(*steps.T) * worst).sum())


def _effort(way: Way, turn: Turn) -> float:
    """Length, what is touched, and what the turns cost: a cell for each quarter of a radian."""
    steps = np.diff(way.points, axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
    return _walked(way, turn) + 4.0 * float(np.abs(np.diff(headings)).sum())


@anytime.module(cost=_effort)
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


@anytime.module(cost=_effort)
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
    slips = (drive.speeds**2 * _bends(drive.way.points) > 1.2 * GRIP[turn.ground])[:-1]
    touched = _walked(drive.way, turn) - lengths.sum()
    return float((lengths / pace * (1.0 + 3.0 * slips)).sum() + touched)


@anytime.module(cost=_driven)
def speeds(way: Way, chances: Floats) -> Iterator[Drive]:
    """As fast as the bends allow on the ground that it seems to be: one speed for the whole way,
    then one for each of more and more pieces."""
    grip = GRIP[int(np.argmax(chances))]
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way.points, axis=0).T))])
    at = np.linspace(0, gone[-1], POINTS)
    points = np.stack([np.interp(at, gone, way.points[:, axis]) for axis in (0, 1)], axis=1)
    allowed = np.minimum(np.sqrt(grip / np.maximum(_bends(points), 1e-3)), 3.0)
    for pieces in (1, 2, 4, 8, 16, POINTS):
        slowest = [np.full(len(piece), piece.min()) for piece in np.array_split(allowed, pieces)]
        anytime.charge(1 + pieces / 8)
        yield Drive(Way(points), np.concatenate(slowest))
