"""ATP, the interruptible abstract planner [ZR93 §3], for maps of any kind.

The paper's planner (`planners.paper_atp`) searches abstractly by obstacleness and refines segments
between points that it has pinned; it fails where there are walls. This one keeps the outline, first
coarse, then ever finer where it is worst. Where obstacles are walls, the coarse way leads over the
graph of regions, whose connectivity is exact; where they are independent of each other, a heuristic
that expects what ways cost at their density lets a search run straight through. The way in hand is
then made shorter, in windows along it or by searches that expect ever less, and at last by one that
proves it optimal and makes it shorter on the way there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import anytime
from planners import blocks, coarse_way, improving, region_search, way_in_hand
from planners.frontier import least_way, way_cost
from planners.grids import Grid, endpoints
from planners.improving import COUNT, DONE, MEETING, NOTHING, UPPER, Run
from planners.landmarks import known_way
from planners.multipath import NO_WAY, MultiPath, Step, way_plan
from planners.norms import expected_norm, least_norm
from planners.path_finding import Cell
from planners.pool import Pool
from planners.problems import known_floors, walked_quality
from planners.search import NO_PATH, OUT_OF_BUDGET, SPAN, UNLIMITED

GRAIN = 500
"""Expansions between two steps: a fraction of a millisecond …"""
_FIRST_GRAIN = 4 * GRAIN  # … more of them while there is no way yet that could be told …
_FIRST_REGIONS = 2 * GRAIN  # … or of regions, each of which takes as long as five cells
_SMALL = 64  # cells of distance up to which exact search may be all that is needed …
_SMALL_BUDGET = 2500  # … and the expansions that it gets
_CLUSTERED = 0.15  # clustering from which on obstacles count as walls
_REGION_PERCENT = 112  # of the straight line: what search over regions expects over 128 cells …
_PERCENT_DOUBLED = 6  # … and how much more for every doubling, for pins err less over many regions
_TAXI = 1.2  # … and how many times as much without diagonals
_THIN, _DENSE = (0.1, 1.15), (0.2, 1.08)
"""By what the first search multiplies the norm of independent obstacles up to one density and from
another on: where they are few, a way that was found in haste is hardly longer …"""
_FAR = 256  # … over so many cells: nearer, to make it better takes longer than haste has saved …
_SCALES = (1.01, 0.995)  # … and the next ones do
_TRUSTED = 0.985  # … but where it expects less than so much of the way in hand, it is mistaken
_WIDE = 0.1  # and where it expands so much of the distance's square, the next finds no less to do
_WINDOWS = (8, 16, 32, 64)  # cells of the windows, pass by pass …
_WINDOW_SHARE = 4  # … which together take at most so many times the work of the coarse way
_PATIENCE = 12  # expansions per cell of distance after which a weight was too small


def steps(
    domain: NDArray[np.floating] | Grid, start: Cell, goal: Cell, *, connectivity: int = 8
) -> Iterator[Step]:
    """Plan from start to goal, coarsely at first, then ever better until the plan is optimal.

    `domain` is float32 [rows, columns], the probability that a cell is blocked, or a `Grid`, which
    keeps what queries find out about the map. A cell that is blocked for certain is impassable, a
    believed obstacle only dear. Every plan is a way from cell to cell, cheaper than the one before,
    with `estimate` a proven bound on its quality on the map as given; the last one is told once
    more if it took longer to prove that it is optimal. A step is some `GRAIN` expansions of work;
    one without a plan found none better. Work is counted in nodes taken from an open list, with
    1/16 for every other cell or word touched and 1/256 for every cell summed.

    Raises AnytimeError if start or goal is outside the domain or certainly blocked, and when it
    goes on after the map has changed. A last plan
    without any cell, of infinite length, says that no way exists.
    """
    grid = domain if isinstance(domain, Grid) else Grid(domain)
    first, last, diagonals = endpoints(grid, start, goal, connectivity)
    run, changes = _runs.take(grid.shape), grid.changes
    try:
        query = _Query(grid, first, last, diagonals, run)
        best, proven = math.inf, False
        for work in query.phases():
            plan = None
            if query.cost < best or (query.done and not proven and best < math.inf):
                plan, proven = query.plan(), query.done
                best = query.cost
            yield Step(work, plan)
            grid.unchanged(since=changes)
        if math.isinf(best):
            yield Step(0.0, NO_WAY)
    finally:
        run.state[COUNT], run.state[MEETING] = 0, NOTHING
        _runs.put_back(grid.shape, run)


def _first_scale(density: float, far: int) -> float:
    (thin, hasty), (dense, careful) = _THIN, _DENSE
    if far < _FAR:
        return careful
    return hasty + (careful - hasty) * min(max((density - thin) / (dense - thin), 0.0), 1.0)


_runs = Pool(improving.new_run)
_region_runs = Pool(region_search.new_region_run)


class _Query:
    """One query at work: the way in hand is in `run`, and costs `cost`.

    least: proven lower bound of the cost of any way. coarse: work of the search over regions.
    """

    def __init__(self, grid: Grid, start: int, goal: int, diagonals: bool, run: Run) -> None:
        self.grid, self.start, self.goal, self.diagonals, self.run = (
            grid, start, goal, diagonals, run,
        )  # fmt: skip
        columns = grid.shape[1]
        self.down = goal // columns - start // columns
        self.across = goal % columns - start % columns
        self.least: float = int(least_way(self.down, self.across, diagonals))
        self.cost: float = math.inf
        self.coarse = 0.0
        self._map = (grid.cost, grid.wall, columns)
        self._soft = (grid.cost, grid.wall, grid.dearest, columns)

    def phases(self) -> Iterator[float]:
        """Work step by step; see `steps`."""
        far = max(abs(self.down), abs(self.across))
        if far <= _SMALL:
            yield from self.search(budget=_SMALL_BUDGET)
            if self.done:
                return
        density, clustering, looked = self.grid.features
        scale = _first_scale(density, far)
        works = self.through(scale, far) if clustering < _CLUSTERED else self.around(scale, far)
        besides = looked / blocks.EXPANDED  # told with the first step: another takes microseconds
        for work in works:
            yield besides + work
            besides = 0.0
        if not self.done:
            yield from self.search()

    def through(self, scale: float, far: int) -> Iterator[float]:
        """Ways straight through obstacles that are independent of each other."""
        yield from self.search(scale, patience=_PATIENCE * far)
        for scale in _SCALES:
            if self.done or math.isinf(self.cost):
                break
            spent = 0.0
            for work in self.search(scale):
                spent += work
                yield work
            if spent > _WIDE * far**2:
                break

    def around(self, scale: float, far: int) -> Iterator[float]:
        """Ways around walls, over regions first."""
        if self.grid.landmarks.known:
            yield from self.over_known_regions()
        if not self.done:
            yield from self.over_regions()
        if math.isinf(self.cost):  # the ends do not hang together but by believed obstacles
            yield from self.search(scale, patience=_PATIENCE * far)
        if self.done:
            return
        yield from self.learn()
        left = _WINDOW_SHARE * self.coarse
        for length in () if math.isinf(self.cost) else _WINDOWS:
            for work in self.windows(length):
                yield work
                left -= work
                if left < 0:
                    return

    @property
    def done(self) -> bool:
        """Whether the way in hand is optimal, or it is proven that there is none."""
        return self.cost <= self.least or math.isinf(self.least)

    def search(
        self, scale: float | None = None, *, budget: int = UNLIMITED, patience: int = UNLIMITED
    ) -> Iterator[float]:
        """Search for a better way: for the best, or by `scale` times the norm of the density.

        Where such a search gets stuck, for so many expansions, its norm was too small.
        """
        known = not math.isinf(self.cost)
        if scale is not None and known:
            self._expect(1.0)
            expected = int(improving.estimated(self.down, self.across, self.run.norm))
            scale = max(scale, _TRUSTED * self.cost / expected)
        query = (*self._map, self.start, self.goal, self.diagonals, self.run)
        density = 0.0 if scale is None else self.grid.features[0]
        upper = int(self.cost) if known else SPAN
        grain = GRAIN if known else _FIRST_GRAIN
        found, taken, cost, low = way_in_hand.set_out(
            *query, min(grain, budget), upper, density, scale or 0.0
        )
        left = patience
        while True:
            budget -= taken
            left -= taken
            if cost < SPAN:
                self.cost = int(cost)
            if scale is None:
                self.least = self.cost if found == DONE else max(self.least, int(low))
            elif found == OUT_OF_BUDGET and left < 0:
                scale, left = 1.25 * scale, patience
                self._expect(scale)
                improving.reweigh(self.grid.shape[1], self.goal, self.run)
            yield float(taken)
            if found == DONE or budget <= 0:
                break
            found, taken, cost, low = way_in_hand.go_on(*query, min(grain, budget))
        if found == OUT_OF_BUDGET and self.run.state[MEETING] >= 0:
            way_in_hand.take_up(*self._map, self.start, self.diagonals, self.run)
            self.cost = int(self.run.state[UPPER])

    def _expect(self, scale: float | None) -> None:
        if scale is None:
            least_norm(self.diagonals, self.run.norm)
        else:
            expected_norm(self.grid.features[0], scale, self.diagonals, self.run.norm)

    def over_known_regions(self) -> Iterator[float]:
        """A first way by what earlier queries have found out about distances."""
        grid, before = self.grid, self._in_hand()
        count, cost, work = known_way(
            *self._soft, self.start, self.goal, self.diagonals, grid.regions,
            grid.landmarks.tables, self.run.path,
        )  # fmt: skip
        if count:
            self._choose(int(count), int(cost), before)
            yield work / blocks.EXPANDED

    def over_regions(self) -> Iterator[float]:
        """A first way over the graph of regions, or a better one."""
        grid, run, before = self.grid, _region_runs.take(self.grid.shape), self._in_hand()
        far = max(abs(self.down), abs(self.across))
        percent = round(_REGION_PERCENT + _PERCENT_DOUBLED * math.log2(max(far / 128, 1.0)))
        if not self.diagonals:
            percent = round(_TAXI * percent)
        grain = _FIRST_REGIONS if before is None else GRAIN
        query = (
            self.goal, self.diagonals, percent, grid.regions, run, grid.landmarks.tables.far,
            grain * blocks.EXPANDED, self.run.path,
        )  # fmt: skip
        try:
            found, searched, besides, count, cost = coarse_way.set_out(
                *self._soft, self.start, *query
            )
            while found == OUT_OF_BUDGET:
                self.coarse += searched / blocks.EXPANDED
                yield int(searched + besides) / blocks.EXPANDED
                found, searched, besides, count, cost = coarse_way.go_on(*self._soft, *query)
        finally:
            _region_runs.put_back(grid.shape, run)
        self.coarse += searched / blocks.EXPANDED
        if found != NO_PATH:
            self._choose(int(count), int(cost), before)
        elif grid.wall == 0:
            self.least = math.inf
        yield int(searched + besides) / blocks.EXPANDED

    def learn(self) -> Iterator[float]:
        """Find out about distances for later queries."""
        for work in self.grid.landmarks.grow(self._soft, self.start, self.grid.regions):
            yield work / blocks.EXPANDED

    def _in_hand(self) -> NDArray[np.int32] | None:
        """A copy of the way in hand, if there is one, whose place another is written into."""
        return None if math.isinf(self.cost) else self.run.path[: self.run.state[COUNT]].copy()

    def _choose(self, count: int, cost: int, before: NDArray[np.int32] | None) -> None:
        """Keep the way of so many cells that was written, or the one before if it is no dearer."""
        if before is None or cost < self.cost:
            self.run.state[COUNT], self.cost = count, cost
        else:
            self.run.path[: len(before)] = before

    def windows(self, length: int) -> Iterator[float]:
        """Make the way optimal in windows of that many cells, one after the other."""
        state, done = self.run.state, False
        state[improving.POSITION] = 0
        self._expect(None)
        while not done:
            done, taken = way_in_hand.improve_windows(
                *self._map, length, self.diagonals, self.run, GRAIN
            )
            state[MEETING] = NOTHING
            self._weigh()
            yield float(taken)

    def _weigh(self) -> None:
        count = int(self.run.state[COUNT])
        self.cost = int(way_cost(*self._map, self.run.path, 0, count - 1))

    def plan(self) -> MultiPath:
        """The best way so far, as a plan without any abstraction."""
        cells, diagonal, cost = way_in_hand.so_far(
            *self._map, self.start, self.diagonals, self.run, int(self.cost)
        )
        self.cost = int(cost)
        return way_plan(cells, diagonal, self.cost, self.least)


def features_of(domain, start: Cell, goal: Cell) -> dict[str, float]:
    """What tells an easy query from a hard one: density and clustering of obstacles in [0, 1], and
    the distance in cells, straight ahead and diagonally. `domain` as for `steps`."""
    grid = domain if isinstance(domain, Grid) else Grid(domain)
    density, clustering, _ = grid.features
    distance = max(abs(start[0] - goal[0]), abs(start[1] - goal[1]))
    return {"density": density, "clustering": clustering, "distance": float(distance)}


@anytime.module(
    quality=walked_quality,
    estimate=lambda plan: plan.estimate,
    features=features_of,
    name="atp",
    problems=known_floors,
)
def find_path(domain, start, goal):
    """Plan a path from start to goal; `domain` is a `Grid` or each cell's probability of being
    blocked."""
    for step in steps(domain, start, goal):
        anytime.charge(step.work)
        yield step.plan
