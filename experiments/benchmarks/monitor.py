"""The monitor: what policies lose on computed and on simulated missions, what a decision takes, and
stopping rules on recorded traces."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.executors import processes
from experiments import shipped
from experiments.benchmarks import monitor_world
from experiments.benchmarks.figures import Benchmark, Figures, median_interval
from experiments.benchmarks.monitor_gate import gate_figures
from experiments.benchmarks.monitor_kinds import KINDS, Kind, kinds
from experiments.benchmarks.monitor_knobs import knob_figures
from experiments.benchmarks.monitor_living import fork_figures, share_of_cpu
from experiments.benchmarks.monitor_losses import MISSIONS, loss_figures, losses
from experiments.benchmarks.monitor_news import news_figures
from experiments.benchmarks.monitor_traces import FOLDS, losses_on, trace_figures
from experiments.benchmarks.monitor_visits import visit_figures
from experiments.benchmarks.monitor_world import CELLS, live_cell, world_figures
from monitor.decision_process import Moment
from monitor.decision_table import DecisionTable, solve
from monitor.frame_rules import argmax_contract
from monitor.robots.briefing import QUICK as BRIEF
from monitor.robots.briefing import brief
from monitor.robots.grid_missions import read_mission
from sensing import trace_folder

Floats = NDArray[np.float64]
DECISIONS = 100_000
_PARTS = 20  # into which they are divided, in their order, for an interval


@dataclass(frozen=True)
class Size:
    """kinds: of mission that are computed. folds: of each set of traces. trials: of the value gate,
    and lived: missions that its foreseen loss is held against. news: missions in which a deadline
    becomes known. visits: rounds through several goals."""

    kinds: tuple[Kind, ...]
    world: monitor_world.Size
    folds: int
    trials: int
    lived: int
    news: int
    visits: int


STANDARD = Size(KINDS, monitor_world.STANDARD, FOLDS, 100, 150, 60, 60)
QUICK = Size(
    tuple(kind for kind in KINDS if kind[:2] == ("high", "slow")),
    monitor_world.QUICK,
    folds=3,
    trials=30,
    lived=30,
    news=30,
    visits=30,
)


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    traces: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """All figures; those of `traces.` if a folder is given or `$ANYTIME_TRACES` or the usual place
    has one."""
    missing: dict[str, str] = {}
    settings: dict[str, object] = {"missions": MISSIONS, "not_measured": missing}
    folder = traces or trace_folder()
    paths = [] if folder is None else sorted(folder.glob("*.json"))
    if folder is None:
        for key in ("traces.loss", "traces.vs_fixed", "traces.worse_than_fixed"):
            missing[key] = "no traces: --traces DIR or $ANYTIME_TRACES"
    elif not paths:
        raise AnytimeError(f"--traces {folder}: no .json file in it")
    figures: Figures = {}
    progress("decisions")
    process = kinds()["high", "slow", "exponential"]
    table = solve(process)
    figures |= decision_times(table, np.random.default_rng([seed, 1]))
    progress("forks")
    briefing = brief(read_mission(shipped.mission_path()), shipped.profiles(), BRIEF)
    figures |= fork_figures(briefing, seed)
    progress("a knob")
    figures |= knob_figures(seed)
    progress("a mission in real time")
    figures |= share_of_cpu(briefing, seed)
    of_parts, of_settings = _beside(QUICK if quick else STANDARD, seed, paths, progress)
    figures |= of_parts
    settings |= of_settings
    return Benchmark("monitor", figures | dict.fromkeys(missing), settings, seed)


def _beside(
    size: Size, seed: int, traces: Sequence[Path], progress: Callable[[str], None]
) -> tuple[Figures, dict[str, object]]:
    """What goes on in two processes: kinds of mission, the world, gate, news, visits, traces."""
    figures: Figures = {}
    settings: dict[str, object] = {
        "kinds": len(size.kinds),
        "folds": size.folds,
        "effort": asdict(size.world.effort) if size.world.effort else "usual",
    }
    with processes(2) as pool:
        worlds = {key: pool.submit(live_cell, *key, size.world, seed) for key in CELLS}
        gate = pool.submit(gate_figures, seed, size.trials, size.lived)
        others = (
            pool.submit(news_figures, seed, size.news),
            pool.submit(visit_figures, seed, size.visits),
        )
        sets = {path.stem: pool.submit(losses_on, path, seed, size.folds) for path in traces}
        kept = {kind: pool.submit(losses, kind, seed) for kind in size.kinds}
        cells = {}
        for (kind, many), job in worlds.items():
            cells[kind, many] = job.result()
            progress(f"world: {kind} value, {'many pairs' if many else 'one pair'}")
        found = [world_figures(cells, size.world), gate.result()]
        progress("gate, news, visits, kinds of mission")
        figures |= loss_figures({kind: job.result() for kind, job in kept.items()})
        figures |= others[0].result() | others[1].result()
        if sets:
            told, settings["rules_chosen"] = trace_figures(
                {name: job.result() for name, job in sets.items()}
            )
            figures |= told
            progress("traces")
    for more, also in found:
        figures |= more
        settings |= also
    return figures, settings


def decision_times(
    table: DecisionTable, rng: np.random.Generator, decisions: int = DECISIONS
) -> Figures:
    """Microseconds of a decision by look-up, and how many times longer numpy's argmax of the
    paper's rule takes; both in states drawn evenly, interleaved, less an empty call."""
    process = table.process
    ticks, frames, cells, levels = process.shape
    moments = [
        Moment(int(f), int(x), int(y), int(t))
        for f, x, y, t in zip(
            *(rng.integers(0, high, decisions) for high in (frames, cells, levels, ticks)),
            strict=True,
        )
    ]
    rival = argmax_contract(process)
    clock, decide = time.perf_counter_ns, table.decide
    ours, theirs, empty = [], [], []
    for index, moment in enumerate(moments):
        began = clock()
        decide(moment)
        ended = clock()
        ours.append(ended - began)
        began = clock()
        ended = clock()
        empty.append(ended - began)
        if index % 50 == 0:
            began = clock()
            rival(moment)
            theirs.append(clock() - began)
    floor = float(np.median(empty))
    times = np.array(ours) - floor
    count = min(_PARTS, len(theirs))
    parts = zip(*(np.array_split(each, count) for each in (theirs, ours)), strict=True)
    ratios = [(np.median(one) - floor) / (np.median(other) - floor) for one, other in parts]
    return {
        "decision.median_us": float(np.median(times)) / 1e3,
        "decision.p99_us": float(np.quantile(times, 0.99)) / 1e3,
        **median_interval("decision.vs_numpy", ratios),
    }
