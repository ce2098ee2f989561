"""The query beside its rivals: evaluations a second, time to a good plan, an optimum that moves.

Seconds are CPU-seconds of the searching thread, native code warm. What is compared is measured in
turns, in this very run; a ratio is the median over the turns.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress

import numpy as np

from experiments.benchmarks import replanning
from experiments.benchmarks.figures import (
    RESAMPLES,
    Figures,
    bounded,
    median_interval,
    ratio_interval,
)
from experiments.benchmarks.replanning import sitting
from experiments.benchmarks.rivals import (
    RIVALS,
    Problem,
    Rival,
    Stop,
    cpp_program,
    installed,
    measured_layout,
    plain_world,
)
from experiments.benchmarks.rivals.moving_peaks import PERIOD, Course, Landscape, offline_error
from experiments.benchmarks.rivals.moving_peaks import peaks as peaks_function
from experiments.benchmarks.rivals.swarms import PEERS
from planners import query
from planners.nao_plan import plan
from planners.query import Operators, Query

PEAKS = Operators(
    crossover=0.0,
    line=0.0,
    difference=0.0,
    cloud=1.0,
    pair=0.0,
    structure=0.0,
    immigrants=0.0,
    scouts=0.0,
    islands=10,
)
"""For a landscape of ten peaks that take turns: ten islands of clouds, one for each."""

peaks = query.model(peaks_function)
_GENERATIONS = 400  # of a timed turn: 36,000 evaluations


def _rate(searched: Query, generations: int) -> float:
    """Evaluations a CPU-second over some generations."""
    before = searched.evaluations
    begun = time.thread_time()
    searched.step(generations)
    return (searched.evaluations - before) / (time.thread_time() - begun)


def speeds(pairs: int, reasons: dict, settings: dict) -> Figures:
    """Evaluations a CPU-second over those of others, measured in turns; why one is null goes to
    `reasons`."""
    figures: Figures = {}
    ratios: list[float] = []
    for turn in range(pairs):
        native, plain = (Query(plan, sitting(), seed=turn, native=form) for form in (True, False))
        native.step(5)
        plain.step(5)
        ratios.append(_rate(native, _GENERATIONS) / _rate(plain, 20))
    figures |= median_interval("vs_plain.nao", ratios)
    if cpp_program.compiler() is None:
        for key in ("vs_cpp.nao", "vs_cpp_tags.nao"):
            figures[key], reasons[key] = None, "no g++ on this machine"
    else:
        for key, variant in (("vs_cpp.nao", "slots"), ("vs_cpp_tags.nao", "tags")):
            found = cpp_program.compare(sitting(), variant, pairs=pairs)
            if found.same == 1.0:
                figures |= median_interval(key, found.ratios)
            else:
                figures[key], reasons[key] = None, "the C++ program made other choices"
    if "optuna.random" not in installed():
        figures["vs_optuna.nao"], reasons["vs_optuna.nao"] = None, "Optuna is not installed"
        return figures
    problem = _problem()
    ratios = []
    for turn in range(pairs):
        ours = Query(plan, sitting(), seed=turn)
        ours.step(5)
        trail = RIVALS["optuna.random"].search(problem, 0.5, -math.inf, turn)
        ratios.append(_rate(ours, _GENERATIONS) / trail.rate)
    settings["evaluations_a_second"] = round(_rate(Query(plan, sitting()), _GENERATIONS))
    return figures | median_interval("vs_optuna.nao", ratios)


def _problem() -> Problem:
    world = plain_world(sitting())
    return Problem(plan, world, measured_layout(plan, world, np.random.default_rng(0)))


def peers(
    rivals: Mapping[str, Rival], seeds: Iterable[int], budget: float, settings: dict
) -> Figures:
    """CPU-seconds to a good plan of the rival that is fastest, over ours: the median of seeds. One
    that does not arrive within its budget of seconds counts as that."""
    target = replanning.least((0.0, 0.0), replanning.GOAL, replanning.OBSTACLE, 3.0)
    target += replanning.CLOSE
    problem = _problem()
    ours: list[float] = []
    theirs: dict[str, list[float]] = {name: [] for name in rivals}
    late = set[str]()
    for seed in seeds:
        ours.append(_time_to(target, seed))
        for name, rival in rivals.items():
            trail = rival.search(problem, budget, target, seed)
            theirs[name].append(trail.reached_seconds or budget)
            if trail.reached_seconds is None:
                late.add(name)
    medians = {name: float(np.median(times)) for name, times in theirs.items()}
    best = min(medians, key=lambda name: medians[name])
    settings["best_peer"] = best
    settings["seconds_to_first_plan"] = {"ours": float(np.median(ours)), **medians}
    settings["reached_not_always"] = sorted(late)
    return _medians_ratio("vs_best_peer.nao", np.array(theirs[best]), np.array(ours))


def _medians_ratio(key: str, theirs: np.ndarray, ours: np.ndarray) -> Figures:
    """The ratio of two medians, resampled apart: how long one search takes has nothing to do with
    how long another takes from the same seed."""
    rng = np.random.default_rng(0)
    one, other = (
        np.median(times[rng.integers(len(times), size=(RESAMPLES, len(times)))], axis=1)
        for times in (theirs, ours)
    )
    return bounded(key, float(np.median(theirs) / np.median(ours)), one / other)


def _time_to(target: float, seed: int) -> float:
    searched = Query(plan, sitting(), seed=seed)
    begun = time.thread_time()
    searched.run(until=target)
    return time.thread_time() - begun


def moving_peaks(settings: dict, seeds: Iterable[int], periods: int) -> Figures:
    """The offline error on peaks that move, and that of the best peer over it."""
    errors = {
        name: [offline_error(peer, seed, periods) for seed in seeds] for name, peer in PEERS.items()
    }
    means = {name: float(np.mean(found)) for name, found in errors.items()}
    best = min(means, key=lambda name: means[name])
    ours = [_ours(seed, periods) for seed in seeds]
    settings["moving_peaks"] = means
    return {
        "moving_peaks.offline_error": float(np.mean(ours)),
        "moving_peaks.best_peer": means[best],
        **ratio_interval("moving_peaks.vs_best_peer", errors[best], ours),
    }


def _ours(seed: int, periods: int) -> float:
    """Our offline error; the landscape's draws are those of the peers."""
    course = Course(Landscape(np.random.default_rng((seed, 0))), periods)
    searched = Query(peaks, course.landscape.world(), population=50, seed=seed, operators=PEAKS)
    assert PERIOD % searched.size == 0
    with suppress(Stop):
        while True:
            changes = course.changes
            searched.step()
            course.charge(searched.values)
            if course.changes != changes:
                searched.world.update(course.landscape.world())
    return course.offline_error
