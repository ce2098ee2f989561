"""A NAO's scene as a floor of cells, for the log and its page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.logs import Floor
from monitor.reports import Frame
from monitor.robots.nao_scenes import Scene
from sensing.sonar_grid import PRIOR, SonarMap

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
        """A frame of a NAO with its places in cells, as the log draws them."""
        story: dict[str, Any] = dict(frame.story)
        story["motion"] = self._motion(story["motion"])
        if isinstance(story.get("belief"), SonarMap):
            story["belief"] = self.believed(story["belief"])
        return replace(frame, story=story)

    def _motion(self, told: Mapping[str, Any]) -> dict[str, Any]:
        """What `nao_story` tells in metres, in cells: see `monitor.log_lines.Motion`."""
        return {
            "track": [[*self._at(x, y), round(heading, 3)] for x, y, heading in told["track"]],
            "radius": _cells(told["radius"]),
            "plan": self._way(told["plan"]),
            "goal": self._at(*told["goal"]),
            "discs": [[*self._at(x, y), _cells(radius)] for x, y, radius in told["discs"]],
            "clearance": _cells(told["clearance"]),
            "cones": [self._cone(cone) for cone in told["cones"]],
            "comparisons": [
                {**comparison, "other": self._way(comparison["other"])}
                for comparison in told["comparisons"]
            ],
            "events": told["events"],
        }

    def _cone(self, cone: Mapping[str, Any]) -> dict[str, Any]:
        row, column = self._at(cone["x"], cone["y"])
        heard = cone["heard"]
        return {
            "row": row,
            "column": column,
            "bearing": round(math.remainder(cone["bearing"], math.tau), 3),
            "half_angle": round(cone["half_angle"], 3),
            "reach": _cells(cone["reach"]),
            "heard": None if heard is None else _cells(heard),
        }

    def _at(self, x: float, y: float) -> list[float]:
        """A place as (row, column) with fractions."""
        return [_cells(self.top - y), _cells(x - self.left)]

    def _way(self, places: Sequence[Sequence[float]]) -> list[list[float]]:
        """A way without the stops on it."""
        ways = [self._at(x, y) for x, y in places]
        return ways[:1] + [after for before, after in pairwise(ways) if after != before]

    def believed(self, heard: SonarMap) -> NDArray[np.float64]:
        """What was heard, on the cells of the floor, with its density where nothing is known.

        A sonar map begins as good as free; so that the page can tell what was heard to be free from
        what was not heard, the density falls with the evidence for that.
        """
        shape = self.floor.free.shape
        believed = np.full(shape, self.floor.density)
        xs, ys = heard.places()
        rows = np.floor((self.top - np.asarray(ys)) / RESOLUTION).astype(int)
        columns = np.floor((np.asarray(xs) - self.left) / RESOLUTION).astype(int)
        inside = np.ix_((rows >= 0) & (rows < shape[0]), (columns >= 0) & (columns < shape[1]))
        good_rows = rows[(rows >= 0) & (rows < shape[0])]
        good_columns = columns[(columns >= 0) & (columns < shape[1])]
        sure = heard.probabilities()[inside].astype(float)
        cleared = self.floor.density * sure / PRIOR
        blocked = self.floor.density + (1.0 - self.floor.density) * (sure - PRIOR) / (1.0 - PRIOR)
        believed[np.ix_(good_rows, good_columns)] = np.where(sure < PRIOR, cleared, blocked)
        return believed


def _cells(metres: float) -> float:
    """A length in cells, to half a millimetre."""
    return round(metres / RESOLUTION, 2)


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
    for obstacle in scene.obstacles:
        reach = obstacle.radius or math.hypot(*(obstacle.size or ()))
        middle, side = (top - obstacle.at[1]) / RESOLUTION, (obstacle.at[0] - left) / RESOLUTION
        most = math.ceil(reach / RESOLUTION) + 1
        for row in range(max(int(middle) - most, 0), min(int(middle) + most + 1, rows)):
            for column in range(max(int(side) - most, 0), min(int(side) + most + 1, columns)):
                at = (left + (column + 0.5) * RESOLUTION, top - (row + 0.5) * RESOLUTION)
                free[row, column] &= obstacle.clearance(at) > 0
    empty = ScenePlan(left, top, Floor(free, (0, 0), (0, 0), 1.0))
    start, goal = empty.cell(*scene.start_in_world[:2]), empty.cell(*scene.goal.at)
    return replace(empty, floor=Floor(free, start, goal, 1.0 / RESOLUTION, RESOLUTION, density=0.2))
