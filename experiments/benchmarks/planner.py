"""The planner's figures: the paper's ATP against A*, and A* against published optima."""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.benchmarks.figures import Benchmark
from planners import astar, blind_quality, blind_walk, route, steps, textbook_astar, walk
from planners.path_finding import Cell
from sensing import FAMILIES, OPTIMUM_TOLERANCE, instance, map_folder, read_map, read_scenarios

_FAMILY, _SIZE = "r20", 128
_LARGER = (64, 256, 512)
_RESAMPLES = 2000
# Figures of a planner that goes beyond the paper's.
_PAPER_ONLY = "measured here is the paper's planner alone"
_LIMIT_KEYS = (
    *(
        f"iid.{size}.{density}.{what}_{level}"
        for size in (512, 1024, 2048)
        for density in ("r10", "r20", "r30")
        for what in ("work", "time")
        for level in ("q97", "q99")
    ),
    *(
        f"{family}.{what}_{level}"
        for family in ("rooms.512", "rooms.1024", "hard.r35", "hard.clustered", "hard.maze", "maps")
        for what in ("work", "time")
        for level in ("q97", "q99")
    ),
    "hard.total_work_max",
    "maps.time_kept_q97",
    "maps.count",
    "against.ara.worst",
    "against.rwa.worst",
    "final.quality",
    "final.work",
    "first_plan.random.work",
    "first_plan.maps.work",
    "wrong_optimum",
    "overrun.p99_ms",
)
_RIVAL_SIZE, _RIVAL_INSTANCES = 256, 3


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Benchmark:
    """Measure ATP on uniform floors and A* on the scenarios below `maps`.

    Quality is the blind executor's; work is in node expansions, over the smaller of our A*'s and a
    textbook A*'s on the same instance; time is wall time over our A*'s, medians of interleaved
    repetitions. Intervals are bootstrapped over instances. The quick form measures one size only.
    """
    count = 200 if full else 30 if quick else 60
    repeats = 5 if quick else 11
    rng = np.random.default_rng(seed)
    figures: dict[str, float | int | None] = {}
    missing: dict[str, str] = {}
    for size in (_SIZE,) if quick else (_SIZE, *_LARGER):
        progress(f"ATP on {count} floors of {size} x {size}, 20 % blocked")
        cell = np.array([_paper(size, index, seed, repeats) for index in range(count)])
        columns = zip(("q", "work", "time", "level3_q"), cell.T, strict=True)
        for name, values in columns:
            # A mean of wall times would be that of the interruptions.
            statistic = np.median if name == "time" else np.mean
            _put(figures, f"paper.{name}_{size}_{_FAMILY}", values, statistic, rng)
    folder = maps or map_folder()
    per_map = 20 if quick else 200 if full else 50
    if folder is None:
        for key in ("wrong_optimum", "scenarios", "maps"):
            figures[f"astar.{key}"] = None
            missing[f"astar.{key}"] = "no folder of maps: give --maps DIR or set ANYTIME_MAPS"
    else:
        wrong, scenarios, read = _published(folder, per_map, rng, progress)
        figures |= {
            "astar.wrong_optimum": wrong,
            "astar.scenarios": scenarios,
            "astar.maps": read,
        }
    for key, package, rival in (
        ("astar.vs_networkx", "networkx", _networkx),
        ("astar.vs_nano", "nano_astar", _nano),
    ):
        if importlib.util.find_spec(package) is None:
            figures[key] = None
            missing[key] = f"{package} is not installed: pip install 'anytime-robots[bench]'"
            continue
        progress(f"A* beside {package}")
        figures[key] = _times_slower(rival, seed)
    progress("quality on noisy maps")
    errors = (0.0, 0.02, 0.04, 0.1) if quick else (0.0, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1)
    figures["noisy.below_exact"] = max(
        _below_exact(family, error, seed, 30) for family in ("r10", "r20") for error in errors
    )
    progress("plans on every kind of floor")
    solved, tried, worse = _solved(1000, folder, 500 if full or not quick else 200, seed)
    figures["success"], figures["worse_later"] = solved / tried, worse
    missing |= dict.fromkeys(_LIMIT_KEYS, _PAPER_ONLY)
    figures |= dict.fromkeys(_LIMIT_KEYS)
    settings: dict[str, object] = {
        "instances": count,
        "noisy_errors": errors,
        "success_instances": tried,
        "repeats": repeats,
        "scenarios_per_map": per_map,
        "form": "full" if full else "quick" if quick else "standard",
        "denominator": "the smaller of our A* and a textbook A*, expansions, same instance",
        "connectivity": 8,
        "not_measured": missing,
    }
    return Benchmark("planner", figures, settings, seed)


def _paper(size: int, index: int, seed: int, repeats: int) -> tuple[float, float, float, float]:
    """One instance: quality at completion, work and time over A*'s, quality of the first plan."""
    free, start, goal = instance(_FAMILY, size, index, seed)
    domain = (~free).astype(np.float32)
    walls: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        for seconds, search in zip(
            walls,
            (lambda: astar(free, start, goal), lambda: list(steps(domain, start, goal))),
            strict=True,
        ):
            begin = time.perf_counter()
            search()
            seconds.append(time.perf_counter() - begin)
    optimal, textbook = astar(free, start, goal), textbook_astar(free, start, goal)
    assert optimal is not None
    assert textbook is not None
    assert optimal.cost == textbook.cost
    taken = list(steps(domain, start, goal))
    plans = [step.plan.plan for step in taken if step.plan is not None]
    first, last = (
        blind_quality(free, plan, start, goal, optimal.length) for plan in (plans[0], plans[-1])
    )
    work = sum(step.work for step in taken) / min(optimal.expansions, textbook.expansions)
    return last, work, float(np.median(walls[1]) / np.median(walls[0])), first


def _put(
    figures: dict[str, float | int | None],
    key: str,
    values: NDArray[np.float64],
    statistic: Callable[..., NDArray[np.float64] | np.floating],
    rng: np.random.Generator,
) -> None:
    """Add a figure with its 95 % interval, bootstrapped over instances."""
    drawn = values[rng.integers(0, len(values), (_RESAMPLES, len(values)))]
    low, high = np.quantile(statistic(drawn, axis=1), (0.025, 0.975))
    figures[key] = float(statistic(values))
    figures[f"{key}_low"], figures[f"{key}_high"] = float(low), float(high)


def _published(
    folder: Path, per_map: int, rng: np.random.Generator, progress: Callable[[str], None]
) -> tuple[int, int, int]:
    """Compare A* with the optima of the `.scen` files: (wrong, scenarios, maps)."""
    wrong, scenarios, read = 0, 0, 0
    for path in sorted(folder.rglob("*.map.scen")):
        file = path.with_suffix("")
        if not file.is_file():
            continue
        progress(f"A* on {file.name}")
        grid = read_map(file)
        queries = read_scenarios(path, grid)
        for index in sorted(
            rng.choice(len(queries), min(per_map, len(queries)), replace=False).tolist()
        ):
            query = queries[index]
            found = astar(grid.free, query.start, query.goal)
            scenarios += 1
            if found is None or abs(found.length - query.optimal_length) > OPTIMUM_TOLERANCE:
                wrong += 1
        read += 1
    return wrong, scenarios, read


def _below_exact(family: str, error: float, seed: int, count: int) -> float:
    """Mean shortfall of ATP's executed quality against the exact plan on the same wrong map."""
    shortfall = []
    for index in range(count):
        free, start, goal = instance(family, _SIZE, index, seed)
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


def _solved(
    random_floors: int, folder: Path | None, scenarios: int, seed: int
) -> tuple[int, int, int]:
    """Follow plans on many floors: (goals reached, instances, later plans walked longer).

    On random floors every plan is walked blindly; on the maps, where a blind walk may take the
    length of a maze, the completed plan by a robot that knows the map.
    """
    reached, worse = 0, 0
    for index in range(random_floors):
        free, start, goal = instance(FAMILIES[index % len(FAMILIES)], 32 + index % 33, index, seed)
        walks = [
            blind_walk(free, step.plan.plan, start, goal)
            for step in steps((~free).astype(np.float32), start, goal)
            if step.plan is not None
        ]
        reached += all(walked.reached for walked in walks)
        worse += any(later.length > earlier.length for earlier, later in pairwise(walks))
    tried, files = random_floors, sorted(folder.rglob("*.map.scen")) if folder else []
    for path in files:
        grid = read_map(path.with_suffix(""))
        queries = read_scenarios(path, grid)
        domain = (~grid.free).astype(np.float32)
        for index in np.linspace(0, len(queries) - 1, -(-scenarios // len(files))).astype(int):
            start, goal = queries[index].start, queries[index].goal
            plans = [step.plan for step in steps(domain, start, goal) if step.plan is not None]
            known, touched = np.where(grid.free, 1, 255).astype(np.uint8), np.zeros_like(grid.free)
            reached += walk(grid.free, known, touched, plans[-1].plan, start, goal).reached
            tried += 1
    return reached, tried, worse


def _times_slower(rival: Callable[..., Callable[[], float]], seed: int) -> float:
    """Median over instances of a rival's time over ours, interleaved, equal optima checked."""
    ratios = []
    for index in range(_RIVAL_INSTANCES):
        free, start, goal = instance(_FAMILY, _RIVAL_SIZE, index, seed)
        query = rival(free, start, goal)
        ours, theirs, length = [], [], 0.0
        for _ in range(3):
            begin = time.perf_counter()
            path = astar(free, start, goal)
            middle = time.perf_counter()
            length = query()
            theirs.append(time.perf_counter() - middle)
            ours.append(middle - begin)
            assert path is not None
            assert abs(path.length - length) < 1e-3 * path.length, "not the same problem"
        ratios.append(np.median(theirs) / np.median(ours))
    return float(np.median(ratios))


def _networkx(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """networkx's A* with the octile heuristic; making the graph is not counted."""
    networkx = importlib.import_module("networkx")

    graph = networkx.Graph()
    rows, columns = free.shape
    for row, column in np.argwhere(free).tolist():
        for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
            r, c = row + down, column + across
            if not (r < rows and 0 <= c < columns and free[r, column]):
                continue
            if free[row, c] and free[r, c]:
                graph.add_edge((row, column), (r, c), weight=2**0.5 if down and across else 1.0)

    def octile(one: Cell, other: Cell) -> float:
        near, far = sorted((abs(one[0] - other[0]), abs(one[1] - other[1])))
        return far - near + near * 2**0.5

    return lambda: networkx.astar_path_length(graph, start, goal, octile)


def _nano(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Callable[[], float]:
    """nano-astar on the same grid, octile, no corner cutting; its cost as length."""
    rival = importlib.import_module("nano_astar")
    grid = (~free).astype(np.uint8)
    return lambda: float(rival.astar(grid, start, goal, heuristic="octile", diagonal=True)[1])
