"""Floors with a way across and floors without one: whether the robot arrives, or says so."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime import ProfileLibrary, WorkClock
from anytime.running import seed_of
from compiler import CompiledProgram, compile
from experiments import shipped
from monitor.endings import Ending
from monitor.missions import Energy, Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE
from monitor.robots.navigation import navigate
from planners.path_finding import Cell, astar
from sensing import connected
from sensing.random_maps import clustered, maze, rooms, uniform
from sensing.vision import Vision

KINDS = ("iid 10 %", "iid 30-38 %", "rooms", "clustered", "mazes")
SIZES = (32, 128)
ENDLESS = Mission(
    Value("exponential", 100.0, 1e6), Energy(0.0, 0.0, 0.0), speeds=(1.0, 10.0), name="crossing"
)


@dataclass(frozen=True, eq=False)
class Crossing:
    """A floor, a start and a goal, and the vision quality to cross it with."""

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    quality: float
    seed: int


def crossing(
    kind: str, index: int, *, reachable: bool, seed: int = 0, size: int | None = None
) -> Crossing:
    """The floor of this kind and index, 32 to 128 cells wide if no size is given, with or without
    a way."""
    rng = np.random.default_rng(seed_of("crossing", kind, index, reachable, seed))
    while True:
        cells_wide = size or int(rng.integers(SIZES[0], SIZES[1] + 1))
        free = _floor(kind, cells_wide, rng)
        cells = np.argwhere(free)
        if len(cells) < 2:
            continue
        start, goal = (_cell(cells[i]) for i in rng.choice(len(cells), 2, replace=False))
        if not reachable:
            free, goal = _cut_off(free, start, goal, rng)
        if start == goal or not (free[start] and free[goal]):
            continue
        if connected(free, start, goal) == reachable:
            quality = float(rng.uniform(0.7, 1.0))
            return Crossing(free, start, goal, quality, int(rng.integers(2**31)))


def _cut_off(
    free: NDArray[np.bool_], start: Cell, goal: Cell, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], Cell]:
    """A goal that is not connected to the start: in a pocket that is there, else behind an
    obstacle that is put on the shortest way."""
    from scipy.ndimage import label

    parts = np.asarray(label(free)[0])  # pyright: ignore[reportIndexIssue]
    elsewhere = np.argwhere(free & (parts != parts[start]))
    if len(elsewhere):
        return free, _cell(elsewhere[rng.integers(len(elsewhere))])
    free = free.copy()
    while (way := astar(free, start, goal)) is not None:
        row, column = way.cells[len(way.cells) // 2]
        free[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3] = False
        if not (free[start] and free[goal]):
            break
    return free, goal


def _floor(kind: str, size: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    if kind == "iid 10 %":
        return uniform(size, 0.10, rng)
    if kind == "iid 30-38 %":
        return uniform(size, float(rng.uniform(0.30, 0.38)), rng)
    if kind == "rooms":
        return rooms(size, rng)
    if kind == "clustered":
        return clustered(size, 0.30, rng)
    return maze(size, rng, corridor=int(rng.integers(1, 4)))


def _cell(pair: NDArray[np.intp]) -> Cell:
    return int(pair[0]), int(pair[1])


def compiled(library: ProfileLibrary | None = None) -> CompiledProgram:
    """The paper's program with the shipped profiles."""
    return compile(navigate, (library or shipped.profiles()).on(REFERENCE))


def cross(program: CompiledProgram, floor: Crossing) -> Ending:
    """Live the mission without deadline or energy limit."""
    device = replace(Vision(), t_a=1.0, t_b=1.0, q_a=floor.quality, q_b=floor.quality)
    scene = Scene(floor.free, floor.start, floor.goal, device=device)
    policy = constant(dict(zip(program.labels, (0.25, 5.0), strict=True)), 5.0)
    robot = GridRobot(scene, ENDLESS.energy, WorkClock(REFERENCE))
    return Monitor(program, policy, "constant").run(ENDLESS, robot, seed=floor.seed).ending
