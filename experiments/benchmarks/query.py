"""The optimisation query's figures: rivals, a world that changes, and what goes on beside it.

Seconds are CPU-seconds of the searching thread, native code warm. What is compared is measured in
turns, in this very run; a ratio is the median over the turns.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.benchmarks import query_rivals, replanning
from experiments.benchmarks.figures import Benchmark, median_interval
from experiments.benchmarks.replanning import Summary, Timed, sitting
from experiments.benchmarks.rivals import installed, missing
from monitor.robots.nao_planning import Planning
from planners.nao_plan import plan
from planners.query import SWITCHES, Operators, Query

_PRINTED = ((0.036, -0.352), (0.964, 0.352))
"""The walks of the plan that [PRP16] §4 prints as nearly optimal."""


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Benchmark:
    """Measure the query on the NAO's plans, the toy of [PRP16] §2 and the moving peaks.

    The quick form takes fewer seeds; the full one prints the ablation of the operators as well.
    `maps` is not used.
    """
    seeds = range(seed, seed + (8 if quick else 30))
    few = range(seed, seed + (3 if quick else 10))
    figures: dict[str, float | int | None] = {}
    reasons: dict[str, str] = {}
    settings: dict[str, object] = {"seeds": len(seeds), "not_measured": reasons}

    progress("evaluations a second: native, plain, C++, Optuna")
    figures |= query_rivals.speeds(7 if quick else 9, reasons, settings)
    progress(f"{len(seeds)} seeds of each scenario of [PRP16] §4")
    _scenarios(figures, seeds, few)
    progress("rivals on the NAO's plan")
    figures |= query_rivals.peers(installed(), few, 4.0, settings)
    settings["rivals_not_installed"] = missing()
    progress("moving peaks")
    figures |= query_rivals.moving_peaks(settings, few, periods=30 if quick else 100)
    progress("a control loop beside the query")
    loop = _control_loop(3 if quick else 7, 2.0)
    figures |= median_interval("control_loop.p95_ratio", loop)
    progress("the start of a process; plain against native")
    figures |= median_interval("start.cold_over_cached", _start(settings))
    figures["parity.mismatches"] = _parity(range(seed, seed + (200 if quick else 1000)))
    if full:
        progress("ablation")
        settings["ablation"] = _ablation(seeds)
    return Benchmark("query", figures, settings, seed)


# --- The scenarios.


def _scenarios(figures: dict, seeds: Iterable[int], few: Iterable[int]) -> None:
    first = Summary.of([replanning.first_plan(seed) for seed in seeds])
    figures["first_plan.found"] = first.found
    figures["first_plan.p90_ms"] = first.p90_ms
    figures["first_plan.p90_evaluations"] = first.p90_evaluations
    early, late = (
        Summary.of([replanning.removed(seed, after) for seed in seeds]) for after in (0.5, 3.0)
    )
    figures["removed.recovered"] = min(early.found, late.found)
    figures["removed.p90_ms"] = max(early.p90_ms, late.p90_ms)
    bent = [_papers_plan_after_the_removal(seed) for seed in few]
    figures["removed_baseline.mean_abs_y"] = float(np.mean(bent))
    for name, scenario in (("appeared", replanning.appeared), ("fall", replanning.fallen)):
        found = Summary.of([scenario(seed) for seed in seeds])
        figures[f"{name}.recovered"] = found.found
        figures[f"{name}.p90_ms"] = found.p90_ms
    errors = [replanning.moving(seed) for seed in few]
    figures["moving.offline_error"] = float(np.mean(errors))


_CONVERGED = 1000  # individuals that are all alike; how many does not matter


def _papers_plan_after_the_removal(seed: int) -> float:
    """How far aside the paper's operators still walk, 3 s after the obstacle went: their whole
    population is the plan that the paper prints, up to a millimetre."""
    world = sitting(disc=(0.5, 0.0, 0.17))  # the printed plan passes it
    timed = Timed(world, seed, Planning.paper().operators, _CONVERGED)
    rng = np.random.default_rng(seed)
    walks = np.array(_PRINTED)
    timed.step()
    while np.ptp(timed.query.values) > 0.01:
        timed.query.suggest(_printed_plan(walks + rng.normal(0.0, 1e-3, walks.shape)))
    timed.query.world["obstacle_count"] = 0
    timed.converge(3.0)
    return timed.walked()[1]


def _printed_plan(walks: np.ndarray) -> dict[tuple[str, int], Any]:
    """Stand up, then two walks."""
    return {
        **{("more", i): i < 3 for i in range(4)},
        **dict(zip([("action", i) for i in range(3)], (3, 1, 1), strict=True)),
        ("posture", 0): 4,
        **{("walk", i): float(value) for i, value in enumerate(walks.ravel())},
    }


# --- Beside a control loop, at the start, and plain against native.


def _control_loop(turns: int, seconds: float) -> list[float]:
    """p95 of the lateness of a 100 Hz loop, beside the query over alone, of each turn."""
    searched = Query(plan, sitting(), seed=1)
    searched.step()
    ratios: list[float] = []
    for _ in range(turns):
        alone = _lateness(seconds)
        with searched.background():
            beside = _lateness(seconds)
        ratios.append(beside / alone)
    return ratios


def _lateness(seconds: float) -> float:
    late: list[float] = []
    due = time.perf_counter()
    for _ in range(int(seconds * 100)):
        due += 0.01
        time.sleep(max(0.0, due - time.perf_counter()))
        late.append(time.perf_counter() - due)
    return float(np.quantile(late, 0.95))


_STARTING = """
import time
from planners import query
from model import plan
from experiments.benchmarks.replanning import sitting
begun = time.process_time()
query.Rng(0)  # the first use of any native code starts the compiler: as good as an import
started = time.process_time()
query.Query(plan, sitting())
print(started - begun, time.process_time() - started)
"""


def _start(settings: dict) -> np.ndarray:
    """CPU-seconds of making the NAO's model native in a new process, over those of loading it, of
    each of three.

    What starts the compiler, whatever it then compiles or loads, is told apart, like the imports.
    """
    source = Path(sys.modules["planners.nao_plan"].__file__ or "").read_text("utf-8")
    cold: list[float] = []
    cached: list[float] = []
    engine: list[float] = []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "model.py").write_text(source, "utf-8")
            for times in (cold, cached):
                environment = {**os.environ, "PYTHONPATH": os.pathsep.join([folder, *sys.path])}
                done = subprocess.run(
                    [sys.executable, "-c", _STARTING],
                    capture_output=True,
                    text=True,
                    check=True,
                    env=environment,
                )
                start, took = map(float, done.stdout.split())
                engine.append(start)
                times.append(took)
    seconds = {"cold": cold, "cached": cached, "engine": engine}
    settings["start_seconds"] = {name: float(np.median(found)) for name, found in seconds.items()}
    return np.array(cold) / np.array(cached)


def _parity(seeds: Iterable[int]) -> int:
    """Seeds for which the plain form and the native form differ in any value of any individual."""
    mismatches = 0
    for seed in seeds:
        native, plain = (Query(plan, sitting(), seed=seed, native=form) for form in (True, False))
        native.step(2)
        plain.step(2)
        same = np.array_equal(native.values, plain.values)
        mismatches += not (same and dict(native.best.choices) == dict(plain.best.choices))
    return mismatches


# --- What each operator is worth.


def _ablation(seeds: Iterable[int]) -> dict[str, dict[str, object]]:
    """The scenarios with each operator switched off: p90 of the evaluations, inf where some never
    recover, and how far from the best plan 100,000 evaluations come."""
    cases = {"default": Operators(), "paper": Operators.paper()}
    cases |= {f"without {name}": Operators().without(name) for name in SWITCHES}
    table: dict[str, dict[str, object]] = {}
    for name, operators in cases.items():
        row: dict[str, object] = {}
        for scenario, run in (
            ("first_plan", lambda s, o: replanning.first_plan(s, o)),
            ("removed", lambda s, o: replanning.removed(s, 0.5, o)),
            ("appeared", lambda s, o: replanning.appeared(s, o)),
            ("fall", lambda s, o: replanning.fallen(s, o)),
        ):
            row[scenario] = Summary.of([run(seed, operators) for seed in seeds]).p90_evaluations
        gaps = [_gap(seed, operators) for seed in seeds]
        row["gap_after_100k"] = float(np.median(gaps))
        table[name] = row
    return table


def _gap(seed: int, operators: Operators) -> float:
    """How far from the best plan 100,000 evaluations come."""
    searched = Query(plan, sitting(), seed=seed, operators=operators)
    searched.run(evaluations=100_000)
    return searched.value - replanning.least((0.0, 0.0), replanning.GOAL, replanning.OBSTACLE, 3.0)
