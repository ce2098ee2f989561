"""The planner's figures: ATP beside A*, ARA* and others, the paper's planner, published optima."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import anytime
from experiments.benchmarks.figures import Benchmark
from experiments.benchmarks.planner_drawing import draw
from experiments.benchmarks.planner_races import LARGE, Problem, Race, curve, races, share_at, timed
from experiments.benchmarks.planner_rivals import PEERS
from planners import (
    Grid,
    astar,
    blind_quality,
    blind_walk,
    find_path,
    paper_steps,
    route,
    steps,
    textbook_astar,
)
from sensing import FAMILIES, OPTIMUM_TOLERANCE, instance, map_folder, read_map, read_scenarios

_FAMILY, _SIZE = "r20", 128
_RESAMPLES = 2000
_COUNT = 30  # instances a family
_RIVALS = ("atp", "ara", "rwa", "wa")
_SHARES = np.array([0.08, 0.1, 0.12, 0.15, *np.arange(0.2, 1.0001, 0.05)])
"""Shares of A*'s work at which planners are compared."""
_PEER_SIZES = (256, 512)
_PEER_INSTANCES = 3
_BUDGETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05)


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Benchmark:
    """Measure ATP and its rivals on the families of floors and on the scenarios below `maps`.

    Work is in node expansions (and other cells touched, by their weights) over the smaller of our
    A*'s and a textbook A*'s on the same instance; time is wall time over our A*'s, medians of
    interleaved repetitions, measured alone. The quick form leaves out the larger sizes.
    """
    figures: dict[str, float | int | None] = {}
    missing: dict[str, str] = {}
    rng = np.random.default_rng(seed)
    _put_paper(figures, 200 if full else _COUNT if quick else 60, 5 if quick else 11, seed, rng)
    folder, per_map = maps or map_folder(), 8 if quick else 60 if full else 20
    raced = _race_all(quick, folder, per_map, seed, progress)
    for key, found in raced.items():
        if not found:
            continue
        for level, name in ((0.97, "q97"), (0.99, "q99")):
            figures[f"{key}.work_{name}"] = share_at([each.tracks["atp"] for each in found], level)
        progress(f"{key}: time beside A*")
        figures |= _times(key, found, 1 if quick else 3)
    figures["maps.count"] = len(raced["maps"])
    _put_completion(figures, raced)
    _put_against(figures, raced)
    progress("published optima")
    if folder is None:
        reason = "no folder of maps: give --maps DIR or set ANYTIME_MAPS"
        missing |= {"astar.wrong_optimum": reason, "maps.count": reason}
        figures["astar.wrong_optimum"] = figures["maps.count"] = None
    else:
        figures |= _published(folder, 20 if quick else 200 if full else 50, rng)
    _put_peers(figures, missing, seed, progress)
    progress("noisy maps")
    errors = (0.0, 0.02, 0.04, 0.1) if quick else (0.0, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1)
    figures["noisy.below_exact"] = max(
        _below_exact(family, error, seed, _COUNT) for family in ("r10", "r20") for error in errors
    )
    progress("plans on every kind of floor")
    figures |= _solved(1000, folder, 500, seed, raced)
    progress("budgets")
    figures |= _overruns(seed, 60 if quick else 200)
    for key in _expected():
        if figures.get(key) is None:
            figures[key] = None
            missing.setdefault(key, "not in the quick form" if quick else "no map has such a query")
    settings: dict[str, object] = {
        "instances": _COUNT,
        "noisy_errors": errors,
        "shares_compared": [round(float(share), 3) for share in _SHARES],
        "scenarios_per_map": per_map,
        "form": "full" if full else "quick" if quick else "standard",
        "denominator": "the smaller of our A* and a textbook A*, expansions, same instance",
        "connectivity": 8,
        "not_measured": missing,
    }
    return Benchmark("planner", figures, settings, seed, picture=lambda path: draw(raced, path))


def _expected() -> list[str]:
    families = [
        *(f"iid.{size}.{family}" for size in (512, 1024, 2048) for family in ("r10", "r20", "r30")),
        *("rooms.512", "rooms.1024", "hard.r35", "hard.clustered", "hard.maze", "maps"),
    ]
    keys = [f"{key}.{what}_{q}" for key in families for what in ("work", "time")
            for q in ("q97", "q99")]  # fmt: skip
    return [*keys, "maps.time_kept_q97", "hard.total_work_max"]


def _race_all(
    quick: bool, folder: Path | None, per_map: int, seed: int, progress: Callable[[str], None]
) -> dict[str, list[Race]]:
    """Every family's races, by the prefix of its figures."""
    found: dict[str, list[Race]] = {}
    sizes = (512,) if quick else (512, 1024, 2048)
    for size in sizes:
        names = ("atp",) if size == 2048 else (*_RIVALS, "paper") if size == 512 else _RIVALS
        for family in ("r10", "r20", "r30"):
            progress(f"{family}, {size} x {size}")
            problems = [Problem(family, size, index, seed) for index in range(_COUNT)]
            found[f"iid.{size}.{family}"] = races(problems, names)
    for key, family, size in (
        ("rooms.512", "rooms", 512),
        ("rooms.1024", "rooms", 1024),
        ("hard.r35", "r35", 512),
        ("hard.clustered", "clustered", 512),
        ("hard.maze", "maze", 512),
    ):
        if quick and size > 512:
            continue
        progress(f"{family}, {size} x {size}")
        problems = [Problem(family, size, index, seed) for index in range(_COUNT)]
        found[key] = races(problems, _RIVALS)
    problems = []
    for path in sorted(folder.rglob("*.map.scen")) if folder else []:
        file = path.with_suffix("")
        if file.is_file():
            count = len(read_scenarios(path, read_map(file)))
            chosen = np.unique(np.linspace(0, count - 1, per_map).astype(int))
            problems += [Problem("map", index=int(index), map=file) for index in chosen]
    progress(f"{len(problems)} scenarios of maps")
    found["maps"] = races(problems, _RIVALS, least=LARGE) if problems else []
    return found


def _times(key: str, found: Sequence[Race], repeats: int) -> dict[str, float | None]:
    """Shares of A*'s time at which the mean quality reaches .97 and .99; on maps also with what
    earlier queries on the same map have found out."""
    figures: dict[str, float | None] = {}
    tracks = [timed(each, repeats=repeats) for each in found]
    for level, name in ((0.97, "q97"), (0.99, "q99")):
        figures[f"{key}.time_{name}"] = share_at(tracks, level)
    if key == "maps":
        grids: dict[Path | None, Grid] = {}
        for each in found:
            if each.problem.map not in grids:
                grids[each.problem.map] = Grid.known(each.problem.load()[0])
            timed(each, repeats=1, grid=grids[each.problem.map])
        kept = [timed(each, repeats=repeats, grid=grids[each.problem.map]) for each in found]
        figures["maps.time_kept_q97"] = share_at(kept, 0.97)
    return figures


def _put_completion(figures: dict[str, float | int | None], raced: dict[str, list[Race]]) -> None:
    """What it takes to complete, and to have a first plan."""
    everything = [each for found in raced.values() for each in found]
    hard = [each for key, found in raced.items() if key.startswith("hard.") for each in found]
    figures["final.quality"] = min(each.final["atp"] for each in everything)
    figures["final.work"] = float(np.mean([each.total["atp"] for each in everything]))
    figures["hard.total_work_max"] = max(each.total["atp"] for each in hard)
    random = [each for key, found in raced.items() if key != "maps" for each in found]
    for name, found in (("random", random), ("maps", raced["maps"])):
        first = [each.tracks["atp"][0][0] for each in found]
        figures[f"first_plan.{name}.work"] = float(np.mean(first)) if first else None


def _put_against(figures: dict[str, float | int | None], raced: dict[str, list[Race]]) -> None:
    """Least difference of mean quality at equal work: ours - theirs, over families and shares."""
    for rival in ("ara", "rwa"):
        differences: dict[str, float] = {}
        for key, found in raced.items():
            if found and rival in found[0].tracks:
                apart = curve(found, "atp", _SHARES) - curve(found, rival, _SHARES)
                differences[key] = float(apart.min())
        for key, difference in differences.items():
            figures[f"against.{rival}.by_family.{key.replace('.', '_')}"] = difference
        figures[f"against.{rival}.worst"] = min(differences.values())


def _put_paper(
    figures: dict[str, float | int | None],
    count: int,
    repeats: int,
    seed: int,
    rng: np.random.Generator,
) -> None:
    cell = np.array([_paper(_SIZE, index, seed, repeats) for index in range(count)])
    for name, values in zip(("q", "work", "time", "level3_q"), cell.T, strict=True):
        # A mean of wall times would be that of the interruptions.
        statistic = np.median if name == "time" else np.mean
        _put(figures, f"paper.{name}_{_SIZE}_{_FAMILY}", values, statistic, rng)


def _paper(size: int, index: int, seed: int, repeats: int) -> tuple[float, float, float, float]:
    """One instance: quality at completion, work and time over A*'s, quality of the first plan."""
    free, start, goal = instance(_FAMILY, size, index, seed)
    domain = (~free).astype(np.float32)
    walls: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        for seconds, search in zip(
            walls,
            (lambda: astar(free, start, goal), lambda: list(paper_steps(domain, start, goal))),
            strict=True,
        ):
            begin = time.perf_counter()
            search()
            seconds.append(time.perf_counter() - begin)
    optimal, textbook = astar(free, start, goal), textbook_astar(free, start, goal)
    assert optimal is not None
    assert textbook is not None
    assert optimal.cost == textbook.cost
    taken = list(paper_steps(domain, start, goal))
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


def _published(folder: Path, per_map: int, rng: np.random.Generator) -> dict[str, int]:
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


def _overruns(seed: int, trials: int) -> dict[str, float]:
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


def _put_peers(
    figures: dict[str, float | int | None],
    missing: dict[str, str],
    seed: int,
    progress: Callable[[str], None],
) -> None:
    """Times of other packages' A* over ours."""
    for name, (module, rival) in PEERS.items():
        key = f"astar.vs_{name}"
        figures[key] = None
        if importlib.util.find_spec(module) is None:
            missing[key] = f"{module} is not installed: pip install 'anytime-robots[bench]'"
            continue
        progress(f"A* beside {name}")
        figures[key] = min(_times_slower(rival, size, seed) for size in _PEER_SIZES)


def _times_slower(rival: Callable[..., Callable[[], float]], size: int, seed: int) -> float:
    """Median over instances of a rival's time over ours, interleaved, equal optima checked."""
    ratios = []
    for index in range(_PEER_INSTANCES):
        free, start, goal = instance(_FAMILY, size, index, seed)
        query = rival(free, start, goal)
        ours, theirs = [], []
        for _ in range(3):
            begin = time.perf_counter()
            path = astar(free, start, goal)
            middle = time.perf_counter()
            length = query()
            theirs.append(time.perf_counter() - middle)
            ours.append(middle - begin)
            assert path is not None
            assert not abs(path.length - length) > 1e-3 * path.length, "not the same problem"
        ratios.append(np.median(theirs) / np.median(ours))
    return float(np.median(ratios))
