"""A user's own laboratory: noisy pictures of boxes, a detector, a path planner and their scores.

It stands for the code that a reader of the README already has. Nothing here knows `anytime`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SIDE = 128  # pixels, and metres, of a scene
NOISE = 0.8
ITERATIONS = 400  # after which the planner has done what it can

Point = tuple[float, float]


@dataclass(frozen=True)
class Scene:
    """What the camera sees, what is there, and where to go.

    image: [SIDE, SIDE] brightness. start, goal: (row, column). truth: [n, 4] the boxes as
    (top, left, bottom, right).
    """

    name: str
    image: np.ndarray
    start: Point
    goal: Point
    truth: np.ndarray


def scenes(count: int) -> list[Scene]:
    """The first `count` scenes, always the same ones."""
    return [_scene(index) for index in range(count)]


def _scene(index: int) -> Scene:
    rng = np.random.default_rng([7, index])
    clear = np.zeros((SIDE, SIDE))
    boxes = []
    for _ in range(int(rng.integers(12, 24))):
        height, width = rng.integers(6, 30, size=2)
        top, left = rng.integers(14, SIDE - 14 - height), rng.integers(14, SIDE - 14 - width)
        if not clear[top - 2 : top + height + 2, left - 2 : left + width + 2].any():
            clear[top : top + height, left : left + width] = 1.0
            boxes.append((top, left, top + height, left + width))
    image = clear + rng.normal(0.0, NOISE, clear.shape)
    return Scene(f"scene {index}", image, (6.0, 6.0), (SIDE - 7.0, SIDE - 7.0), np.array(boxes))


def detector(image: np.ndarray, size: int) -> np.ndarray:
    """Boxes [n, 4] found at a resolution of `size` (640 = every pixel): finer takes longer."""
    factor = max(1, 640 // size)
    rows = SIDE // factor
    small = image.reshape(rows, factor, rows, factor).mean(axis=(1, 3))
    padded = np.pad(small, 2, mode="edge")
    shifts = [padded[r : r + rows, c : c + rows] for r in range(5) for c in range(5)]
    around = np.median(shifts, axis=0)
    boxes = [
        (top * factor, left * factor, bottom * factor, right * factor)
        for top, left, bottom, right, area in _patches(around > 0.5)
        if area * factor**2 >= 20
    ]
    return np.array(boxes).reshape(-1, 4)


def _patches(bright: np.ndarray) -> list[tuple[int, int, int, int, int]]:
    """Bounding box and area of each connected patch."""
    left = {(r, c) for r, c in np.argwhere(bright).tolist()}
    found = []
    while left:
        pending, members = [left.pop()], []
        while pending:
            r, c = pending.pop()
            members.append((r, c))
            for near in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
                if near in left:
                    left.remove(near)
                    pending.append(near)
        rows, columns = zip(*members, strict=True)
        found.append((min(rows), min(columns), max(rows) + 1, max(columns) + 1, len(members)))
    return found


def f1(boxes: np.ndarray, truth: np.ndarray) -> float:
    """F1 of detections against the truth, matched at half of intersection over union."""
    hits = sum(any(_overlap(box, real) >= 0.5 for box in boxes) for real in truth)
    return 2 * hits / max(len(boxes) + len(truth), 1) if hits <= len(boxes) else 1.0


def _overlap(a: np.ndarray, b: np.ndarray) -> float:
    height = min(a[2], b[2]) - max(a[0], b[0])
    width = min(a[3], b[3]) - max(a[1], b[1])
    shared = max(height, 0) * max(width, 0)
    return float(shared / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared))


def length(path: list[Point], scene: Scene) -> float:
    """Metres that are really walked: along the path, and around each real box that it runs into."""
    walked = sum(math.dist(a, b) for a, b in itertools.pairwise(path))
    bumped = np.zeros(len(scene.truth), dtype=bool)
    for a, b in itertools.pairwise(path):
        bumped |= _crossed(a, b, scene.truth)
    size = scene.truth[:, 2:] - scene.truth[:, :2]
    return walked + float(2 * size.sum(axis=1)[bumped].sum())


def _crossed(a: Point, b: Point, boxes: np.ndarray) -> np.ndarray:
    """Which boxes the segment a–b crosses, [n]: the slab test."""
    if not len(boxes):
        return np.zeros(0, dtype=bool)
    enter, leave = np.zeros(len(boxes)), np.ones(len(boxes))
    for axis in range(2):
        step = b[axis] - a[axis] or 1e-12
        one, other = (boxes[:, axis] - a[axis]) / step, (boxes[:, axis + 2] - a[axis]) / step
        enter = np.maximum(enter, np.minimum(one, other))
        leave = np.minimum(leave, np.maximum(one, other))
    return enter < leave


class RRTStar:
    """A small RRT*: a tree of collision-free ways from the start, rewired as it grows."""

    def __init__(
        self,
        boxes: np.ndarray,
        start: Point,
        goal: Point,
        on_solution: Callable[[list[Point]], object],
    ) -> None:
        self.boxes = np.asarray(boxes, dtype=float).reshape(-1, 4) + np.array([-1, -1, 1, 1])
        self.goal = goal
        self.on_solution = on_solution
        self.points = [start]
        self.parents = [0]
        self.costs = [0.0]
        self.best = math.inf
        self.rng = np.random.default_rng(1)

    def solve(self, until: Callable[[], bool]) -> None:
        """Grow the tree until the caller says so; report each better way to the goal."""
        for _ in range(ITERATIONS):
            if until():
                return
            self._grow()

    def _grow(self) -> None:
        aim = self.goal if self.rng.random() < 0.1 else tuple(self.rng.uniform(0, SIDE, size=2))
        points = np.array(self.points)
        away = np.hypot(*(points - aim).T)
        nearest = int(away.argmin())
        share = min(1.0, 28.0 / max(float(away[nearest]), 1e-9))
        one = self.points[nearest]
        new = (one[0] + share * (aim[0] - one[0]), one[1] + share * (aim[1] - one[1]))
        if _crossed(one, new, self.boxes).any():
            return
        near = np.hypot(*(points - new).T)
        around = [i for i in np.flatnonzero(near < 32) if self._free(i, new)]
        parent = min(around, key=lambda i: self.costs[i] + near[i], default=nearest)
        self.points.append(new)
        self.parents.append(int(parent))
        self.costs.append(self.costs[parent] + math.dist(self.points[parent], new))
        last = len(self.points) - 1
        for i in around:
            if self.costs[last] + near[i] < self.costs[i]:
                self.parents[i], self.costs[i] = last, self.costs[last] + float(near[i])
        self._offer(last)

    def _free(self, index: int, new: Point) -> bool:
        return not _crossed(self.points[index], new, self.boxes).any()

    def _offer(self, last: int) -> None:
        if _crossed(self.points[last], self.goal, self.boxes).any():
            return
        path = [self.goal]
        while last:
            path.append(self.points[last])
            last = self.parents[last]
        path = [self.points[0], *reversed(path)]
        cost = sum(math.dist(a, b) for a, b in itertools.pairwise(path))
        if cost < self.best - 1e-9:
            self.best = cost
            self.on_solution(path)
