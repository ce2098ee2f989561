"""A round through several goals: is all of it visited, how far is that, what was promised?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments import shipped
from experiments.comparing import bootstrap
from monitor.endings import Ending
from monitor.robots.briefing import brief
from monitor.robots.grid import Scene
from monitor.robots.grid_missions import read_mission
from planners.path_finding import Cell, astar

GOALS = 6


def visit_figures(seed: int, missions: int) -> dict[str, float | int | None]:
    """Figures under `visits.`: of the shipped round, lived by `expected`; and, over as many sets of
    random goals there, how much longer the round is that goes to the nearest goal next."""
    grid = read_mission(shipped.mission_path("round"))
    briefing = brief(grid, shipped.profiles())
    monitor = briefing.monitor("expected")
    lived = [briefing.live(monitor, seed * missions + each) for each in range(missions)]
    nets = np.array([report.net for report in lived])
    promised = np.array([report.promised for report in lived])
    walked = [sum(frame.story["length"] for frame in report.frames) for report in lived]
    rng = np.random.default_rng([seed, 11])
    rounds = np.array([_lengths(grid.scene, _goals(grid.scene, rng)) for _ in range(missions)])
    longer = bootstrap([*rounds.T], lambda nearest, shortest: nearest / shortest)
    return {
        "visits.reached": float(np.mean([report.ending is Ending.REACHED for report in lived])),
        "visits.value": float(nets.mean()),
        "visits.promise_error": float(abs(nets.mean() - promised.mean()) / abs(nets.mean())),
        "visits.walked_over_optimal": float(np.mean(walked)) / grid.scene.optimal,
        **longer.under("visits.nearest_over_tour"),
    }


def _goals(scene: Scene, rng: np.random.Generator) -> list[Cell]:
    """Free cells to which a way leads."""
    cells = np.argwhere(scene.free)
    found: list[Cell] = []
    while len(found) < GOALS:
        row, column = (int(at) for at in cells[rng.integers(len(cells))])
        if (row, column) not in found and astar(scene.free, scene.start, (row, column)):
            found.append((row, column))
    return found


def _lengths(scene: Scene, goals: Sequence[Cell]) -> tuple[float, float]:
    """Of the round that goes to the nearest goal next, and of the shortest, on the true floor."""
    here, left, nearest = scene.start, list(goals), 0.0
    while left:
        ways = {goal: astar(scene.free, here, goal) for goal in left}
        lengths = {goal: way.length for goal, way in ways.items() if way is not None}
        here = min(lengths, key=lengths.__getitem__)
        nearest += lengths[here]
        left.remove(here)
    return nearest, replace(scene, goal=goals[0], also=tuple(goals[1:])).optimal
