"""The quad-tree of obstacleness: how much of a block of cells obstacles cover [ZR93] §3.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.maps import Cell


@dataclass(frozen=True, eq=False)
class QuadTree:
    """The floor at every level of abstraction.

    `levels[n]` is float32 [ceil(rows / 2^n), ceil(columns / 2^n)]: position (i, j) of level n
    stands for a block of 2^n x 2^n cells, and holds the share of it that obstacles cover. Cells off
    the map count as blocked. Level 0 is the floor itself.
    """

    levels: tuple[NDArray[np.float32], ...]

    @property
    def level_max(self) -> int:
        """The most abstract level."""
        return len(self.levels) - 1

    def obstacleness(self, level: int, cell: Cell) -> float:
        """The share of the position that is blocked; positions off the map are wholly blocked."""
        grid = self.levels[self._checked(level)]
        row, column = cell
        if not (0 <= row < grid.shape[0] and 0 <= column < grid.shape[1]):
            return 1.0
        return float(grid[row, column])

    def project(self, cell: Cell, level: int) -> Cell:
        """The position of that level in which a cell of the floor lies."""
        self._checked(level)
        return cell[0] >> level, cell[1] >> level

    def _checked(self, level: int) -> int:
        if not 0 <= level <= self.level_max:
            raise AnytimeError(f"level is {level}: it must be from 0 to {self.level_max}")
        return level

    def __repr__(self) -> str:
        rows, columns = self.levels[0].shape
        top = self.levels[-1].shape
        return f"<QuadTree {rows} x {columns} cells, {len(self.levels)} levels up to {top}>"


def quad_tree(blocked: NDArray[np.generic], level_max: int | None = None) -> QuadTree:
    """Build the quad-tree of a floor, up to `level_max` or to the level of a single position.

    `blocked` is bool [rows, columns], or float: the probability of each cell being blocked.
    Raises AnytimeError if it is not 2-D, empty, or holds numbers that are no probabilities.
    """
    if blocked.ndim != 2 or blocked.size == 0:
        raise AnytimeError(f"blocked has shape {blocked.shape}: it must be 2-D and not empty")
    level = blocked.astype(np.float32)
    if not (float(level.min()) >= 0.0 and float(level.max()) <= 1.0):  # NaN is neither
        raise AnytimeError("blocked must hold booleans or probabilities from 0 to 1")
    highest = (max(level.shape) - 1).bit_length()
    if level_max is not None:
        if level_max < 0:
            raise AnytimeError(f"level_max is {level_max}: it must be 0 or more")
        highest = level_max
    levels = [level]
    while len(levels) <= highest:
        level = _parents(level)
        levels.append(level)
    for grid in levels:
        grid.flags.writeable = False
    return QuadTree(tuple(levels))


def _parents(level: NDArray[np.float32]) -> NDArray[np.float32]:
    """The mean of each block of 2 x 2, exact for booleans up to blocks of 4096 x 4096 cells."""
    rows, columns = level.shape
    if rows % 2 or columns % 2:
        level = np.pad(level, ((0, rows % 2), (0, columns % 2)), constant_values=1.0)
    total = level[0::2, 0::2] + level[0::2, 1::2]
    total += level[1::2, 0::2]
    total += level[1::2, 1::2]
    total *= np.float32(0.25)
    return total
