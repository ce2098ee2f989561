"""A NAO's scene as a floor of cells, for the log and its page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.logs import Floor
from monitor.reports import Frame
from monitor.robots.nao_scenes import Scene
from sensing.sonar_map import SonarMap

RESOLUTION = 0.05
"""Metres a cell."""
_BORDER = 0.8  # metres around what happens in a scene
_SHOWN = 60.0  # seconds of a moving goal's way


@dataclass(frozen=True, eq=False)
class ScenePlan:
    """The cells of a scene: row 0 is the greatest y, column 0 the least x; metres in world."""

    left: float
    top: float
    floor: Floor

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """The cell (row, column) of a place, the nearest one if it is off the floor."""
        rows, columns = self.floor.free.shape
        row, column = (self.top - y) / RESOLUTION, (x - self.left) / RESOLUTION
        return min(rows - 1, max(0, int(row))), min(columns - 1, max(0, int(column)))

    def drawn(self, frame: Frame) -> Frame:
        """A frame of a NAO with its places as cells, as the log draws them."""
        story: dict[str, Any] = dict(frame.story)
        story["path"] = self._cells(story["path"])
        story["plan"] = [[*cell, 0] for cell in self._cells(story["plan"])]
        if isinstance(story.get("belief"), SonarMap):
            story["belief"] = self._believed(story["belief"])
        return replace(frame, story=story)

    def _cells(self, places: Sequence[Sequence[float]]) -> list[tuple[int, int]]:
        cells = [self.cell(place[0], place[1]) for place in places]
        return cells[:1] + [after for before, after in pairwise(cells) if after != before]

    def _believed(self, heard: SonarMap) -> NDArray[np.float64]:
        """What was heard, on the cells of the floor; 0.2 where nothing is known."""
        shape = self.floor.free.shape
        believed = np.full(shape, self.floor.density)
        xs, ys = heard.places()
        rows = np.floor((self.top - np.asarray(ys)) / RESOLUTION).astype(int)
        columns = np.floor((np.asarray(xs) - self.left) / RESOLUTION).astype(int)
        inside = np.ix_((rows >= 0) & (rows < shape[0]), (columns >= 0) & (columns < shape[1]))
        good_rows = rows[(rows >= 0) & (rows < shape[0])]
        good_columns = columns[(columns >= 0) & (columns < shape[1])]
        believed[np.ix_(good_rows, good_columns)] = heard.probabilities()[inside]
        return believed


def plan_of(scene: Scene) -> ScenePlan:
    """The floor of a scene as it is when all of its obstacles have come."""
    places = [scene.start_in_world[:2], scene.goal.at]
    if scene.goal.velocity != (0.0, 0.0):
        places.append(scene.goal.place(_SHOWN))
    places += [obstacle.at for obstacle in scene.obstacles]
    xs, ys = zip(*places, strict=True)
    left, top = min(xs) - _BORDER, max(ys) + _BORDER
    rows = math.ceil((top - min(ys) + _BORDER) / RESOLUTION)
    columns = math.ceil((max(xs) + _BORDER - left) / RESOLUTION)
    free = np.ones((rows, columns), bool)
    for row in range(rows):
        for column in range(columns):
            at = (left + (column + 0.5) * RESOLUTION, top - (row + 0.5) * RESOLUTION)
            free[row, column] = all(o.clearance(at) > 0 for o in scene.obstacles)
    empty = ScenePlan(left, top, Floor(free, (0, 0), (0, 0), 1.0))
    start, goal = empty.cell(*scene.start_in_world[:2]), empty.cell(*scene.goal.at)
    return replace(empty, floor=Floor(free, start, goal, 1.0 / RESOLUTION, RESOLUTION, density=0.2))
