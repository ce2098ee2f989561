"""Planners to compare ATP with, each as steps of work and plans."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from planners import Grid, ara, paper_atp, steps
from planners.frontier import cells_of
from planners.grids import endpoints
from planners.improving import DONE, GAIN, MEETING, UPPER, begin, new_run, search
from planners.multipath import NO_WAY, Step, way_plan
from planners.norms import least_norm
from planners.path_finding import Cell
from planners.search import OUT_OF_BUDGET, SPAN
from planners.way_in_hand import way_to

RESTARTS = (3.0, 2.0, 1.5, 1.3, 1.2, 1.1, 1.05, 1.0)
_GRAIN = 1000


def restarting(grid: Grid, start: Cell, goal: Cell) -> Iterator[Step]:
    """Restarting weighted A* (Richter, Thayer, Ruml 2010): from scratch by every weight, and only
    what can beat the way in hand."""
    yield from _weighted(grid, start, goal, RESTARTS)


def weighted(grid: Grid, start: Cell, goal: Cell) -> Iterator[Step]:
    """Weighted A*, once, by 1.5."""
    yield from _weighted(grid, start, goal, (1.5,))


def _weighted(grid: Grid, start: Cell, goal: Cell, weights: tuple[float, ...]) -> Iterator[Step]:
    first, last, _ = endpoints(grid, start, goal, 8)
    columns, run, known = grid.shape[1], new_run(*grid.shape), float(SPAN)
    for weight in weights:
        least_norm(True, run.norm)
        run.norm[:] = np.round(weight * run.norm)
        begin(grid.cost, columns, first, last, int(known), weight == 1.0, run)
        found = OUT_OF_BUDGET
        while found == OUT_OF_BUDGET:
            found, taken = search(grid.cost, grid.wall, columns, last, True, run, _GRAIN)
            plan = None
            if found == DONE and run.state[MEETING] >= 0:
                known = float(run.state[UPPER] - run.state[GAIN])
                way, _ = way_to(grid.cost, grid.wall, columns, first, last, True, run)
                plan = way_plan(*cells_of(way, columns, 1), known, known / weight)
            yield Step(float(taken), plan)
    if known == SPAN:
        yield Step(0.0, NO_WAY)


def paper(grid: Grid, start: Cell, goal: Cell) -> Iterator[Step]:
    """The paper's ATP."""
    blocked = (grid.cost == grid.wall).reshape(grid.shape).astype(np.float32)
    yield from paper_atp.steps(blocked, start, goal)


Planner = Callable[[Grid, Cell, Cell], Iterator[Step]]
PLANNERS: dict[str, Planner] = {
    "atp": steps,
    "ara": ara.steps,
    "rwa": restarting,
    "wa": weighted,
    "paper": paper,
}
"""By the names that figures use."""


def networkx(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """networkx's A* with the octile heuristic; making the graph is not counted."""
    rival = importlib.import_module("networkx")
    graph = rival.Graph()
    rows, columns = free.shape
    for row, column in np.argwhere(free).tolist():
        for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
            r, c = row + down, column + across
            if not (r < rows and 0 <= c < columns and free[r, column]):
                continue
            if free[row, c] and free[r, c]:
                graph.add_edge((row, column), (r, c), weight=2**0.5 if down and across else 1.0)

    def octile(one: Cell, other: Cell) -> float:
        near, far = sorted((abs(one[0] - other[0]), abs(one[1] - other[1])))
        return far - near + near * 2**0.5

    return lambda: rival.astar_path_length(graph, start, goal, octile)


def nano(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """nano-astar on the same grid, octile, no corner cutting; its cost as length."""
    rival = importlib.import_module("nano_astar")
    grid = (~free).astype(np.uint8)
    return lambda: float(rival.astar(grid, start, goal, heuristic="octile", diagonal=True)[1])


def tcod(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """libtcod's A*. It cuts corners, which is an easier problem; its length is not compared."""
    rival = importlib.import_module("tcod.path")
    cost = free.astype(np.int8)

    def query() -> float:
        rival.AStar(cost, diagonal=2**0.5).get_path(*start, *goal)
        return float("nan")

    return query


def skimage(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """scikit-image's Dijkstra. It cuts corners; its length is not compared."""
    rival = importlib.import_module("skimage.graph")
    cost = np.where(free, 1.0, -1.0)

    def query() -> float:
        rival.route_through_array(cost, start, goal, fully_connected=True, geometric=True)
        return float("nan")

    return query


PEERS = {"nano": ("nano_astar", nano), "networkx": ("networkx", networkx),
         "tcod": ("tcod", tcod), "skimage": ("skimage", skimage)}  # fmt: skip
"""A* of other packages: name → (module to find, maker of a query)."""
