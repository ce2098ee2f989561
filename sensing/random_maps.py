"""Random floors, by the families on which path planners are compared."""

from __future__ import annotations

import hashlib
import re

import numpy as np
from scipy import ndimage

from anytime.errors import AnytimeError
from sensing.maps import BoolGrid, Cell, nearest_free

FAMILIES = ("r10", "r20", "r30", "r35", "rooms", "clustered", "maze")
"""The families of `instance`; `rNN` for any other density of NN % works as well."""

_MOST_DRAWS = 1000


def uniform(size: int | tuple[int, int], density: float, rng: np.random.Generator) -> BoolGrid:
    """A floor whose cells are blocked independently, each with probability `density`.

    Returns free, bool [rows, columns]; `size` is the side of a square or (rows, columns).
    """
    shape = _shape(size)
    _check_share(density, "density")
    return rng.random(shape) >= density


def clustered(size: int | tuple[int, int], density: float, rng: np.random.Generator) -> BoolGrid:
    """A floor with rounded obstacles: white noise smoothed (sigma 4 cells), cut at the quantile.

    Returns free, bool [rows, columns]; the share `density` is blocked.
    """
    shape = _shape(size)
    _check_share(density, "density")
    noise = ndimage.gaussian_filter(rng.standard_normal(shape), sigma=4.0)
    return noise >= np.quantile(noise, density) if density < 1.0 else np.zeros(shape, bool)


def rooms(
    size: int | tuple[int, int], rng: np.random.Generator, room: int = 16, doors: float = 0.8
) -> BoolGrid:
    """A floor of square rooms of `room` cells a side, parted by walls of one cell.

    The share `doors` of the walls between neighbouring rooms has a door of one cell.
    Returns free, bool [rows, columns].
    """
    rows, columns = _shape(size)
    _check_share(doors, "doors")
    if room < 1:
        raise AnytimeError(f"room is {room}: a room has at least one cell a side")
    period = room + 1
    free = np.ones((rows, columns), bool)
    free[room::period, :] = False
    free[:, room::period] = False
    for grid in (free, free.T):  # the walls below rooms, then those to their right
        for wall in range(room, grid.shape[0] - 1, period):
            starts = np.arange(0, grid.shape[1], period)
            widths = np.minimum(room, grid.shape[1] - starts)
            has_door = rng.random(starts.size) < doors
            at = starts + (rng.random(starts.size) * widths).astype(np.int64)
            grid[wall, at[has_door]] = True
    return free


def maze(size: int | tuple[int, int], rng: np.random.Generator, corridor: int = 3) -> BoolGrid:
    """A perfect maze (one path between any two places), walls of one cell, by depth-first search.

    Returns free, bool [rows, columns]; rows and columns that hold no whole corridor are blocked.
    """
    rows, columns = _shape(size)
    if corridor < 1 or corridor > min(rows, columns):
        raise AnytimeError(
            f"corridor is {corridor}: it must be at least 1 and fit into the {rows} x {columns} map"
        )
    period = corridor + 1
    high, wide = (rows + 1) // period, (columns + 1) // period
    steps = ((-1, 0), (1, 0), (0, -1), (0, 1))
    orders = rng.permuted(np.tile(np.arange(4), (high * wide, 1)), axis=1).tolist()
    free = np.zeros((rows, columns), bool)
    free[: high * period, : wide * period] = True
    free[corridor::period, :] = False
    free[:, corridor::period] = False
    seen = [[False] * wide for _ in range(high)]
    seen[0][0] = True
    trail = [(0, 0)]
    while trail:
        row, column = trail[-1]
        order = orders[row * wide + column]
        if not order:
            trail.pop()
            continue
        down, right = steps[order.pop()]
        r, c = row + down, column + right
        if not (0 <= r < high and 0 <= c < wide) or seen[r][c]:
            continue
        seen[r][c] = True
        trail.append((r, c))
        top, left = min(row, r) * period, min(column, c) * period
        free[
            top : top + corridor + period * abs(down), left : left + corridor + period * abs(right)
        ] = True
    return free


def corner_to_corner(free: BoolGrid) -> tuple[Cell, Cell]:
    """Start and goal: the free cells nearest to the upper left and the lower right corner."""
    rows, columns = free.shape
    return nearest_free(free, (0, 0)), nearest_free(free, (rows - 1, columns - 1))


def connected(free: BoolGrid, start: Cell, goal: Cell) -> bool:
    """Whether a robot can get from start to goal, 8-connected, without cutting corners.

    A diagonal needs both orthogonal neighbours free, so each diagonal can be replaced by two
    straight steps, and connectivity is that of the 4-neighbourhood.
    """
    if not (free[start] and free[goal]):
        return False
    labels, _ = ndimage.label(free)  # pyright: ignore[reportGeneralTypeIssues]
    return bool(labels[start] == labels[goal])


def instance(family: str, size: int, index: int, seed: int = 0) -> tuple[BoolGrid, Cell, Cell]:
    """The index-th problem of a family: (free, start, goal), corner to corner, always connected.

    Floors are drawn until one connects its corners, from a generator seeded by a hash of what is
    asked for. Raises AnytimeError for an unknown family, or if no such floor turns up.
    """
    key = f"{seed}/{family}/{size}/{index}".encode()
    rng = np.random.default_rng(
        int.from_bytes(hashlib.blake2b(key, digest_size=16).digest(), "little")
    )
    for _ in range(_MOST_DRAWS):
        free = _draw(family, size, rng)
        if not free.any():
            continue
        start, goal = corner_to_corner(free)
        if start != goal and connected(free, start, goal):
            return free, start, goal
    raise AnytimeError(
        f"{_MOST_DRAWS} floors of family {family}, size {size}, none with a path from corner to"
        " corner: take a lower density or a larger size"
    )


def _draw(family: str, size: int, rng: np.random.Generator) -> BoolGrid:
    if family == "rooms":
        return rooms(size, rng)
    if family == "clustered":
        return clustered(size, 0.3, rng)
    if family == "maze":
        return maze(size, rng)
    if re.fullmatch(r"r[0-9]{2}", family):
        return uniform(size, int(family[1:]) / 100, rng)
    raise AnytimeError(f"family {family!r}: it must be one of {', '.join(FAMILIES)}, or rNN")


def _shape(size: int | tuple[int, int]) -> tuple[int, int]:
    rows, columns = (size, size) if isinstance(size, int) else size
    if rows < 1 or columns < 1:
        raise AnytimeError(f"size is {size}: a floor has at least one row and one column")
    return rows, columns


def _check_share(share: float, name: str) -> None:
    if not 0.0 <= share <= 1.0:
        raise AnytimeError(f"{name} is {share}: it must be a share from 0 to 1")
