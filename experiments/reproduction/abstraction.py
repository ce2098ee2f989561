"""What [ZR93] §3 says of plans across a floor, with perfect and with imperfect vision.

The floor is square, a fifth of its cells blocked at random, and start and goal lie in its corners.
The paper tells neither size nor density; `FAMILY` and `SIZE` are where its planner's quality at
completion and its share of A*'s work are nearest to what it prints; `sweeps` shows others.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from experiments.domains import probabilities
from experiments.reproduction.ways import PAPER, Way
from planners import astar, textbook_astar
from planners.avoidance import blind_walk
from planners.multipath import MultiPath, Step
from planners.path_finding import Cell
from sensing import instance
from sensing.vision import sense

FAMILY, SIZE = "r20", 128
VISION = 0.96
"""Quality of vision in the paper's §3.5."""
FLOORS = 30
"""Of a picture, from which the one in the middle is drawn."""
BATCH = 8
"""Domains of a draw of what is said on average: its figure is a ratio of their sums or means."""
ENOUGH_QUALITY = 0.93
"""The paper's quality at completion; ours counts as done when it is reached on average."""
ALIKE = 2.0
"""Up to this factor refinement steps cost approximately the same."""
_REPEATS = 3  # of each search that is timed, interleaved; the least counts


@dataclass(frozen=True, eq=False)
class Course:
    """Planning across one floor, step by step.

    work: expansions until each plan was there, [n]; quality: of each when it is walked blindly,
    [n]; reached: whether each walk arrived; total: the work until the planner was done.
    """

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    optimal: float
    plans: tuple[MultiPath, ...]
    work: NDArray[np.float64]
    quality: NDArray[np.float64]
    reached: bool
    total: float

    def best(self, work: float) -> float:
        """Quality of the last plan that is there after that work; 0 before the first."""
        there = int(np.searchsorted(self.work, work * (1.0 + 1e-12), side="right"))
        return float(self.quality[there - 1]) if there else 0.0


@dataclass(frozen=True)
class Floors:
    """Which floors are planned across, and how well they are seen (1: perfectly)."""

    family: str = FAMILY
    size: int = SIZE
    vision: float = 1.0


PERFECT, IMPERFECT = Floors(), Floors(vision=VISION)


def median_floor(seed: int) -> int:
    """The index of the floor, of `FLOORS`, whose first plan is the median, in the paper's way."""
    indices = range(seed, seed + FLOORS)
    return sorted(indices, key=lambda index: float(course(index, PAPER).quality[0]))[FLOORS // 2]


@lru_cache(maxsize=128)
def course(index: int, way: Way, floors: Floors = PERFECT) -> Course:
    """Plan across the index-th floor, one refinement a step in the paper's way."""
    free, start, goal = instance(floors.family, floors.size, index)
    way_across = astar(free, start, goal)
    assert way_across is not None  # instances are connected
    steps = list(_steps(way, seen(index, floors), start, goal))
    done = itertools.accumulate(step.work for step in steps)
    there = [(work, step.plan) for work, step in zip(done, steps, strict=True) if step.plan]
    plans = tuple(plan for _, plan in there)
    walks = [blind_walk(free, plan.plan, start, goal) for plan in plans]
    return Course(
        free,
        start,
        goal,
        way_across.length,
        plans,
        np.array([work for work, _ in there]),
        np.array([way_across.length / max(w.length, 1e-9) if w.reached else 0.0 for w in walks]),
        all(walk.reached for walk in walks),
        sum(step.work for step in steps),
    )


def seen(index: int, floors: Floors) -> NDArray[np.float32]:
    """The chance that each cell of the index-th floor is blocked, after a look of that quality."""
    free, start, goal = instance(floors.family, floors.size, index)
    if floors.vision >= 1.0:
        return (~free).astype(np.float32)
    middle = (floors.size // 2, floors.size // 2)
    rng = np.random.default_rng((index, 7))
    domain = probabilities(sense(free, middle, floors.size, floors.vision, rng), free.shape)
    domain[start] = domain[goal] = 0.0
    return domain


def _steps(way: Way, domain: NDArray[np.float32], start: Cell, goal: Cell) -> Sequence[Step]:
    if way is PAPER:
        return list(way.steps(domain, start, goal, grain=1))
    return list(way.steps(domain, start, goal))


def _batch(seed: int, way: Way, floors: Floors = PERFECT) -> list[Course]:
    return [course(BATCH * seed + place, way, floors) for place in range(BATCH)]


# --- The claims, one draw each.


def level3(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """Quality of the plan at level 3, the first; of ours, of its first."""
    return (float(course(seed, way, floors).quality[0]),)


def level10(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """Quality of the most refined plan that has segments at levels 1 and 0; of ours, of what is
    there after the same work."""
    paper = course(seed, PAPER, floors)
    place = mixed(paper)
    if place is None:
        return (math.nan,)
    if way is PAPER:
        return (float(paper.quality[place]),)
    return (course(seed, way, floors).best(float(paper.work[place])),)


def mixed(found: Course) -> int | None:
    """The last of its plans whose segments are at levels 1 and 0."""
    levels = [{segment.level for segment in plan.segments} for plan in found.plans]
    places = [place for place, those in enumerate(levels) if those == {0, 1}]
    return places[-1] if places else None


def final_quality(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """Quality at completion."""
    return (float(course(seed, way, floors).quality[-1]),)


def final_work(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """Expansions until completion over those of a textbook A*; of ours, until the mean quality is
    what the paper's is at completion."""
    found = _batch(seed, way, floors)
    wanted = [textbook_astar(each.free, each.start, each.goal) for each in found]
    optimal = sum(path.expansions for path in wanted if path)
    if way is PAPER:
        return (sum(each.total for each in found) / optimal,)
    shares = np.linspace(0.0, 2.0, 401)
    for share in shares:
        spent = [share * path.expansions for path in wanted if path]
        there = [each.best(work) for each, work in zip(found, spent, strict=True)]
        if np.mean(there) >= ENOUGH_QUALITY:
            return (float(share),)
    return (float(shares[-1]),)


def final_time(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """As `final_work`, in wall time; of ours, until its first plan that is as good as that."""
    ours, textbook = 0.0, 0.0
    for each in _batch(seed, way, floors):
        domain = (~each.free).astype(np.float32)
        enough = _enough(each) if way is not PAPER else math.inf
        planned, searched = least_times(
            lambda e=each, d=domain, n=enough: _run(way, d, e, n),
            lambda e=each: textbook_astar(e.free, e.start, e.goal),
        )
        ours, textbook = ours + planned, textbook + searched
    return (ours / textbook,)


def time_over_fastest(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """As `final_time` in the paper's way, over the fastest A* that we have."""
    planned, searched = 0.0, 0.0
    for each in _batch(seed, way, floors):
        domain = (~each.free).astype(np.float32)
        one, other = least_times(
            lambda e=each, d=domain: _run(way, d, e, math.inf),
            lambda e=each: astar(e.free, e.start, e.goal),
        )
        planned, searched = planned + one, searched + other
    return (planned / searched,)


def least_times(*searches: Callable[[], object]) -> tuple[float, ...]:
    """The least wall time of each, in seconds, of interleaved repetitions."""
    least = [math.inf] * len(searches)
    for _ in range(_REPEATS):
        for place, search in enumerate(searches):
            begin = time.perf_counter()
            search()
            least[place] = min(least[place], time.perf_counter() - begin)
    return tuple(least)


def _enough(found: Course) -> int:
    """The number of plans until one is as good as the paper's at completion."""
    return int(np.argmax(found.quality >= ENOUGH_QUALITY)) + 1


def _run(way: Way, domain: NDArray[np.float32], found: Course, enough: float) -> None:
    plans = 0
    for step in way.steps(domain, found.start, found.goal):
        plans += step.plan is not None
        if plans >= enough:
            return


def step_cost_invariant(seed: int, way: Way, floors: Floors = PERFECT) -> tuple[float, ...]:
    """Whether refining a segment costs approximately the same at all levels. Ours refines none."""
    if way is not PAPER:
        return (math.nan,)
    means = list(step_costs(_batch(seed, way, floors)).values())
    return (float(max(means) <= ALIKE * min(means)),)


def step_costs(courses: Sequence[Course]) -> dict[int, float]:
    """Mean expansions of refining a segment, by its level."""
    costs: dict[int, list[float]] = {}
    for found in courses:
        for before, after in itertools.pairwise(range(len(found.plans))):
            was, now = ([s.level for s in found.plans[at].segments] for at in (before, after))
            refined = [level for level in set(was) if level and was.count(level) > now.count(level)]
            if refined:
                work = float(found.work[after] - found.work[before])
                costs.setdefault(max(refined), []).append(work)
    return {level: float(np.mean(those)) for level, those in sorted(costs.items())}


def executable(seed: int, way: Way) -> bool:
    """Every plan, however abstract, and of a map with errors, leads to the goal."""
    return all(course(seed, way, floors).reached for floors in (PERFECT, IMPERFECT))


def noisy_first(seed: int, way: Way, floors: Floors = IMPERFECT) -> tuple[float, ...]:
    """Quality of the first plan with imperfect vision."""
    return (float(course(seed, way, floors).quality[0]),)


def noisy_lower_on_average(seed: int, way: Way) -> bool:
    """On the same floors, plans of a map with errors are worse on average."""
    means = [
        np.mean([each.quality.mean() for each in _batch(seed, way, floors)])
        for floors in (PERFECT, IMPERFECT)
    ]
    return bool(means[1] < means[0])
