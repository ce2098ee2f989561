"""The comparisons that take seconds, for the quick form: by benchmark, its figures, by their names.

Each is measured by the code of the benchmark, on fewer kinds of problems and beside fewer rivals.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from compiler.elimination import warm_up
from experiments import crossings
from experiments.benchmarks import campaign, deadline, faults, monitor, planner, query_rivals
from experiments.benchmarks.compiler_engine import races as compiler_races
from experiments.benchmarks.figures import Figures
from experiments.benchmarks.monitor_kinds import kinds
from experiments.benchmarks.planner_checks import put_peers
from experiments.benchmarks.planner_races import Problem, races
from experiments.benchmarks.rivals import installed
from monitor.decision_table import solve

INSTANCES = 30  # of a family
_FAMILIES = {"iid.512.r20": "r20", "rooms.512": "rooms"}
_PEERS = ("nano", "tcod", "skimage")
_SEARCHES = ("optuna.cma", "cma", "pymoo.de", "deap")
CUT = (
    "planner: floors of 512² alone, 20 % blocked and rooms, without networkx and OMPL",
    "compiler: beside the time domain and five seconds of CP-SAT alone",
    f"query: beside C++, plain Python, Optuna, and {', '.join(_SEARCHES)}, 4 seeds of a second",
    "monitor: decisions alone",
    "faults: 30 misbehaving modules, 30 floors",
    "deadline: 60 contracts with the cores free",
    "campaign: its overhead alone",
    "mission, nao: not measured",
)
"""What the full form has besides."""


def _planner(seed: int, settings: dict[str, Any]) -> Figures:
    raced = {
        key: races(
            [Problem(family, 512, index, seed) for index in range(INSTANCES)],
            ("atp", "ara", "rwa"),
        )
        for key, family in _FAMILIES.items()
    }
    figures: Figures = planner.against(raced)
    for key, found in raced.items():
        tracks = [each.tracks["atp"] for each in found]
        figures |= planner.share_figures(f"{key}.work_q97", tracks, 0.97)
        figures |= planner.times(key, planner.timed_all(found, 3))
    put_peers(figures, settings["not_measured"], seed, lambda message: None, _PEERS)
    return figures


def _compiler(seed: int, settings: dict[str, Any]) -> Figures:
    warm_up()  # as the rival's machine code is
    return compiler_races(np.random.default_rng([seed, 6]), settings, 5.0)


def _monitor(seed: int, settings: dict[str, Any]) -> Figures:
    table = solve(kinds()["high", "slow", "exponential"])
    return monitor.decision_times(table, np.random.default_rng([seed, 1]))


def _query(seed: int, settings: dict[str, Any]) -> Figures:
    figures = query_rivals.speeds(7, settings["not_measured"], settings)
    rivals = {name: rival for name, rival in installed().items() if name in _SEARCHES}
    if not rivals:
        settings["not_measured"]["vs_best_peer.nao"] = "no package to compare with is installed"
        return figures | {"vs_best_peer.nao": None}
    return figures | query_rivals.peers(rivals, range(seed, seed + 4), 1.0, settings)


def _faults(seed: int, settings: dict[str, Any]) -> Figures:
    figures = faults.return_bound(INSTANCES, settings)
    return figures | faults.connected(crossings.compiled(), INSTANCES, seed)


def _deadline(seed: int, settings: dict[str, Any]) -> Figures:
    return deadline.free(60, settings)


def _campaign(seed: int, settings: dict[str, Any]) -> Figures:
    with tempfile.TemporaryDirectory() as folder:
        return campaign.overhead(Path(folder), 200)


SAMPLES: dict[str, Callable[[int, dict[str, Any]], Figures]] = {
    "planner": _planner,
    "compiler": _compiler,
    "monitor": _monitor,
    "query": _query,
    "faults": _faults,
    "deadline": _deadline,
    "campaign": _campaign,
}
"""By benchmark: given a seed, and settings to which reasons go under `not_measured`."""
