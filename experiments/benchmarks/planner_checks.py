"""What the planner must keep besides: optima, noisy maps, arrivals, deadlines, and a fast A*."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import anytime
from experiments.benchmarks.figures import median_interval
from experiments.benchmarks.planner_races import Race
from experiments.benchmarks.planner_rivals import PEERS
from planners import Grid, astar, blind_quality, blind_walk, find_path, route, steps
from sensing import FAMILIES, OPTIMUM_TOLERANCE, instance, read_map, read_scenarios

_NOISY_SIZE = 128
_PEER_SIZES = (256, 512)
_PEER_INSTANCES = 6  # the fewest that have a 95 % interval
_SLOW = 0.5  # seconds after which a rival is asked no more
_BUDGETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05)


def published(folder: Path, per_map: int, rng: np.random.Generator) -> dict[str, int]:
    """Compare A* with the optima of the `.scen` files."""
    wrong, scenarios, read = 0, 0, 0
    for path in sorted(folder.rglob("*.map.scen")):
        file = path.with_suffix("")
        if not file.is_file():
            continue
        grid = read_map(file)
        queries = read_scenarios(path, grid)
        for index in rng.choice(len(queries), min(per_map, len(queries)), replace=False).tolist():
            query = queries[index]
            found = astar(grid.free, query.start, query.goal)
            scenarios += 1
            if found is None or abs(found.length - query.optimal_length) > OPTIMUM_TOLERANCE:
                wrong += 1
        read += 1
    return {"astar.wrong_optimum": wrong, "astar.scenarios": scenarios, "astar.maps": read}


def below_exact(family: str, error: float, seed: int, count: int) -> float:
    """Mean shortfall of ATP's executed quality against the exact plan on the same wrong map."""
    shortfall = []
    for index in range(count):
        free, start, goal = instance(family, _NOISY_SIZE, index, seed)
        rng = np.random.default_rng((seed, index))
        wrong = rng.random(free.shape) < error
        wrong[start] = wrong[goal] = False
        sensed = free ^ wrong
        domain = np.where(sensed, error, 1.0 - error).astype(np.float32)
        domain[start] = domain[goal] = 0.0
        best = astar(free, start, goal)
        # Exact on the map as sensed; a believed obstacle is crossed only where there is no way.
        exact = route(np.where(sensed, 1, 250).astype(np.uint8), start, goal)
        assert best is not None
        assert exact is not None
        plans = [step.plan.plan for step in steps(domain, start, goal) if step.plan is not None]
        theirs, ours = (
            blind_quality(free, plan, start, goal, best.length)
            for plan in (np.pad(exact.cells, ((0, 0), (1, 0))), plans[-1])
        )
        shortfall.append(theirs - ours)
    return float(np.mean(shortfall))


def solved(
    random_floors: int,
    folder: Path | None,
    scenarios: int,
    seed: int,
    raced: dict[str, list[Race]],
) -> dict[str, float | int]:
    """Plan on many floors and maps, and walk every plan blindly on the floors.

    success: shares whose plans all arrive. worse_later: floors on which a later plan is walked
    longer than an earlier one. wrong_optimum: completed plans longer than the optimum, here and in
    the races.
    """
    reached, worse, wrong, tried = 0, 0, 0, 0
    for index in range(random_floors):
        free, start, goal = instance(FAMILIES[index % len(FAMILIES)], 32 + index % 129, index, seed)
        best = astar(free, start, goal)
        assert best is not None
        plans = [step.plan for step in steps(Grid.known(free), start, goal) if step.plan]
        walks = [blind_walk(free, plan.plan, start, goal) for plan in plans]
        reached += all(walked.reached for walked in walks)
        worse += any(later.length > earlier.length + 1e-9 for earlier, later in pairwise(walks))
        wrong += plans[-1].length > best.length * (1 + 1e-4)
        tried += 1
    files = sorted(folder.rglob("*.map.scen")) if folder else []
    for path in files:
        grid = read_map(path.with_suffix(""))
        queries, kept = read_scenarios(path, grid), Grid.known(grid.free)
        for index in np.linspace(0, len(queries) - 1, -(-scenarios // len(files))).astype(int):
            start, goal = queries[index].start, queries[index].goal
            best = astar(grid.free, start, goal)
            plans = [step.plan for step in steps(kept, start, goal) if step.plan]
            reached += best is not None and _leads(grid.free, plans[-1].plan[:, 1:], start, goal)
            wrong += best is not None and plans[-1].length > best.length * (1 + 1e-4)
            tried += 1
    completed = [each for found in raced.values() for each in found]
    wrong += sum(each.final["atp"] < 1 - 1e-4 for each in completed)
    return {
        "success": reached / tried,
        "success_instances": tried,
        "worse_later": worse,
        "wrong_optimum": wrong,
    }


def _leads(free: NDArray[np.bool_], cells: NDArray[np.int32], start: tuple, goal: tuple) -> bool:
    """Whether cells lead from start to goal, each free and next to the one before."""
    steps = np.abs(np.diff(cells, axis=0))
    ends = tuple(cells[0]) == tuple(start) and tuple(cells[-1]) == tuple(goal)
    return bool(ends and free[tuple(cells.T)].all() and (steps.size == 0 or steps.max() == 1))


def overruns(seed: int, trials: int) -> dict[str, float]:
    """By how much ATP is late for its deadline at 1024 x 1024, above an empty loop beside it."""
    free, start, goal = instance("r20", 1024, 0, seed)
    grid = Grid.known(free)
    anytime.run(find_path, grid, start, goal, seconds=0.02)
    late, floor = [], []
    for trial in range(trials):
        budget = _BUDGETS[trial % len(_BUDGETS)]
        begin = time.perf_counter()
        anytime.run(find_path, grid, start, goal, seconds=budget)
        late.append(time.perf_counter() - begin - budget)
        begin = time.perf_counter()
        while time.perf_counter() - begin < budget:
            pass
        floor.append(time.perf_counter() - begin - budget)
    p99, p50 = np.quantile(late, 0.99), np.quantile(late, 0.5)
    return {
        "overrun.p99_ms": 1e3 * max(0.0, float(p99 - np.quantile(floor, 0.99))),
        "overrun.p50_ms": 1e3 * max(0.0, float(p50 - np.quantile(floor, 0.5))),
        "overrun.floor_p99_ms": 1e3 * float(np.quantile(floor, 0.99)),
    }


def put_peers(
    figures: dict[str, float | int | None],
    missing: dict[str, str],
    seed: int,
    progress: Callable[[str], None],
    names: Sequence[str] = tuple(PEERS),
) -> None:
    """Times of other packages' A* over ours, on the size of floor on which they are closest."""
    for name in names:
        module, rival = PEERS[name]
        key = f"astar.vs_{name}"
        figures[key] = None
        if importlib.util.find_spec(module) is None:
            missing[key] = f"{module} is not installed: pip install 'anytime-robots[bench]'"
            continue
        progress(f"A* beside {name}")
        ratios = [_times_slower(rival, size, seed) for size in _PEER_SIZES]
        figures |= median_interval(key, min(ratios, key=np.median))


def _times_slower(rival: Callable[..., Callable[[], float]], size: int, seed: int) -> list[float]:
    """A rival's time over ours on each instance, interleaved, equal optima checked."""
    ratios: list[float] = []
    for index in range(_PEER_INSTANCES):
        free, start, goal = instance("r20", size, index, seed)
        query = rival(free, start, goal)
        ours, theirs = [], []
        while len(ours) < 3 and sum(theirs) < _SLOW:
            begin = time.perf_counter()
            path = astar(free, start, goal)
            middle = time.perf_counter()
            length = query()
            theirs.append(time.perf_counter() - middle)
            ours.append(middle - begin)
            assert path is not None
            assert not abs(path.length - length) > 1e-3 * path.length, "not the same problem"
        ratios.append(float(np.median(theirs) / np.median(ours)))
    return ratios
