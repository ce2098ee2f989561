"""What one look at the floor delivers, and how good it is against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.maps import BoolGrid, Cell


class Disc(NamedTuple):
    """The cells within the sensing radius: a window of the map and which of its cells are meant.

    The window begins at cell (`row`, `column`); `inside` is bool [h, w], cut off at the map's edge.
    """

    row: int
    column: int
    inside: BoolGrid

    @property
    def window(self) -> tuple[slice, slice]:
        """The window as an index into arrays of the whole map."""
        height, width = self.inside.shape
        return slice(self.row, self.row + height), slice(self.column, self.column + width)


def disc(center: Cell, radius: int, shape: tuple[int, int]) -> Disc:
    """The cells at most `radius` cells from `center`, on a map of that shape.

    Raises AnytimeError if the centre lies off the map or the radius is negative.
    """
    rows, columns = shape
    row, column = center
    if not (0 <= row < rows and 0 <= column < columns):
        raise AnytimeError(f"center is {center}: it must lie on the map of {rows} x {columns}")
    if radius < 0:
        raise AnytimeError(f"radius is {radius}: it must be 0 cells or more")
    top, left = max(row - radius, 0), max(column - radius, 0)
    bottom, right = min(row + radius + 1, rows), min(column + radius + 1, columns)
    down, across = np.arange(top, bottom) - row, np.arange(left, right) - column
    reach = min(radius, rows + columns)  # from where on it holds all of the map
    return Disc(top, left, down[:, None] ** 2 + across**2 <= reach**2)


@dataclass(frozen=True)
class MapScore:
    """How good a description of the floor is, over `cells` cells.

    `quality` is (right + half of the unknown) / cells. `false_free` is the share of the blocked
    cells called free, `false_blocked` that of the free cells called blocked; `all_free` is the
    quality of the description that calls every cell free, which any sensor must beat.
    """

    quality: float
    false_free: float
    false_blocked: float
    all_free: float
    cells: int

    def __str__(self) -> str:
        return (
            f"quality {self.quality:.3f} (all free {self.all_free:.3f}), false free"
            f" {self.false_free:.3f}, false blocked {self.false_blocked:.3f}, {self.cells} cells"
        )


def score(
    blocked: BoolGrid,
    free: BoolGrid,
    inside: BoolGrid | None = None,
    unknown: BoolGrid | None = None,
) -> MapScore:
    """Compare what is called blocked with the true floor `free`, all bool [rows, columns].

    Only the cells `inside` count (default all); those `unknown` count half whatever they are
    called.
    """
    if inside is None:
        inside = np.ones(free.shape, bool)
    cells = int(inside.sum())
    if cells == 0:
        raise AnytimeError("no cell to score: inside must hold at least one cell")
    known = inside if unknown is None else inside & ~unknown
    truly_free = free & inside
    n_free = int(truly_free.sum())
    n_blocked = cells - n_free
    called_free = known & ~blocked
    false_free = int((called_free & ~free).sum())
    false_blocked = int((known & blocked & free).sum())
    n_known = int(known.sum())
    right = n_known - false_free - false_blocked
    return MapScore(
        quality=(right + 0.5 * (cells - n_known)) / cells,
        false_free=false_free / n_blocked if n_blocked else 0.0,
        false_blocked=false_blocked / n_free if n_free else 0.0,
        all_free=n_free / cells,
        cells=cells,
    )


@dataclass(frozen=True, eq=False)
class SensedMap:
    """A sensor's description of the floor around the robot.

    `window` is the cell (row, column) of the map at which the arrays begin; `blocked` and `inside`
    are bool [h, w], what each cell is called and whether it is within the sensing radius. `quality`
    is the sensor's own, calibrated probability that a cell is called rightly. `confidence`,
    float32 [h, w], is that probability cell by cell where it differs; 0.5 says "unknown".
    """

    window: Cell
    blocked: BoolGrid
    inside: BoolGrid
    quality: float
    confidence: NDArray[np.float32] | None = None

    @property
    def unknown(self) -> BoolGrid | None:
        """The cells of which the sensor says nothing, or None if there are none by nature."""
        return None if self.confidence is None else self.confidence == 0.5

    @property
    def slices(self) -> tuple[slice, slice]:
        """The window as an index into arrays of the whole map."""
        return Disc(*self.window, self.inside).window

    def score(self, free: BoolGrid) -> MapScore:
        """How good the description is against the true floor, free bool [rows, columns]."""
        return score(self.blocked, free[self.slices], self.inside, self.unknown)

    def __repr__(self) -> str:
        height, width = self.blocked.shape
        return f"<SensedMap {height} x {width} cells at {self.window}, quality {self.quality:.3f}>"
