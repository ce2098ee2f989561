"""Grid maps: which cells of the floor a robot may stand on, and where they lie in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError

Cell = tuple[int, int]
BoolGrid = NDArray[np.bool_]

LARGEST_MAP = 64 * 1024 * 1024
"""The greatest number of cells that a map may have; readers refuse more from the header alone."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """A floor divided into square cells, each free or not; cells are (row, column), row 0 on top.

    `free` and `unknown` are bool [rows, columns] and read-only; a cell that nobody has seen is in
    `unknown` and is not free. `resolution` is metres per cell; `origin` is (x, y, yaw) of the lower
    left corner of the map in the world, in metres and radians, as ROS has it.

    Raises AnytimeError if the arrays are no map or the numbers are not finite.
    """

    free: BoolGrid
    unknown: BoolGrid | None = None
    resolution: float = 1.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    name: str = field(default="map")

    def __post_init__(self) -> None:
        free = _frozen(self.free, "free")
        if free.ndim != 2 or free.size == 0:
            raise AnytimeError(
                f"free has shape {free.shape}: a map is 2-D with at least one row and one column"
            )
        if free.size > LARGEST_MAP:
            raise AnytimeError(
                f"the map has {free.size} cells: at most {LARGEST_MAP} are allowed, so crop it"
            )
        object.__setattr__(self, "free", free)
        if self.unknown is not None:
            unknown = _frozen(self.unknown, "unknown")
            if unknown.shape != free.shape:
                raise AnytimeError(
                    f"unknown has shape {unknown.shape}: it must be that of free, {free.shape}"
                )
            if bool((unknown & free).any()):
                raise AnytimeError("a cell is both free and unknown: unknown cells are not free")
            object.__setattr__(self, "unknown", unknown)
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            raise AnytimeError(
                f"resolution is {self.resolution}: it must be metres per cell, a positive number"
            )
        if len(self.origin) != 3 or not all(math.isfinite(number) for number in self.origin):
            raise AnytimeError(
                f"origin is {self.origin}: it must be three finite numbers x, y, yaw"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.free.shape
        return rows, columns

    @property
    def blocked(self) -> BoolGrid:
        """The cells that are not free, unknown ones among them, bool [rows, columns]."""
        return ~self.free

    @property
    def free_share(self) -> float:
        """The share of all cells that is free."""
        return float(self.free.mean())

    def contains(self, cell: Cell) -> bool:
        """Whether the cell lies on the map."""
        return 0 <= cell[0] < self.shape[0] and 0 <= cell[1] < self.shape[1]

    def is_free(self, cell: Cell) -> bool:
        """Whether a robot may stand on the cell; off the map it may not."""
        return self.contains(cell) and bool(self.free[cell])

    def nearest_free(self, cell: Cell) -> Cell:
        """The free cell nearest to this one. Raises AnytimeError on a map without free cells."""
        return nearest_free(self.free, cell)

    def position_in_world(self, cell: Cell) -> tuple[float, float]:
        """Where the middle of the cell lies in the world, (x, y) in metres."""
        along = (cell[1] + 0.5) * self.resolution
        up = (self.shape[0] - cell[0] - 0.5) * self.resolution
        x, y, yaw = self.origin
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return x + cosine * along - sine * up, y + sine * along + cosine * up

    def cell_at(self, x_in_world: float, y_in_world: float) -> Cell:
        """The cell under a position in the world, in metres; it may lie off the map."""
        x, y, yaw = self.origin
        dx, dy = x_in_world - x, y_in_world - y
        cosine, sine = math.cos(yaw), math.sin(yaw)
        along, up = cosine * dx + sine * dy, cosine * dy - sine * dx
        row = self.shape[0] - 1 - math.floor(up / self.resolution)
        return row, math.floor(along / self.resolution)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GridMap):
            return NotImplemented
        mine, theirs = self.unknown, other.unknown
        same_unknown = (
            theirs is None if mine is None else theirs is not None and np.array_equal(mine, theirs)
        )
        return (
            (self.name, self.resolution, self.origin)
            == (other.name, other.resolution, other.origin)
            and np.array_equal(self.free, other.free)
            and same_unknown
        )

    def __hash__(self) -> int:
        return hash((self.name, self.shape, self.resolution, self.origin))

    def __str__(self) -> str:
        rows, columns = self.shape
        text = f"{self.name}: {rows} x {columns} cells of {self.resolution:g} m"
        text += f", {self.free_share:.0%} free"
        if self.unknown is not None:
            text += f", {self.unknown.mean():.0%} unknown"
        return text

    def __repr__(self) -> str:
        return f"<GridMap {self}>"


def nearest_free(free: BoolGrid, cell: Cell) -> Cell:
    """The free cell nearest to this one in a straight line, the upper left one of equals.

    Raises AnytimeError if no cell of `free`, bool [rows, columns], is free.
    """
    rows, columns = free.shape
    row, column = min(max(cell[0], 0), rows - 1), min(max(cell[1], 0), columns - 1)
    reach = 1
    while True:
        top, left = max(row - reach, 0), max(column - reach, 0)
        found = np.argwhere(free[top : row + reach + 1, left : column + reach + 1])
        whole = reach >= max(rows, columns)
        if len(found):
            distance = ((found + np.array((top - row, left - column))) ** 2).sum(axis=1)
            best = int(distance.argmin())
            # A cell beyond the window is at least reach + 1 away.
            if whole or distance[best] <= reach * reach:
                return int(found[best, 0]) + top, int(found[best, 1]) + left
        elif whole:
            raise AnytimeError("the map has no free cell: a robot needs at least one")
        reach *= 2


def _frozen(array: object, name: str) -> BoolGrid:
    grid = np.asarray(array)
    if grid.dtype != np.bool_:
        raise AnytimeError(f"{name} holds {grid.dtype}: it must be a bool array, True = {name}")
    if grid.flags.writeable:
        grid = grid.copy()
        grid.flags.writeable = False
    return grid
