"""The compiler's engine: how fast, against whom, how wide, and how sure of what it rounds.

Seconds are CPU-seconds of this process, machine code warm, everything compared in one run in random
order, medians.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from compiler.certificates import Response, bracketed, ceiling_factor, floor_factor
from compiler.division import divide
from compiler.elimination import MIN_PLUS, Factor, Levels, eliminate, order_of, warm_up
from compiler.solving import cheapest
from compiler.tables import Table
from experiments.benchmarks import compiler_programs as programs
from experiments.benchmarks import compiler_rivals as rivals
from experiments.benchmarks.figures import Figures, median_interval

Floats = NDArray[np.float64]
LEVELS, STEPS, CALLS = 64, 1000, 20  # of the chain
REPEATS = 11


def engine_figures(
    quick: bool, seed: int, progress: Callable[[str], None]
) -> tuple[Figures, dict[str, object]]:
    """Figures of `bench compiler` on the engine, and how they were obtained."""
    warm_up()
    rng = np.random.default_rng([seed, 6])
    figures: Figures = {}
    settings: dict[str, object] = {}
    progress("the engine against the time domain and CP-SAT")
    figures |= races(rng, settings, 10.0 if quick else 60.0)
    progress("programs of 100 modules")
    figures["modules_100_s"] = _hundred(rng)
    progress("shared results of width 4 and 5")
    figures |= _exact_range(rng, 1 if quick else 5)
    progress("shared results beyond the exact range")
    figures |= _beyond(rng, 1 if quick else 3, settings)
    progress("floor and ceiling")
    figures |= _certificates(rng, 30)
    return figures, settings


def cpu_seconds(work: Callable[[], object]) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def interleaved(
    rng: np.random.Generator, contestants: Mapping[str, Callable[[], object]], repeats: int
) -> dict[str, Floats]:
    """CPU-seconds of each, [repeats], after one call of each, in a new random order each time. A
    short one is called as often as takes two milliseconds, because clocks are coarse."""
    names = list(contestants)
    batches = {}
    for name in names:
        contestants[name]()
        spent = max(cpu_seconds(contestants[name]), 1e-7)
        batches[name] = max(1, int(2e-3 / spent))
    seen: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(repeats):
        for name in rng.permutation(names):
            calls = range(batches[name])
            seen[name].append(
                cpu_seconds(lambda w=contestants[name], c=calls: [w() for _ in c]) / len(calls)
            )
    return {name: np.array(times) for name, times in seen.items()}


def races(rng: np.random.Generator, settings: dict[str, object], limit: float) -> Figures:
    """One chain in both domains; one binary tree; CP-SAT on the chain at half of the budget."""
    profiles = programs.stepped(rng, CALLS, LEVELS, STEPS)
    feeds = programs.chain(CALLS)
    factors = programs.factors_of(feeds, programs.chain_tables(profiles, LEVELS))
    order = order_of(factors, factors[-1].scope[-1:])
    further, first = np.stack(profiles[1:]), profiles[0]
    small, small_first = further.astype(np.uint8), first.astype(np.uint8)
    tree = programs.binary(4)
    trees = programs.factors_of(tree, programs.smooth(rng, tree, LEVELS, STEPS))
    binary = order_of(trees, trees[-1].scope[-1:])
    renamed = [
        programs.factors_of(feeds, [factor.table for factor in factors], f"again {number}")
        for number in range(400)
    ]
    new = iter(renamed * 1000)

    def ours_new() -> object:
        one: list[Factor] = next(new)
        return eliminate(one, order_of(one, one[-1].scope[-1:]), MIN_PLUS)

    took = interleaved(
        rng,
        {
            "ours": lambda: eliminate(factors, order, MIN_PLUS),
            "new": ours_new,
            "forward": lambda: rivals.forward(further, first),
            "rows": lambda: rivals.forward_by_rows(small, small_first),
            "binary": lambda: eliminate(trees, binary, MIN_PLUS),
        },
        REPEATS,
    )
    costs = eliminate(factors, order, MIN_PLUS)[0].table
    figures: Figures = {
        **median_interval("vs_forward", took["forward"] / took["ours"]),
        **median_interval("vs_forward_new", took["forward"] / took["new"]),
        **median_interval("vs_forward_by_rows", took["rows"] / took["ours"]),
        "forward.mismatches": int((rivals.forward(further, first) != _levels_within(costs)).sum()),
        "throughput.chain": CALLS * STEPS / float(np.median(took["ours"])),
        "throughput.binary": len(tree) * STEPS / float(np.median(took["binary"])),
    }
    settings["vs_forward"] = (
        f"chain of {CALLS}, {LEVELS} levels, {STEPS} steps, all budgets; the order of elimination "
        "known, as the rival's machine code is; vs_forward_new: a program never seen; "
        "vs_forward_by_rows: the fastest time-domain code that we could write, levels of one byte"
    )
    budget = STEPS // 2
    try:
        level, spent, ended = rivals.cp_sat(factors, budget, limit)
    except ImportError:
        figures["vs_cpsat"] = None
        settings["vs_cpsat"] = "OR-tools is missing: pip install -e '.[bench]'"
        return figures
    figures |= median_interval("vs_cpsat", spent / took["ours"])
    figures["cpsat.level_missing"] = int(_levels_within(costs)[budget]) - level
    settings["vs_cpsat"] = (
        f"one budget, one worker, one search{f', ended after {limit:.0f} s' * ended}"
    )
    return figures


def _levels_within(costs: np.ndarray) -> Levels:
    """The best level for every number of steps, [STEPS]."""
    inside = costs <= np.arange(STEPS)[:, None]
    return np.where(inside, np.arange(len(costs)), 0).max(axis=1)


def _hundred(rng: np.random.Generator) -> float:
    """CPU-seconds from tables to frontier for 100 modules, results shared at random."""
    feeds = programs.shared(rng, 100, 16, 3)
    tables: list[Table] = []
    for place, fed in enumerate(feeds):
        shape = (16,) * len(fed)
        times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 0.01, size=63))])
        reached = np.sort(rng.integers(0, 16, size=(*shape, 64)), axis=-1)
        reached[..., 0] = 0
        for axis in range(len(fed)):
            reached = np.maximum.accumulate(reached, axis=axis)
            reached[(slice(None),) * axis + (0,)] = 0
        chances = (reached[..., None] == np.arange(16)).astype(float)
        labels = tuple(f"call {each}" for each in fed)
        name, levels = f"call {place}", np.linspace(0, 1, 16)
        tables.append(Table(name, name, labels, levels, times, chances, float(times[1])))
    return float(np.median([cpu_seconds(lambda: divide(tables)) for _ in range(9)]))


def _exact_range(rng: np.random.Generator, count: int) -> Figures:
    """The greatest of medians over programs of 8 to 24 modules."""
    worst: Figures = {}
    for levels, width in ((32, 4), (16, 5)):
        spent = [0.0]
        for calls in (8, 12, 16, 24):
            for number in range(2 * count):
                feeds = programs.shared(rng, calls, levels, width)
                drawn = number % 2
                tables = (
                    programs.rough(rng, feeds, levels)
                    if drawn
                    else programs.smooth(rng, feeds, levels, 100.0)
                )
                factors = programs.factors_of(feeds, tables)
                output = factors[-1].scope[-1]
                times = [cpu_seconds(lambda: cheapest(factors, output)) for _ in range(9)]  # noqa: B023
                spent.append(float(np.median(times)))
        worst[f"dag.exact_ms_{levels}"] = 1e3 * max(spent)
    return {"dag.exact_ms": max(float(v or 0) for v in worst.values()), **worst}


def _beyond(rng: np.random.Generator, count: int, settings: dict[str, object]) -> Figures:
    """Programs that elimination alone cannot solve, by branch and bound: the worst gaps."""
    gaps, shares, seconds, exact = [0.0], [0.0], [], []
    for levels, width in ((32, 6), (16, 7)):
        for number in range(2 * count):
            feeds = programs.shared(rng, 24, levels, width)
            tables = (
                programs.rough(rng, feeds, levels)
                if number % 2
                else programs.smooth(rng, feeds, levels, 100.0)
            )
            factors = programs.factors_of(feeds, tables)
            started = time.process_time()
            solution = cheapest(factors, factors[-1].scope[-1])
            seconds.append(time.process_time() - started)
            gaps.append(solution.gap(np.linspace(0, 1, levels)))
            there = np.isfinite(solution.seconds) & (solution.seconds > 0)
            missing = 1 - solution.bound[there] / solution.seconds[there]
            shares.append(float(missing.max(initial=0.0)))
            exact.append(solution.exact)
    settings["dag.gap"] = (
        "width 6 at 32 levels and 7 at 16, 24 modules: quality that may be missing at the worst "
        "budget; dag.gap_seconds: share of seconds that may be saved at the worst level"
    )
    return {
        "dag.gap": max(gaps),
        "dag.gap_seconds": max(shares),
        "dag.beyond_exact": float(np.mean(exact)),
        "dag.beyond_s": max(seconds),
        "dag.beyond_count": len(exact),
    }


def _certificates(rng: np.random.Generator, count: int) -> Figures:
    """Chains of five real-valued modules, 400 steps: 288 levels of what is passed on, more towards
    the result, whose rounding counts whole and whose levels cost little; tables built."""
    errors, spent, built = [], [], []
    for _ in range(count):
        responses = real_chain(rng, [288, 288, 288, 352, 768])
        started = time.process_time()
        floors = [floor_factor(response) for response in responses]
        ceilings = [ceiling_factor(response) for response in responses]
        built.append(time.process_time() - started)
        bracketed(responses, floors, ceilings)
        times = [cpu_seconds(lambda: bracketed(responses, floors, ceilings)) for _ in range(9)]  # noqa: B023
        spent.append(float(np.median(times)))
        errors.append(bracketed(responses, floors, ceilings).error)
    return {
        "certified.error": max(errors),
        "certified.error_median": float(np.median(errors)),
        "certified.ms": 1e3 * float(np.median(spent)),
        "certified.tables_ms": 1e3 * float(np.median(built)),
        "certified.count": count,
    }


def real_chain(rng: np.random.Generator, levels: Sequence[int]) -> list[Response]:
    """Exponential profiles, each with a top that is linear in the quality of its input. levels: of
    each call."""
    times = np.arange(401.0)
    made: list[Response] = []
    for place, count in enumerate(levels):
        rise = 1 - np.exp(-times / rng.uniform(10, 80))
        weight = rng.uniform(0.3, 0.9)
        if place:
            quality = ((1 - weight) + weight * made[-1].levels)[:, None] * rise
        else:
            quality = rise
        feeds = (f"call {place - 1}",) if place else ()
        grid = np.linspace(0, float(quality.max()), count)
        made.append(Response(f"call {place}", feeds, grid, times, quality))
    return made
