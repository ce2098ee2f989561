"""The robot's map of its environment, which outlives the frame it was sensed in [ZR93] Fig. 1.

Every cell has log odds of being blocked. A look adds ±log(q / (1 - q)) to those within its disc; a
touch settles a cell for good.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.maps import BoolGrid, Cell
from sensing.sensed_maps import MapScore, SensedMap, disc, score

CLIP = 7.0
"""The greatest log odds that looking can reach: p = 0.9991; so one cell can always be unlearned."""

CERTAIN = 30.0
"""The log odds of a touched cell: finite, so that sums of them stay numbers."""


class Belief:
    """What the robot holds true about a floor of `shape` cells, of which `density` is blocked.

    `log_odds` is float32 [rows, columns]; `touched` is bool [rows, columns]: cells whose state is
    certain, because the robot stood on or beside them. Only `touched_blocked` cells are impassable:
    a wrong map never proves that there is no way.
    """

    def __init__(self, shape: tuple[int, int], density: float = 0.2) -> None:
        if not 0.0 < density < 1.0:
            raise AnytimeError(f"density is {density}: it must lie between 0 and 1")
        self.prior = float(np.float32(math.log(density / (1.0 - density))))
        self.log_odds: NDArray[np.float32] = np.full(shape, self.prior, np.float32)
        self.touched: BoolGrid = np.zeros(shape, bool)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.log_odds.shape
        return rows, columns

    def update(self, sensed: SensedMap) -> None:
        """Take in what was sensed; cells that were touched stay as they are."""
        window = sensed.slices
        odds = self.log_odds[window]
        if sensed.confidence is None:
            weight = weight_of(sensed.quality)
            step = np.where(sensed.blocked, np.float32(weight), np.float32(-weight))
        else:
            sure = np.clip(sensed.confidence, 1e-3, 1 - 1e-3)
            step = np.log(sure / (1 - sure))
            np.negative(step, where=~sensed.blocked, out=step)
        step += odds
        np.clip(step, -CLIP, CLIP, out=step)
        np.copyto(odds, step, where=sensed.inside & ~self.touched[window])

    def touch(self, cell: Cell, blocked: bool) -> None:
        """Settle one cell for good."""
        self.touched[cell] = True
        self.log_odds[cell] = CERTAIN if blocked else -CERTAIN

    def touch_around(self, cells: Cell | NDArray[np.integer], free: BoolGrid) -> None:
        """Settle every cell walked on, and its eight neighbours, by the true floor `free`.

        `cells` is one cell or int [n, 2]; free is bool [rows, columns].
        """
        walked = np.atleast_2d(np.asarray(cells, dtype=np.int64))
        if len(walked) == 1:
            row, column = (int(at) for at in walked[0])
            near = tuple(slice(max(at - 1, 0), max(at + 2, 0)) for at in (row, column))
            self.touched[near] = True
            self.log_odds[near] = np.where(free[near], np.float32(-CERTAIN), np.float32(CERTAIN))
            return
        rows, columns = (walked[:, None, :] + _AROUND).reshape(-1, 2).T
        inside = (rows >= 0) & (rows < self.shape[0]) & (columns >= 0) & (columns < self.shape[1])
        rows, columns = rows[inside], columns[inside]
        self.touched[rows, columns] = True
        self.log_odds[rows, columns] = np.where(
            free[rows, columns], np.float32(-CERTAIN), np.float32(CERTAIN)
        )

    def probabilities(self) -> NDArray[np.float32]:
        """The probability of each cell being blocked, float32 [rows, columns]."""
        return np.float32(1.0) / (np.float32(1.0) + np.exp(-self.log_odds))

    @property
    def blocked(self) -> BoolGrid:
        """The cells more likely blocked than not, bool [rows, columns]."""
        return self.log_odds > 0

    @property
    def touched_blocked(self) -> BoolGrid:
        """The cells known for certain to be blocked, bool [rows, columns]."""
        return self.touched & (self.log_odds > 0)

    @property
    def unknown(self) -> BoolGrid:
        """The cells of which nothing was learned so far, bool [rows, columns]."""
        return (self.log_odds == np.float32(self.prior)) & ~self.touched

    def score(
        self, free: BoolGrid, center: Cell | None = None, radius: int | None = None
    ) -> MapScore:
        """How good the belief is against the true floor, within the disc or on the whole map."""
        if center is None or radius is None:
            return score(self.blocked, free, None, self.unknown)
        near = disc(center, radius, self.shape)
        odds = self.log_odds[near.window]
        unknown = (odds == np.float32(self.prior)) & ~self.touched[near.window]
        return score(odds > 0, free[near.window], near.inside, unknown)

    def copy(self) -> Belief:
        """A belief of its own that begins with what this one holds true."""
        twin = Belief.__new__(Belief)
        twin.prior = self.prior
        twin.log_odds = self.log_odds.copy()
        twin.touched = self.touched.copy()
        return twin

    def __repr__(self) -> str:
        rows, columns = self.shape
        known = 1.0 - float(self.unknown.mean())
        return (
            f"<Belief {rows} x {columns} cells, {known:.0%} sensed, {self.touched.sum()} touched>"
        )


def weight_of(quality: float) -> float:
    """The log odds log(q / (1 - q)) that a look of that quality adds, at most 7."""
    if not 0.0 <= quality <= 1.0:
        raise AnytimeError(f"quality is {quality}: it must be a probability from 0 to 1")
    if quality in (0.0, 1.0):
        return CLIP if quality else -CLIP
    return min(max(math.log(quality / (1.0 - quality)), -CLIP), CLIP)


_AROUND = np.array([(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1)])
