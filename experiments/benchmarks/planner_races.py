"""How good the best plan so far is, against work and against time, planner beside planner."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.executors import processes
from experiments.benchmarks.planner_rivals import PLANNERS
from planners import Grid, MultiPath, astar, blind_quality, textbook_astar
from planners import Path as Way
from planners.path_finding import Cell
from sensing import instance, read_map, read_scenarios

Track = Sequence[tuple[float, float]]
"""(share of A*'s work or time, quality) of each plan, in the order in which they came."""
LARGE = 20_000
"""Scenarios on maps on which A* expands more than this are raced on."""
_APART = 1.3  # the paper's plans are walked when the work has grown by so much
_RESAMPLES = 500
_CHUNK = 4  # instances a worker takes at a time
_TIMED = 0.9925  # a timed run is over when its plan is this good …
ENOUGH = 0.6  # … or when it has done so large a share of A*'s work
_TIMING = 0.1  # seconds for which a short race is repeated: one interruption must not decide it


@dataclass(frozen=True)
class Problem:
    """Where a race takes place: the index-th floor of a family, or a scenario of a map."""

    family: str
    size: int = 0
    index: int = 0
    seed: int = 0
    map: Path | None = None

    def load(self) -> tuple[NDArray[np.bool_], Cell, Cell]:
        if self.map is None:
            return instance(self.family, self.size, self.index, self.seed)
        free, scenarios = _map(self.map)
        return free, scenarios[self.index].start, scenarios[self.index].goal


@cache
def _map(path: Path) -> tuple[NDArray[np.bool_], Sequence]:
    grid = read_map(path)
    return grid.free, read_scenarios(path.with_name(f"{path.name}.scen"), grid)


@dataclass(frozen=True)
class Race:
    """What planners did on one problem.

    optimum: integer cost of the shortest way. work: expansions of the better of two A*. tracks: by
    planner, (share of that work, quality) whenever a plan came; an abstract one, which only the
    paper's planner makes, is walked blindly. total: share of work in
    all. final: quality of the last plan.
    """

    problem: Problem
    optimum: int
    work: int
    tracks: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    total: dict[str, float] = field(default_factory=dict)
    final: dict[str, float] = field(default_factory=dict)


def race(problem: Problem, names: Sequence[str], least: int = 0) -> Race | None:
    """Race planners on a problem, counted in work; None if A* expands no more than `least`."""
    free, start, goal = problem.load()
    best, textbook = astar(free, start, goal), None
    if best is None or best.expansions <= least:
        return None
    textbook = textbook_astar(free, start, goal)
    assert textbook is not None
    assert textbook.cost == best.cost
    found = Race(problem, best.cost, min(best.expansions, textbook.expansions))
    for name in names:
        spent, walked_at, track, last = 0.0, 0.0, [], None
        for step in PLANNERS[name](Grid.known(free), start, goal):
            spent += step.work
            if step.plan is not None:
                last = step.plan
                share, quality = spent / found.work, 0.0
                if last.level == 0 or share > _APART * walked_at:
                    quality, walked_at = _quality(free, last, start, goal, best), share
                track.append((share, quality))
            if name != "atp" and spent > 1.5 * found.work:
                break
        found.tracks[name] = track
        found.total[name] = spent / found.work
        found.final[name] = _quality(free, last, start, goal, best) if last is not None else 0.0
    return found


def _quality(free: NDArray[np.bool_], plan: MultiPath, start: Cell, goal: Cell, best: Way) -> float:
    """Shortest length / length walked: known for a way, walked blindly for an abstract plan."""
    if plan.level > 0:
        return blind_quality(free, plan.plan, start, goal, best.length)
    return best.length / plan.length if len(plan.plan) and plan.length > 0 else 0.0


def races(
    problems: Iterable[Problem], names: Sequence[str], least: int = 0, workers: int = 2
) -> list[Race]:
    """Race on all problems; counts are the same however many processes share them."""
    listed = list(problems)
    with processes(workers) as pool:
        found = pool.map(
            race, listed, [names] * len(listed), [least] * len(listed), chunksize=_CHUNK
        )
        return [each for each in found if each is not None]


def curve(found: Sequence[Race], name: str, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean quality of the best plan so far at each share of A*'s work; no plan counts 0."""
    return mean_quality([each.tracks[name] for each in found], shares)


def share_at(tracks: Sequence[Track], level: float) -> float | None:
    """Least share at which the mean quality of the best plan so far reaches a level."""
    found = float(shares_at(tracks, level, np.full((1, len(tracks)), 1.0 / len(tracks)))[0])
    return found if np.isfinite(found) else None


def shares_at(
    tracks: Sequence[Track], level: float, weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The same, with each row of weights of the tracks [rows, tracks]; inf where it never does."""
    shares = np.unique([share for track in tracks for share, _ in track])
    qualities = _qualities(tracks, shares)
    found = np.full(len(weights), np.inf)
    for row, weight in enumerate(weights):
        reached = np.flatnonzero(weight @ qualities >= level)
        if len(reached):
            found[row] = shares[reached[0]]
    return found


def resampled(count: int) -> NDArray[np.float64]:
    """Weights of instances in samples of them, [rows, count], for 95 % intervals."""
    drawn = np.random.default_rng(0).integers(count, size=(_RESAMPLES, count))
    return np.stack([np.bincount(row, minlength=count) for row in drawn]) / count


def mean_quality(tracks: Sequence[Track], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same of tracks, whatever they are against."""
    return _qualities(tracks, shares).sum(axis=0) / max(1, len(tracks))


def _qualities(tracks: Sequence[Track], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quality of the best plan so far of each track at each share, [tracks, shares]."""
    rows = np.zeros((len(tracks), len(shares)))
    for row, track in zip(rows, tracks, strict=True):
        at = np.array([share for share, _ in track])
        best = np.maximum.accumulate([quality for _, quality in track]) if track else np.zeros(0)
        index = np.searchsorted(at, shares, side="right") - 1
        row[:] = np.where(index >= 0, np.append(best, 0.0)[index], 0.0)
    return rows


def timed(found: Race, *, repeats: int = 3, grid: Grid | None = None) -> list[tuple[float, float]]:
    """ATP's track against time, in shares of our A*'s, interleaved with it: medians of repeats.

    repeats: the least number of them; there are more while they take less than `_TIMING`.
    grid: the map with what earlier queries have found out; a new one each time if None.
    """
    theirs: list[float] = []
    ours: list[list[float]] = []
    known: list[float] = []
    end = time.perf_counter() + _TIMING
    while len(ours) < repeats or time.perf_counter() < end:
        seconds, stamps, qualities = timed_once(found, grid)
        if qualities != known:  # the map has learnt more, so what was timed before is another race
            theirs, ours, known = [], [], qualities
        theirs.append(seconds)
        ours.append(stamps)
    steps = np.median(np.array(ours), axis=0) / np.median(theirs)
    return list(zip(steps.tolist(), known, strict=True))


def timed_once(found: Race, grid: Grid | None = None) -> tuple[float, list[float], list[float]]:
    """A*'s seconds, and the seconds and qualities of ATP's plans after it."""
    free, start, goal = found.problem.load()
    begin = time.perf_counter()
    best = astar(free, start, goal)
    seconds = time.perf_counter() - begin
    assert best is not None
    spent, stamps, qualities = 0.0, [], []
    begin = time.perf_counter()
    for step in PLANNERS["atp"](grid or Grid.known(free), start, goal):
        spent += step.work
        if step.plan is not None and step.plan.level == 0:
            stamps.append(time.perf_counter() - begin)
            qualities.append(best.length / step.plan.length)
            if qualities[-1] >= _TIMED:
                break
        if spent > ENOUGH * found.work:
            break
    return seconds, stamps, qualities
