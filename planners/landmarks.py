"""Landmarks: how far every region of a map is from a few of them, for a map asked about again.

The way between two regions is likely to be at least as long as what their distances from a landmark
differ by, which is far more than the straight way where walls are in between (Goldberg & Harrelson
2005, "Computing the shortest path: A* search meets graph theory"). And the regions by which each is
reached from a landmark make a tree, which holds a way between any two of them: the two ways to the
landmark, up to where they meet.

A distance is that of a search over regions, so it is a little more than the shortest, and between
the cells by which the regions are entered: what follows from it is no bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.blocks import EXPANDED, MOST, STREAMED, TOUCHED, UNKNOWN, Regions, region_of
from planners.frontier import way_cost
from planners.region_search import (
    LAST_REGION,
    MARKS,
    UNIT,
    RegionRun,
    begin_regions,
    new_region_run,
    search_regions,
)
from planners.search import OUT_OF_BUDGET, SPAN
from planners.tracing import connect, pins_along

CALLED = "3a950d31c499"

_EVERYWHERE = -2  # the goal's region of a search that goes on until it has been everywhere
_GRAIN = 1000 * EXPANDED  # work of such a search between two steps …
_STRIDE = 4096  # … and blocks of which its distances are kept then
_MOST = 0x7FFFFFFF  # of int32


class Tables(NamedTuple):
    """Of each region and landmark, far: the distance between them in units of 1 << `UNIT`, and one
    more; 0 if there is no way or none is known. before: the region before it on the way from there,
    -1 of the landmark's own. made: how many landmarks there are, [1]."""

    far: NDArray[np.int32]
    before: NDArray[np.int32]
    made: NDArray[np.int64]


def _tables(regions: int) -> Tables:
    far, before = np.zeros((regions, MARKS), np.int32), np.zeros((regions, MARKS), np.int32)
    return Tables(far, before, np.zeros(1, np.int64))


_NONE = _tables(0)


class Landmarks:
    """Landmarks of a map: from the second query on, each makes one more, up to `MARKS`."""

    def __init__(self, rows: int, columns: int) -> None:
        self.tables = _NONE
        self._shape = (rows, columns)
        self._asked = False
        self._source = self._next = -1  # the cell of the landmark that is being made, of the next
        # The search from there; nothing while a query, perhaps in another thread, goes on with it.
        self._search: list[RegionRun | None] = [None]

    @property
    def known(self) -> bool:
        """Whether there is a landmark, or one is being made."""
        return self.tables is not _NONE

    def grow(
        self, soft: tuple[NDArray[np.uint8], int, int, int], start: int, regions: Regions
    ) -> Iterator[int]:
        """Make one landmark more, or go on with one that an earlier query could not complete.

        The first is the start of a query, as is one from which no landmark can be reached; the
        others are where it is farthest from all. Yields work in 1/256 expansions, step by step.
        """
        region = region_of(soft[-1], start, regions)
        if not self._asked or region < 0:
            self._asked = True  # who asks about a map twice will ask again
            return
        if self.tables.made[0] == MARKS:
            return
        try:
            run = self._search.pop() or new_region_run(*self._shape)
        except IndexError:
            return
        try:
            if not self.known:
                self.tables = _tables(regions.count.size * MOST)
            tables, far, work = self.tables, _NONE.far, 0
            if self._source < 0:
                source = self._next if tables.far[region].any() else start
                work = begin_regions(*soft, source, source, 0, regions, run, far)
                run.state[LAST_REGION] = _EVERYWHERE
                self._source = source
            found = OUT_OF_BUDGET
            while found == OUT_OF_BUDGET:
                found, taken = search_regions(
                    *soft, self._source, True, 0, regions, run, far, _GRAIN
                )
                yield work + taken
                work = 0
            farthest = (-1, 0)
            for block in range(0, regions.count.size, _STRIDE):
                *farthest, work = set_landmark(
                    regions, tables, run, block, block + _STRIDE, *farthest
                )
                yield work
            self._source, self._next = -1, farthest[0]
            tables.made[0] += 1
        finally:
            self._search.append(run if self.tables.made[0] < MARKS else None)


@njit(cache=True, nogil=True, error_model="numpy")
def set_landmark(regions, tables, run, first, last, farthest, most):
    """Keep what a search that has been everywhere says of blocks `first` to `last` (exclusive) as
    their distances from the landmark that is being made.

    Returns (the pin of the region that is farthest from all landmarks, its distance from them, if
    it is more than that of the one given; work in 1/256 expansions).
    """
    far, before, mark = tables.far, tables.before, tables.made[0]
    label, base, count, work = run.label, run.clock[0], regions.count.size, 0
    for block in range(first, min(last, count)):
        work += STREAMED
        if regions.count[block] == UNKNOWN:
            continue
        for number in range(np.int64(regions.count[block])):
            region = number * count + block
            if label[region] <= base - SPAN:
                continue
            work += TOUCHED
            least = min(((base - label[region]) >> UNIT) + 1, np.int64(_MOST))
            far[region, mark], before[region, mark] = least, run.parent[region]
            for other in range(mark):
                if far[region, other] > 0:
                    least = min(least, np.int64(far[region, other]))
            if least > most:
                farthest, most = np.int64(run.pin[region]), least
    return farthest, most, work


@njit(cache=True, nogil=True, error_model="numpy")
def _first_goes(far, before, here, there, mark):
    """Whether of two regions the first goes on towards a landmark: the one that is farther off.

    A pin may lie a little nearer than the one before it, so two may pass each other; they meet at
    the landmark at the latest.
    """
    if before[here, mark] < 0 or before[there, mark] < 0:
        return before[here, mark] >= 0
    return far[here, mark] >= far[there, mark]


@njit(cache=True, nogil=True, error_model="numpy")
def _way_of_trees(tables, first, last):
    """The shortest of the ways between two regions that the landmarks' trees hold.

    Returns (its regions, from first to last, none if no tree holds a way; regions looked at).
    """
    far, before = tables.far, tables.before
    best, least, steps, touched = -1, np.int64(1) << 60, 0, 0
    for mark in range(tables.made[0]):
        if far[first, mark] == 0 or far[last, mark] == 0:
            continue
        here, there, total, count = first, last, np.int64(0), 0
        while here != there and total < least:
            count += 1
            if _first_goes(far, before, here, there, mark):
                above = np.int64(before[here, mark])
                total += np.int64(far[here, mark]) - far[above, mark]
                here = above
            else:
                above = np.int64(before[there, mark])
                total += np.int64(far[there, mark]) - far[above, mark]
                there = above
        touched += count
        if total < least:
            best, least, steps = mark, total, count
    if best < 0:
        return np.empty(0, np.int64), touched
    way, here, there = np.empty(steps + 1, np.int64), first, last
    ahead, behind = 0, steps
    way[0], way[behind] = first, last
    while here != there:
        if _first_goes(far, before, here, there, best):
            here = np.int64(before[here, best])
            ahead += 1
            way[ahead] = here
        else:
            there = np.int64(before[there, best])
            behind -= 1
            way[behind] = there
    return way, touched + steps


@njit(cache=True, nogil=True, error_model="numpy")
def known_way(cost, wall, dearest, columns, start, goal, diagonals, regions, tables, path):
    """Write the shortest way over the landmarks' trees into `path`.

    Returns (its cells, 0 if no tree holds a way; its cost; work in 1/256 expansions).
    """
    first, last = region_of(columns, start, regions), region_of(columns, goal, regions)
    if first < 0 or last < 0 or tables.made[0] == 0:
        return 0, np.int64(0), 0
    way, touched = _way_of_trees(tables, first, last)
    if way.size == 0:
        return 0, np.int64(0), touched * TOUCHED
    pins, more = pins_along(columns, start, goal, diagonals, regions, way)
    count, most = connect(cost, wall, dearest, columns, pins, way, regions, diagonals, path)
    spent = way_cost(cost, wall, columns, path, 0, count - 1)
    return count, spent, (touched + more + most) * TOUCHED
