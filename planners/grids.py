"""A map as the planner keeps it: costs of its cells, and what it has found out about them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.machine_code import njit
from planners.blocks import SIDE, UNKNOWN, Regions, forget, new_regions
from planners.landmarks import Landmarks
from planners.map_features import features
from planners.path_finding import Cell, flat_free, index_of
from planners.pool import Pool
from planners.refining import FULL
from planners.search import WALL

CALLED = "856a7d970f15"

_DEAREST = 250  # cost of the dearest believed obstacle
_PASSABLE = 5  # a cell that is as likely free as blocked costs this much
_SAMPLE = 128  # blocks from which density and clustering are taken


def _odds_costs() -> NDArray[np.uint8]:
    p = np.arange(FULL + 1) / FULL
    odds = p[:-1] / (1.0 - p[:-1])
    return np.append(np.minimum(1.0 + 4.0 * odds, _DEAREST) + 0.5, WALL).astype(np.uint8)


BELIEVED = _odds_costs()
"""Cost of a cell by its probability of being blocked, by the odds; certain obstacles are walls."""


_regions = Pool(new_regions)  # those of a new map would have to get their pages from the system


class Grid:
    """A map to plan on, again and again: what a query finds out about it helps the next.

    `domain` is float [rows, columns], the probability that a cell is blocked: what is certainly
    blocked is impassable, a believed obstacle only dear. `Grid.known(free)` takes a map without
    doubt. Nothing of the size of the map is computed here beyond the costs; blocks are looked at
    when a query comes to them.
    """

    # Not a cached property, whose lock takes two hundredths of the time of a first plan.
    _features: tuple[float, float, int] | None = None

    def __init__(self, domain: NDArray[np.floating]) -> None:
        domain = _floats(domain)
        if domain.ndim != 2 or not domain.size:
            raise AnytimeError(f"the domain is {list(domain.shape)}, it must be [rows, columns]")
        cost = np.empty(domain.size, np.uint8)
        if not _cost(domain.reshape(-1), cost):
            raise AnytimeError("the domain holds a number outside [0, 1]: give probabilities")
        self._set(cost, WALL, domain.shape)

    @classmethod
    def known(cls, free: NDArray[np.bool_]) -> Grid:
        """A map without doubt: `free` is bool [rows, columns], or bytes 0 and 1. It is not copied
        if it lies in one piece and may be written.

        Raises AnytimeError for other bytes: searches read them as bits.
        """
        grid = cls.__new__(cls)
        grid._set(flat_free(free, "free"), 0, free.shape)
        return grid

    def _set(self, cost: NDArray[np.uint8], wall: int, shape: tuple[int, ...]) -> None:
        self.cost = cost
        self.wall = wall
        self.shape: tuple[int, int] = (shape[0], shape[1])
        self.changes = 0  # so many updates

    @property
    def dearest(self) -> int:
        """The cost up to which a cell counts as free in the graph of regions."""
        return 1 if self.wall == 0 else _PASSABLE

    @cached_property
    def regions(self) -> Regions:
        """What queries have found out about the map's blocks so far."""
        regions = _regions.take(self.shape)
        regions.count[:] = UNKNOWN
        return regions

    def __del__(self, put_back=_regions.put_back) -> None:
        # Not by a weak reference: who revives the map must not share arrays with another.
        regions = vars(self).pop("regions", None)
        if regions is not None:
            put_back(self.shape, regions)

    @cached_property
    def landmarks(self) -> Landmarks:
        """What later queries have found out about distances so far."""
        return Landmarks(*self.shape)

    @property
    def features(self) -> tuple[float, float, int]:
        """(density of what is blocked, its clustering, cells looked at): see `map_features`."""
        if self._features is None:
            self._features = features(self.cost, self.wall, self.dearest, self.shape[1], _SAMPLE)
        return self._features

    def update(self, top: int, left: int, domain: NDArray[np.floating]) -> None:
        """Take in new probabilities of a rectangle [height, width] with that upper left cell.

        Only its blocks are looked at again. Raises AnytimeError if it is not on the map, holds no
        probabilities, or if the map is `known` and a cell neither blocked nor free.
        """
        rows, columns = self.shape
        domain = _floats(domain)
        if domain.ndim != 2:
            raise AnytimeError(f"the domain is {list(domain.shape)}, it must be [height, width]")
        height, width = domain.shape
        if not (0 <= top <= top + height <= rows and 0 <= left <= left + width <= columns):
            raise AnytimeError(
                f"cells ({top}, {left}) to ({top + height - 1}, {left + width - 1}) are not all on "
                f"the map of {rows} rows and {columns} columns"
            )
        patch = domain.reshape(-1)
        cost = np.empty(patch.size, np.uint8)
        if not _cost(patch, cost):
            raise AnytimeError("the domain holds a number outside [0, 1]: give probabilities")
        if self.wall == 0:
            if not np.isin(patch, (0.0, 1.0)).all():
                raise AnytimeError("the map is known: its cells are 0 (free) or 1 (blocked)")
            cost = (patch == 0.0).astype(np.uint8)
        self.cost = self.cost if self.cost.flags.writeable else self.cost.copy()
        self.cost.reshape(rows, columns)[top : top + height, left : left + width] = cost.reshape(
            height, width
        )
        forget(self.regions, columns, top, left, top + height, left + width)
        self.__dict__.pop("landmarks", None)
        self.changes += 1

    def unchanged(self, *, since: int) -> None:
        """Raise AnytimeError if there was an update since so many `changes`."""
        if self.changes != since:
            raise AnytimeError("the map has changed while a plan was made; plan anew")

    def __getstate__(self) -> dict[str, Any]:
        """The map alone: a copy finds out anew, in arrays of its own."""
        found_out = ("regions", "landmarks", "_features")
        state = {name: value for name, value in vars(self).items() if name not in found_out}
        return {**state, "cost": self.cost.copy()}

    def __repr__(self) -> str:
        seen = int((self.regions.count != 255).sum())
        return (
            f"<Grid {self.shape[0]} x {self.shape[1]} cells, {seen} of {self.regions.count.size} "
            f"blocks of {SIDE} x {SIDE} looked at>"
        )


def _floats(domain: object) -> NDArray[np.float32]:
    if getattr(domain, "dtype", None) == np.bool_:
        raise AnytimeError(
            "the domain is bool, it must be probabilities of being blocked: (~free).astype(float); "
            "`Grid.known(free)` takes a whole map of free cells"
        )
    try:
        return np.ascontiguousarray(domain, np.float32)
    except (TypeError, ValueError):
        raise AnytimeError(
            f"the domain is a {type(domain).__name__}; give probabilities, [rows, columns]"
        ) from None


def endpoints(grid: Grid, start: Cell, goal: Cell, connectivity: int) -> tuple[int, int, bool]:
    """Flat indices of start and goal, and whether diagonals are allowed.

    Raises AnytimeError if one of them is outside the map or certainly blocked, and for a
    connectivity that is neither 4 nor 8.
    """
    if connectivity not in (4, 8):
        raise AnytimeError(f"connectivity is {connectivity}, it must be 4 or 8")
    ends: list[int] = []
    for cell, name in ((start, "start"), (goal, "goal")):
        index = index_of(cell, grid.shape, name)
        if grid.cost.item(index) == grid.wall:
            raise AnytimeError(
                f"{name} cell ({cell[0]}, {cell[1]}) is blocked for certain, choose a free cell"
            )
        ends.append(index)
    return ends[0], ends[1], connectivity == 8


@njit(cache=True, nogil=True)
def _cost(domain, cost):
    """Write the cost of every cell; False if one holds no probability."""
    for place in range(domain.size):
        p = float(domain[place])
        if not 0.0 <= p <= 1.0:
            return False
        cost[place] = BELIEVED[int(p * FULL)]
    return True
