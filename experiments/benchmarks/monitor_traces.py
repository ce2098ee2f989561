"""Stopping rules on recorded traces of anytime algorithms: nested cross-validation."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from experiments.benchmarks.figures import Figures, ratio_interval
from monitor.stopping import (
    Learner,
    Runs,
    Task,
    choose,
    fixed_contract,
    held_out,
    parts,
    standard_error,
    stop_runs,
)
from monitor.stopping_rules import LEARNERS

Floats = NDArray[np.float64]
FOLDS = 10
COARSEST = 80  # steps kept of a trace, about
RATE_50_TSP = 0.075  # of the cost of time; the only set for which its authors state one


@dataclass(frozen=True)
class TraceSet:
    """Recorded traces of one kind of problem, and what stopping them is worth."""

    name: str
    runs: Runs
    task: Task


@dataclass(frozen=True)
class TraceLosses:
    """Losses in percent of each run of a set, [N], by rule, and those of the rule that was chosen
    without it; chosen: its name in each fold."""

    losses: dict[str, Floats]
    chosen: tuple[str, ...]

    @property
    def worse_than_fixed(self) -> bool:
        """Whether the chosen rules lose more than the fixed contract by a standard error."""
        more = self.losses["chosen"] - self.losses["fixed"]
        return bool(more.mean() > standard_error(more))


def read_traces(path: Path) -> TraceSet:
    """A set of traces from its JSON file: by instance, `qualities` and `estimated_qualities`.

    A shorter trace is held at its last value. Utility is 100 q − exp(b t); where b is not stated
    it follows from how soon the traces are through, so that sets are alike.
    """
    try:
        instances = json.loads(path.read_text(encoding="utf-8"))
        pairs = [(row["qualities"], row["estimated_qualities"]) for row in instances.values()]
        if len(pairs) < 2 * FOLDS or not all(len(true) == len(seen) > 1 for true, seen in pairs):
            raise ValueError
        length = max(len(true) for true, _ in pairs)
        true, seen = (
            np.array([[*row, *[row[-1]] * (length - len(row))] for row in rows], dtype=float)
            for rows in zip(*pairs, strict=True)
        )
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise AnytimeError(
            f"{path}: no traces; it must map at least {2 * FOLDS} names to qualities and "
            "estimated_qualities, equally long"
        ) from error
    if path.stem.startswith("50-tsp"):
        rate, step = RATE_50_TSP, 1
        horizon = min(length, int(1.3 * math.log(100) / rate))
    else:
        gained = true - true[:, :1]
        through = (gained >= 0.99 * gained[:, -1:]).argmax(axis=1)
        horizon = min(length, int(1.5 * float(np.median(through)) + 5))
        step = max(1, horizon // COARSEST)
        rate = math.log(100) / (0.75 * len(range(0, horizon, step)))
    true, seen = true[:, :horizon:step], seen[:, :horizon:step]
    runs = Runs(np.arange(true.shape[1], dtype=float), true, seen)
    return TraceSet(path.stem, runs, Task(lambda q, t: 100.0 * q - np.exp(rate * t)))


def cross_validate(
    traces: TraceSet,
    seed: int,
    learners: Mapping[str, Learner] = LEARNERS,
    folds: int = FOLDS,
) -> TraceLosses:
    """Choose a rule by cross-validation within all folds but one, and judge it on that one."""
    runs, task = traces.runs, traces.task
    order = np.random.default_rng(seed).permutation(len(runs))
    held = parts(len(runs), folds, order)
    losses = {
        name: 100.0 * held_out(runs, task, learner, held)
        for name, learner in {"fixed": fixed_contract, **learners}.items()
    }
    losses["chosen"] = np.zeros(len(runs))
    chosen: list[str] = []
    for index, fold in enumerate(held):
        others = runs.of(np.setdiff1d(np.arange(len(runs)), fold))
        rng = np.random.default_rng([seed, index])
        choice = choose(others, task, learners, folds=folds, rng=rng)
        chosen.append(choice.name)
        losses["chosen"][fold] = 100.0 * stop_runs(choice.rule, runs.of(fold), task).loss
    return TraceLosses(losses, tuple(chosen))


def losses_on(path: Path, seed: int, folds: int = FOLDS) -> TraceLosses:
    """`cross_validate` on the traces of a file."""
    return cross_validate(read_traces(path), seed, folds=folds)


def trace_figures(sets: Mapping[str, TraceLosses]) -> tuple[Figures, dict[str, object]]:
    """Figures under `traces.`, and the settings: which rules were chosen in how many folds.

    sets: by name, at least one.
    """
    figures: Figures = {}
    settings: dict[str, object] = {}
    for name, found in sets.items():
        for rule, losses in found.losses.items():
            figures[f"traces.{name.replace('.', '_')}.{rule}"] = float(losses.mean())
        settings[name] = {rule: found.chosen.count(rule) for rule in set(found.chosen)}
    chosen, fixed = (
        {name: float(found.losses[rule].mean()) for name, found in sets.items()}
        for rule in ("chosen", "fixed")
    )
    tsp = [loss for name, loss in chosen.items() if "tsp" in name]
    figures["traces.loss"] = float(np.mean([*chosen.values()]))
    figures["traces.loss_tsp"] = float(np.mean(tsp)) if tsp else None
    figures |= ratio_interval("traces.vs_fixed", [*chosen.values()], [*fixed.values()])
    figures["traces.worse_than_fixed"] = sum(found.worse_than_fixed for found in sets.values())
    return figures, settings
