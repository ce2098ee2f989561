"""The planner's figures: ATP beside A*, ARA* and others, the paper's planner, published optima."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import cycle, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.benchmarks.figures import Benchmark, Figures, bounded, ratio_interval
from experiments.benchmarks.planner_checks import (
    below_exact,
    overruns,
    published,
    put_peers,
    solved,
)
from experiments.benchmarks.planner_drawing import draw
from experiments.benchmarks.planner_races import (
    ENOUGH,
    LARGE,
    Problem,
    Race,
    Track,
    curve,
    races,
    resampled,
    share_at,
    shares_at,
    timed,
    timed_once,
)
from experiments.benchmarks.planner_sampling import sampled
from planners import Grid, astar, blind_quality, paper_atp, textbook_astar
from sensing import instance, map_folder, read_map, read_scenarios

_FAMILY, _SIZE = "r20", 128
_RESAMPLES = 2000
_COUNT = 30  # instances a family
_EARLIER = 20  # queries on a map before those with kept labels
_RIVALS = ("atp", "ara", "rwa", "wa")
_SHARES = np.array([0.08, 0.1, 0.12, 0.15, *np.arange(0.2, 1.0001, 0.05)])
"""Shares of A*'s work at which planners are compared."""


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
    folder, per_map = maps or map_folder(), 10 if quick else 60 if full else 20
    raced = _race_all(quick, folder, per_map, seed, progress)
    against_time: dict[str, list[Track]] = {}
    for key, found in raced.items():
        if not found:
            continue
        for level, name in ((0.97, "q97"), (0.99, "q99")):
            tracks = [each.tracks["atp"] for each in found]
            figures |= share_figures(f"{key}.work_{name}", tracks, level)
        progress(f"{key}: time beside A*")
        repeats = 1 if quick else 3
        against_time[key] = timed_all(found, repeats)
        figures |= times(key, against_time[key])
        if key == "maps":
            figures |= share_figures("maps.time_kept_q97", timed_kept(found, repeats), 0.97)
    figures["maps.count"] = len(raced["maps"])
    _put_completion(figures, raced)
    figures |= against(raced)
    progress("published optima")
    if folder is None:
        reason = "no folder of maps: give --maps DIR or set ANYTIME_MAPS"
        missing |= {"astar.wrong_optimum": reason, "maps.count": reason}
        figures["astar.wrong_optimum"] = figures["maps.count"] = None
    else:
        figures |= published(folder, 20 if quick else 200 if full else 50, rng)
    put_peers(figures, missing, seed, progress)
    progress("sampling planners")
    found, reasons = sampled(seed)
    figures |= found
    missing |= reasons
    progress("noisy maps")
    errors = (0.0, 0.02, 0.04, 0.1) if quick else (0.0, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1)
    figures["noisy.below_exact"] = max(
        below_exact(family, error, seed, _COUNT) for family in ("r10", "r20") for error in errors
    )
    progress("plans on every kind of floor")
    figures |= solved(1000, folder, 500, seed, raced)
    progress("budgets")
    figures |= overruns(seed, 60 if quick else 200)
    for key in _expected():
        if figures.get(key) is None:
            figures[key] = None
            missing.setdefault(key, _unmeasured(key, raced, folder))
    settings: dict[str, object] = {
        "instances": _COUNT,
        "noisy_errors": errors,
        "shares_compared": [round(float(share), 3) for share in _SHARES],
        "scenarios_per_map": per_map,
        "form": "full" if full else "quick" if quick else "standard",
        "denominator": "the smaller of our A* and a textbook A*, expansions, same instance",
        "connectivity": 8,
        "kept_after": _EARLIER,
        "not_measured": missing,
    }
    return Benchmark(
        "planner",
        figures,
        settings,
        seed,
        picture=lambda path: draw(raced, against_time, path),
    )


def _unmeasured(key: str, raced: dict[str, list[Race]], folder: Path | None) -> str:
    """Why a figure that is promised is not there."""
    if not raced.get(key.rpartition(".")[0]):
        if not key.startswith("maps."):
            return "not in the quick form"
        return "no map has such a query" if folder else "no folder of maps: give --maps DIR"
    if ".time_" in key:
        return f"not reached in {ENOUGH:g} of A*'s work, where a timed run ends"
    return "not reached"


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


def timed_all(found: Sequence[Race], repeats: int) -> list[Track]:
    """ATP's tracks against time, in shares of our A*'s, nothing being known of the maps before."""
    timed_once(found[0])  # loads machine code, which the races did in other processes
    return [timed(each, repeats=repeats) for each in found]


def timed_kept(found: Sequence[Race], repeats: int) -> list[Track]:
    """The same with what earlier queries on the same map have found out."""
    grids: dict[Path | None, Grid] = {}
    for file in dict.fromkeys(each.problem.map for each in found):
        mine = [each for each in found if each.problem.map == file]
        grids[file] = Grid.known(mine[0].problem.load()[0])
        for each in islice(cycle(mine), _EARLIER):
            timed_once(each, grids[file])
    return [timed(each, repeats=repeats, grid=grids[each.problem.map]) for each in found]


def times(key: str, tracks: Sequence[Track]) -> Figures:
    """Shares of A*'s time at which the mean quality reaches .97 and .99."""
    figures: Figures = {}
    for level, name in ((0.97, "q97"), (0.99, "q99")):
        figures |= share_figures(f"{key}.time_{name}", tracks, level)
    return figures


def _put_completion(figures: dict[str, float | int | None], raced: dict[str, list[Race]]) -> None:
    """What it takes to complete, and to have a first plan."""
    everything = [each for found in raced.values() for each in found]
    hard = [each for key, found in raced.items() if key.startswith("hard.") for each in found]
    figures["final.quality"] = min(each.final["atp"] for each in everything)
    figures |= _mean_interval("final.work", [each.total["atp"] for each in everything])
    figures["hard.total_work_max"] = max(each.total["atp"] for each in hard)
    random = [each for key, found in raced.items() if key != "maps" for each in found]
    for name, found in (("random", random), ("maps", raced["maps"])):
        first = [each.tracks["atp"][0][0] for each in found]
        key = f"first_plan.{name}.work"
        figures |= _mean_interval(key, first) if first else {key: None}


def _mean_interval(key: str, values: Sequence[float]) -> Figures:
    """A mean over instances with its interval."""
    return ratio_interval(key, values, np.ones(len(values)))


def against(raced: dict[str, list[Race]]) -> Figures:
    """Least difference of mean quality at equal work, ours - theirs, over families and shares; and
    by family, how many times our work until .97 takes the rival."""
    figures: Figures = {}
    for rival in ("ara", "rwa"):
        differences: dict[str, float] = {}
        for key, found in raced.items():
            if found and rival in found[0].tracks:
                family = key.replace(".", "_")
                apart = curve(found, "atp", _SHARES) - curve(found, rival, _SHARES)
                differences[family] = float(apart.min())
                figures |= _times_the_work(f"against.{rival}.work_q97.{family}", found, rival)
        for family, difference in differences.items():
            figures[f"against.{rival}.by_family.{family}"] = difference
        figures[f"against.{rival}.worst"] = min(differences.values())
    return figures


def share_figures(key: str, tracks: Sequence[Track], level: float) -> Figures:
    """Where a level is reached, bootstrapped over instances; None where it is not."""
    share = share_at(tracks, level)
    if share is None:
        return {key: None}
    return bounded(key, share, shares_at(tracks, level, resampled(len(tracks))))


def _times_the_work(key: str, found: Sequence[Race], rival: str) -> Figures:
    """A rival's work until .97 over ours, on the same instances."""
    rows = np.vstack([np.full(len(found), 1.0 / len(found)), resampled(len(found))])
    theirs, ours = (
        shares_at([each.tracks[name] for each in found], 0.97, rows) for name in (rival, "atp")
    )
    ratios = np.where(np.isfinite(ours), theirs / ours, np.nan)
    return bounded(key, float(ratios[0]), np.nan_to_num(ratios[1:], nan=0.0))


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
            (lambda: astar(free, start, goal), lambda: list(paper_atp.steps(domain, start, goal))),
            strict=True,
        ):
            begin = time.perf_counter()
            search()
            seconds.append(time.perf_counter() - begin)
    optimal, textbook = astar(free, start, goal), textbook_astar(free, start, goal)
    assert optimal is not None
    assert textbook is not None
    assert optimal.cost == textbook.cost
    taken = list(paper_atp.steps(domain, start, goal))
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
    figures |= bounded(key, float(statistic(values)), statistic(drawn, axis=1))
