"""What a robot's sonars told of its surroundings: a map of cells, and where the echoes came from.

A sonar says how far the nearest thing in its cone is, and nothing of its bearing. So a reading
clears the cone up to that range, and spreads the news that something is there over the arc at that
range: each cell is as likely as it was before, given that not all of them are free. Where arcs from
several places cross, or all but a few cells of an arc are known to be free, it becomes certain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.sonar import Cone, Pose, Ranger, Sonars

Grid = NDArray[np.float32]

PRIOR = 0.02
"""Probability of a cell being blocked before anything is heard."""
MISSED = 0.2
"""Probability that a blocked cell in the open gives no echo; far above the sonar's own, because the
readings of a robot that stands still are not independent."""
FALSE_ECHO = 0.02
"""Probability of an echo from nothing."""
MOST, LEAST = 4.0, -7.0
"""Bounds of the log odds, so that what comes or goes is learnt within half a second."""
MEMORY = 30.0
"""Seconds in which what was heard loses all but 1/e of its weight: things move."""
APART = (0.05, math.radians(5.0))
"""Metres and radians that a sonar moves until what it tells is remembered beside what it told."""
REMEMBERED = 48
"""Cones that are remembered at most."""


@dataclass(frozen=True)
class Echoes:
    """One reading of both sonars, and where the robot took itself to be.

    ranges: left and right in metres; inf is no echo; NaN, 0 and less are no information.
    """

    time: float
    pose_in_world: Pose
    ranges: tuple[float, float]


@dataclass(frozen=True)
class Arc:
    """What one sonar told: `told` metres, give or take `thick`; inf, when there was no echo.

    blurred: it is only known that something is nearer than that. side: 0 left, 1 right. doubted:
    the next reading from there was silent, which may be a lost echo.
    """

    cone: Cone
    told: float
    thick: float
    blurred: bool
    side: int
    time: float
    doubted: bool = False

    @cached_property
    def stand(self) -> tuple[int, int, int, int]:
        """Which sonar it is of, and roughly where that was: a later arc from there replaces it."""
        step, turn = APART
        bearing = self.cone.bearing % math.tau
        return (
            self.side,
            round(self.cone.x / step),
            round(self.cone.y / step),
            round(bearing / turn),
        )


@dataclass(frozen=True, eq=False)
class SonarMap:
    """What a robot believes to stand around it, on a grid fixed in the world.

    log_odds: of each cell being blocked, float32 [rows, columns], row 0 = greatest y. corner: x of
    the left edge and y of the upper edge. cell: metres. heard: how many readings are in it. echoes:
    the last of them, if any. arcs: what was heard from different places, the latest last.
    """

    log_odds: Grid
    corner: tuple[float, float]
    cell: float = 0.05
    heard: int = 0
    echoes: Echoes | None = None
    arcs: tuple[Arc, ...] = ()

    @classmethod
    def around(cls, x: float, y: float, *, side: float = 6.0, cell: float = 0.05) -> SonarMap:
        """An empty map of a square of `side` metres around a place.

        Raises AnytimeError for lengths that make no grid of 2 to 1000 cells a side.
        """
        if not (cell > 0 and 2 <= side / cell <= 1000):
            raise AnytimeError(
                f"a map of {side} m in cells of {cell} m; it must be 2 to 1000 cells a side"
            )
        count = round(side / cell)
        log_odds = np.full((count, count), _PRIOR, np.float32)
        # on multiples of the cell, so that a shifted map falls on the same cells
        left, upper = round((x - side / 2) / cell), round((y + side / 2) / cell)
        return cls(log_odds, (left * cell, upper * cell), cell)

    def hear(self, echoes: Echoes, sonars: Sonars) -> SonarMap:
        """The map with one more reading of both sonars; a pose that is no number says nothing."""
        if not all(map(math.isfinite, echoes.pose_in_world)):
            return replace(self, heard=self.heard + 1)
        log_odds = self.log_odds.copy()
        if self.echoes is not None:
            passed = max(0.0, echoes.time - self.echoes.time)
            log_odds -= _PRIOR
            log_odds *= np.float32(math.exp(-passed / MEMORY))
            log_odds += _PRIOR
        arcs = [arc for arc in self.arcs if echoes.time - arc.time < MEMORY]
        for side, cone in enumerate(sonars.cones(echoes.pose_in_world)):
            told = echoes.ranges[side]
            if not told > 0:
                continue  # it says nothing; nor does NaN
            arc = _arc(cone, told, sonars.ranger, self.cell, side, echoes.time)
            self._hear(log_odds, arc, sonars.ranger.farthest)
            for old in [old for old in arcs if old.stand == arc.stand]:
                arcs.remove(old)
                if math.isinf(arc.told) and math.isfinite(old.told) and not old.doubted:
                    arc = replace(old, doubted=True)
            arcs.append(arc)
        known = tuple(arcs[-REMEMBERED:])
        return replace(self, log_odds=log_odds, heard=self.heard + 1, echoes=echoes, arcs=known)

    def centred(self, x: float, y: float, within: float = 1.0) -> SonarMap:
        """The map shifted so that the place is in its middle; as it is, if it is so `within` m.

        What leaves the map is forgotten. A place that is no number shifts nothing.
        """
        if not (math.isfinite(x) and math.isfinite(y)):
            return self
        rows, columns = self.log_odds.shape
        side = self.cell * columns, self.cell * rows
        middle = self.corner[0] + side[0] / 2, self.corner[1] - side[1] / 2
        if math.hypot(x - middle[0], y - middle[1]) <= within:
            return self
        right, down = round((x - middle[0]) / self.cell), round((middle[1] - y) / self.cell)
        moved = np.full_like(self.log_odds, _PRIOR)
        below, beside = max(0, rows - max(0, down)), max(0, columns - max(0, right))
        kept = moved[max(0, -down) : below, max(0, -right) : beside]
        kept[...] = self.log_odds[max(0, down) :, max(0, right) :][: kept.shape[0], : kept.shape[1]]
        corner = self.corner[0] + right * self.cell, self.corner[1] - down * self.cell
        return replace(self, log_odds=moved, corner=corner)

    def probabilities(self) -> Grid:
        """The probability of each cell being blocked, float32 [rows, columns]."""
        return np.float32(1.0) / (np.float32(1.0) + np.exp(-self.log_odds))

    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """x of the columns' middles, float [columns], and y of the rows', float [rows]."""
        rows, columns = self.log_odds.shape
        return (
            self.corner[0] + self.cell * (np.arange(columns) + 0.5),
            self.corner[1] - self.cell * (np.arange(rows) + 0.5),
        )

    def at(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> Grid:
        """Log odds of what is at places; those of the prior outside of the map."""
        rows, columns = self.log_odds.shape
        column = np.floor((x - self.corner[0]) / self.cell).astype(int)
        row = np.floor((self.corner[1] - y) / self.cell).astype(int)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        odds = self.log_odds[np.where(inside, row, 0), np.where(inside, column, 0)]
        return np.where(inside, odds, _PRIOR)

    def _hear(self, log_odds: Grid, arc: Arc, farthest: float) -> None:
        cone, told = arc.cone, arc.told
        silent = not math.isfinite(told)
        window = self._window(cone, farthest if silent else told + arc.thick)
        xs, ys = self.places()
        right, up = xs[window[1]][None, :] - cone.x, ys[window[0]][:, None] - cone.y
        distance = np.hypot(right, up)
        aside = np.abs(wrapped(np.arctan2(up, right) - cone.bearing))
        odds = log_odds[window]
        # a cell counts if its middle is in the cone, or, for the arc, if some of it may be
        inside = aside <= cone.half_angle
        if silent:
            inside &= distance <= farthest
        else:
            inner = 0.0 if arc.blurred else told - arc.thick
            near = aside <= cone.half_angle + 0.5 * self.cell / np.maximum(distance, self.cell)
            _raise(odds, near & (distance >= inner) & (distance <= told + arc.thick))
            inside &= distance < inner
        odds[inside] -= _CLEARED
        np.clip(odds, LEAST, MOST, out=odds)

    def _window(self, cone: Cone, reach: float) -> tuple[slice, slice]:
        """The part of the grid that a cone may touch."""
        rows, columns = self.log_odds.shape
        west, east, south, north = cone.bounds(reach)
        # one cell more, because a cell may touch the arc whose middle lies outside of the cone
        left = math.floor((west - self.corner[0]) / self.cell) - 1
        right = math.ceil((east - self.corner[0]) / self.cell) + 1
        upper = math.floor((self.corner[1] - north) / self.cell) - 1
        lower = math.ceil((self.corner[1] - south) / self.cell) + 1
        return (
            slice(min(max(upper, 0), rows), min(max(lower, 0), rows)),
            slice(min(max(left, 0), columns), min(max(right, 0), columns)),
        )

    def __repr__(self) -> str:
        rows, columns = self.log_odds.shape
        return f"<SonarMap {rows} x {columns} cells of {self.cell} m, {self.heard} readings>"


_PRIOR = np.float32(math.log(PRIOR / (1 - PRIOR)))
_CLEARED = np.float32(-math.log(MISSED))


def _arc(cone: Cone, told: float, ranger: Ranger, cell: float, side: int, time: float) -> Arc:
    told = told if told <= ranger.estimated else math.inf
    thick = 0.7 * cell + ranger.resolution + 2 * ranger.spread_at(min(told, ranger.estimated))
    return Arc(cone, told, thick, told <= ranger.nearest, side, time)


def _raise(odds: Grid, arc: NDArray[np.bool_]) -> None:
    """Something on the arc gave an echo: by Bayes' rule for each cell, the others as they were."""
    if not arc.any():
        return
    blocked = 1.0 / (1.0 + np.exp(-odds[arc].astype(np.float64)))
    free = np.log1p(-blocked)
    others = -np.expm1(free.sum() - free)  # probability that some other cell is blocked
    odds[arc] -= np.log(FALSE_ECHO + (1 - FALSE_ECHO) * others).astype(np.float32)


def wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles in [-pi, pi)."""
    return (angle + math.pi) % math.tau - math.pi
