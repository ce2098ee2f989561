"""The paper's program: (find-path Start Goal (get-domain-description Sensor)). [ZR93] §4."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import compiler
from monitor.robots.grid import Scene
from planners.navigation import Place, find_path
from planners.path_finding import Cell, astar
from sensing import Belief
from sensing.vision import Sensor, see, sense


@compiler.program
def navigate(sensor, place):
    """Look, and plan the next frame with what was seen."""
    return find_path(see(sensor), place)


@dataclass(frozen=True, eq=False)
class FrameProblem:
    """A frame to look and plan for, with the true floor to judge by."""

    name: str
    sensor: Sensor
    place: Place
    free: NDArray[np.bool_]


def frame_problems(scene: Scene, rng: np.random.Generator, count: int) -> Iterator[FrameProblem]:
    """Frames that begin anywhere on a floor from which the goal can be reached.

    The robot has looked at the place once before, from where it begins, at a quality of 0.8.
    """
    cells = np.argwhere(scene.free)
    made = 0
    for _ in range(100 * count):
        if made == count:
            return
        row, column = (int(at) for at in cells[rng.integers(len(cells))])
        cell: Cell = (row, column)
        if cell == scene.goal or astar(scene.free, cell, scene.goal) is None:
            continue
        belief = Belief((scene.free.shape[0], scene.free.shape[1]), scene.density)
        belief.update(sense(scene.free, cell, scene.radius, 0.8, rng))
        belief.touch_around(cell, scene.free)
        sensor = Sensor(scene.free, cell, scene.radius, scene.device)
        place = Place(belief, cell, scene.goal, cell, scene.radius, scene.frame)
        yield FrameProblem(f"{scene.name} {row},{column} {made}", sensor, place, scene.free)
        made += 1
