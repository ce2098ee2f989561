"""What policies lose against the optimum of sixteen decision processes, computed and simulated."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.benchmarks.figures import Figures, ratio_interval
from experiments.benchmarks.monitor_kinds import SLOWER, Kind, kinds
from monitor.certainty import resolve
from monitor.decision_table import evaluate, simulate, solve, solve_cautiously
from monitor.frame_rules import (
    evaluate_frames,
    paper_rule,
    simulate_frames,
    tuned_constant_rule,
)

Floats = NDArray[np.float64]
MISSIONS = 5_000  # that check each computed worth
TUNING = 300  # missions for the fixed rule
GAIN, CAUTION = 1.0, 2.0  # of the paper's rule within frames, of the risk-smoothed value of time


@dataclass(frozen=True)
class Losses:
    """Of one kind of mission: by policy the share of the optimum's worth that it loses, computed;
    by how many standard errors simulated missions differ from each worth; seconds of solving."""

    lost: dict[str, float]
    deviations: tuple[float, ...]
    solve_s: float


def losses(kind: Kind, seed: int) -> Losses:
    """What each policy loses in one of `kinds`."""
    process = kinds()[kind]
    chance = np.random.default_rng([seed, 2]).random((TUNING, process.ticks, 2))
    rules = {
        "paper": paper_rule(process, GAIN),
        "inter": paper_rule(process),
        "fixed": tuned_constant_rule(process, chance),
    }
    solve(process)  # loads the machine code
    began = time.perf_counter()
    exact = solve(process)
    took = time.perf_counter() - began
    cautious = solve_cautiously(process)
    tables = {
        "exact": exact.actions,
        "optimal": cautious.actions,
        "resolve": resolve(process),
        "smoothed": resolve(process, CAUTION),
    }
    worth = {name: evaluate(process, actions) for name, actions in tables.items()}
    worth |= {name: evaluate_frames(process, rule) for name, rule in rules.items()}
    rng = np.random.default_rng([seed, 3])
    deviations: list[float] = []
    for name, actions in tables.items():
        deviations.append(_deviation(worth[name], simulate(process, actions, MISSIONS, rng)))
    for name, rule in rules.items():
        chance = rng.random((MISSIONS, process.ticks, 2))
        deviations.append(_deviation(worth[name], simulate_frames(process, rule, chance)))
    lost = {name: 1.0 - value / exact.promised for name, value in worth.items()}
    true = process.slower(SLOWER)
    best = solve(true).promised
    lost["wrong_profile"] = 1.0 - evaluate(true, cautious.actions) / best
    lost["wrong_profile_exact"] = 1.0 - evaluate(true, exact.actions) / best
    return Losses(lost, tuple(deviations), took)


def _deviation(worth: float, nets: Floats) -> float:
    error = float(nets.std(ddof=1)) / np.sqrt(len(nets))
    return (float(nets.mean()) - worth) / max(error, 1e-9)


def loss_figures(found: Mapping[Kind, Losses]) -> Figures:
    """Figures under `kind.`, `loss.` and `check.`, and what solving takes."""
    figures: Figures = {
        f"kind.{'_'.join(kind)}.{policy}": loss
        for kind, each in found.items()
        for policy, loss in each.lost.items()
    }
    policies = next(iter(found.values())).lost
    lost = {name: np.array([each.lost[name] for each in found.values()]) for name in policies}
    for policy, values in lost.items():
        figures[f"loss.{policy}.mean"] = float(values.mean())
        figures[f"loss.{policy}.worst"] = float(values.max())
    for policy in ("paper", "inter", "fixed"):
        figures |= ratio_interval(f"loss.vs_{policy}", 1.0 - lost["optimal"], 1.0 - lost[policy])
    figures["loss.paper.at_least_4_percent"] = int((lost["paper"] >= 0.04).sum())
    deviations = np.abs([deviation for each in found.values() for deviation in each.deviations])
    figures["check.count"] = len(deviations)
    figures["check.within_three_errors"] = float((deviations <= 3.0).mean())
    figures["check.greatest_errors"] = float(deviations.max())
    solving = [each.solve_s for each in found.values()]
    figures["solve_s"] = float(np.median(solving))
    figures["solve_s_worst"] = float(np.max(solving))
    return figures
