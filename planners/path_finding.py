"""Shortest and nearly shortest paths between two cells of a grid [ZR93 §3.2, PATH-FINDER]."""

import math
import operator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import is_number
from anytime.errors import AnytimeError
from planners.frontier import cells_of, path_to, way_cost
from planners.search import NO_PATH, UNLIMITED, WALL, Workspace, bucket_search, workspace
from planners.windows import window_search

Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Path:
    """A way from cell to neighbouring cell.

    `cells` is int32 [n, 2] of (row, column), start and goal included; `length` is in cells, a
    diagonal counting sqrt 2; `cost` is in the search's integer units (10 000 a cell of cost 1);
    `expansions` is the work of the search.
    """

    cells: NDArray[np.int32]
    length: float
    cost: int
    expansions: int


def astar(
    free: NDArray[np.bool_],
    start: Cell,
    goal: Cell,
    connectivity: int = 8,
    *,
    budget: int = UNLIMITED,
) -> Path | None:
    """Find the shortest path over the free cells, or None where there is none.

    `free` is bool [rows, columns]. `connectivity` is 8 (octile, a diagonal needs both orthogonal
    cells free) or 4. After `budget` expansions the search gives up and raises `TimeoutError`.
    """
    grid, first, last = _query(free, 0, start, goal, connectivity)
    work, columns, diagonals = workspace(grid.size), free.shape[1], connectivity == 8
    if first == last:
        return _path(np.array([first], np.int32), columns, 0, 0)
    cost, expansions = bucket_search(grid, 0, columns, first, last, diagonals, budget, work)
    return _read_back(grid, 0, columns, first, last, diagonals, int(cost), int(expansions), work)


def textbook_astar(
    free: NDArray[np.bool_], start: Cell, goal: Cell, connectivity: int = 8
) -> Path | None:
    """Find the shortest path as a textbook does: heap, octile, ties to greater g, closed once."""
    return weighted_astar(free, start, goal, 1.0, connectivity)


def weighted_astar(
    free: NDArray[np.bool_], start: Cell, goal: Cell, weight: float, connectivity: int = 8
) -> Path | None:
    """Find a path at most `weight` (≥ 1) times as long as the shortest, mostly with less work."""
    grid, first, last = _query(free, 0, start, goal, connectivity)
    return _soft(grid, 0, free.shape[1], first, last, weight, connectivity)


def route(
    cost: NDArray[np.uint8], start: Cell, goal: Cell, weight: float = 1.0, connectivity: int = 8
) -> Path | None:
    """Find a cheap path over soft cells: `cost` uint8 [rows, columns] ≥ 1, 255 = impassable.

    A step costs its length times the dearest cell it sweeps (the cell entered; for a diagonal both
    orthogonals too). The path costs at most `weight` times the cheapest.
    """
    grid, first, last = _query(cost, WALL, start, goal, connectivity)
    return _soft(grid, WALL, cost.shape[1], first, last, weight, connectivity)


def flat(grid: NDArray[Any], name: str) -> NDArray[np.uint8]:
    """View a bool or uint8 map [rows, columns] as flat bytes, without a copy where it can."""
    if not isinstance(grid, np.ndarray):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"{name} is a {type(grid).__name__}; give an array [rows, columns]")
    if grid.ndim != 2 or not grid.size or grid.dtype.char not in "?B":  # bool or uint8
        raise AnytimeError(
            f"{name} is {grid.dtype} {list(grid.shape)}, it must be bool or uint8 [rows, columns]"
        )
    flags = grid.flags
    # For arrays that may not be written numba would compile every kernel once more.
    cells = grid if flags.c_contiguous and flags.writeable else np.array(grid, order="C")
    return np.frombuffer(cells, np.uint8)


def flat_free(free: NDArray[Any], name: str) -> NDArray[np.uint8]:
    """`flat` of a map of free cells, whose bytes searches read as bits: 0 and 1 alone."""
    cells = flat(free, name)
    if free.dtype.char != "?" and int(cells.max()) > 1:
        raise AnytimeError(
            f"{name} holds {int(cells.max())}: give bools, True where a cell is free, as in "
            "`picture > 0`"
        )
    return cells


def index_of(cell: Cell, shape: tuple[int, ...], name: str) -> int:
    """Return the flat index of a (row, column) cell of a map, or raise where it lies outside."""
    try:
        row, column = cell
        row, column = operator.index(row), operator.index(column)
    except (TypeError, ValueError):
        raise AnytimeError(
            f"{name} is {cell!r}; a cell is two whole numbers, (row, column)"
        ) from None
    if not (0 <= row < shape[0] and 0 <= column < shape[1]):
        raise AnytimeError(
            f"{name} cell ({row}, {column}) is outside the map of {shape[0]} rows"
            f" and {shape[1]} columns"
        )
    return row * shape[1] + column


def _query(
    grid: NDArray[Any], wall: int, start: Cell, goal: Cell, connectivity: int
) -> tuple[NDArray[np.uint8], int, int]:
    if connectivity not in (4, 8):
        raise AnytimeError(f"connectivity is {connectivity}, it must be 4 or 8")
    cells = flat_free(grid, "the map") if wall == 0 else flat(grid, "the map")
    ends = []
    for cell, name in ((start, "start"), (goal, "goal")):
        index = index_of(cell, grid.shape, name)
        if cells[index] == wall:
            raise AnytimeError(f"{name} cell ({cell[0]}, {cell[1]}) is blocked, choose a free cell")
        ends.append(index)
    return cells, ends[0], ends[1]


def percent_of(weight: float) -> int:
    """A weight of the heuristic in whole per cent, never more: it is a promise.

    Raises AnytimeError for what is no number between 1 and 100.
    """
    if not is_number(weight) or not 1.0 <= weight <= 100.0:
        raise AnytimeError(f"weight is {weight!r}, it must be a number between 1 and 100")
    return math.floor(100 * weight + 1e-6)  # 1.15 is a little less in binary


def _soft(
    grid: NDArray[np.uint8],
    wall: int,
    columns: int,
    first: int,
    last: int,
    weight: float,
    connectivity: int,
) -> Path | None:
    work, diagonals, percent = workspace(grid.size), connectivity == 8, percent_of(weight)
    row, column = divmod(last, columns)
    target, box = (row, column, row + 1, column + 1), (0, 0, grid.size // columns, columns)
    found, expansions = window_search(
        grid, wall, columns, first, target, box, diagonals, percent, 1, UNLIMITED, work
    )
    cost = int(work.clock[0] - work.label[last]) if found >= 0 else int(found)
    return _read_back(grid, wall, columns, first, last, diagonals, cost, int(expansions), work)


def _read_back(
    grid: NDArray[np.uint8],
    wall: int,
    columns: int,
    first: int,
    last: int,
    diagonals: bool,
    cost: int,
    expansions: int,
    work: Workspace,
) -> Path | None:
    if cost == NO_PATH:
        return None
    if cost < 0:
        raise TimeoutError(f"no shortest path known after {expansions} expansions")
    cells = path_to(grid, wall, columns, first, last, diagonals, work)
    # By a weight, labels that were corrected late make the way cheaper than its last one says.
    cost = int(way_cost(grid, wall, columns, cells, 0, len(cells) - 1))
    return _path(cells, columns, cost, expansions)


def _path(cells: NDArray[np.int32], columns: int, cost: int, expansions: int) -> Path:
    pairs, diagonal = cells_of(cells, columns, 0)
    # Counted rather than summed, so that equal ways have equal lengths to the last bit.
    return Path(pairs, len(pairs) - 1 - diagonal + diagonal * math.sqrt(2), cost, expansions)


def length_of(cells: NDArray[np.integer]) -> float:
    """Return the length in cells of a way [n, 2] from neighbour to neighbour."""
    diagonal = int(np.abs(np.diff(cells, axis=0)).sum()) - (len(cells) - 1)
    return len(cells) - 1 - diagonal + diagonal * math.sqrt(2)
