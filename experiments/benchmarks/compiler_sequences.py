"""Sequences of contracts, computed: their ratios against the formulas, the best for a known
distribution of the interruption against doubling, a predicted interruption against theory."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats
from scipy.special import ndtr

from compiler.curves import Curve, curve
from compiler.deadlines import Interruption, log_uniform, survival_of
from compiler.processors import optimal_ratio, round_robin, simulated_ratio
from compiler.sequencing import (
    acceleration_ratio,
    best_sequence,
    doubled,
    expected_quality,
    least_ratio,
    tuned_doubling,
)

Figures = dict[str, float | int | None]
PROCESSORS, PROBLEMS = range(1, 9), range(1, 4)
HORIZON = 1e6  # of the first contract; beyond it the ratio changes by less than 1e-5
LEVELS = 96
SIMULATED = 20_000  # interruptions at equal quantiles

# Ratios


def ratios() -> Figures:
    """Round robin lived through, for every number of processors and problems."""
    errors: list[float] = []
    better = 0
    for processors, problems in itertools.product(PROCESSORS, PROBLEMS):
        least = optimal_ratio(processors, problems)
        base = ((processors + problems) / problems) ** (1 / processors)
        errors.append(abs(_lived(processors, problems, base) / least - 1))
        others = (base * factor for factor in (0.95, 0.98, 1.02, 1.05))
        better += sum(_lived(processors, problems, other) < least * (1 - 1e-6) for other in others)
    lengths, times = doubled(_steps(1.0, HORIZON, 2), 1.0), np.geomspace(2**5, 2**19, 200_000)
    done = np.searchsorted(np.cumsum(lengths), times, side="right") - 1
    return {
        "ratio.error": max(errors),
        "ratio.cells": len(errors),
        "ratio.better_bases": better,
        # theory: b / ln b = 2.885 for b = 2 and an interruption of any order of magnitude
        "ratio.average_doubling": float((times / np.array(lengths)[done]).mean()),
    }


def _lived(processors: int, problems: int, base: float) -> float:
    count = math.ceil(math.log(HORIZON) / math.log(base)) + 4 * processors * problems
    contracts = round_robin(1.0, processors=processors, problems=problems, base=base)
    return simulated_ratio(list(itertools.islice(contracts, count)))


# Sequences for a known distribution


def curves(rng: np.random.Generator, random: int) -> dict[str, Curve]:
    """Profiles of every shape, in seconds: smooth, with a threshold, with few steps, random."""
    evenly = np.linspace(400 / LEVELS, 400, LEVELS)
    log = np.geomspace(1, 400, LEVELS)
    found = {
        "1-exp": curve(evenly, 1 - np.exp(-evenly / 80), "1-exp"),
        "sigmoid": curve(evenly, 1 / (1 + np.exp(-(evenly - 150) / 30)), "sigmoid"),
        "log": curve(log, np.log(log * 2) / np.log(800), "log"),
        "linear": curve(evenly, evenly / 400, "linear"),
        "late": curve(evenly, (evenly / 400) ** 3, "late"),
        "steps": Curve(np.array([20.0, 60, 130, 220]), np.array([0.2, 0.5, 0.7, 0.9])),
        "ladder": Curve(np.array([4.3, 17.5, 86.5]), np.array([0.19, 0.75, 0.9])),
        "one step": Curve(np.array([90.0]), np.array([0.8])),
    }
    for index in range(random):
        count = int(rng.integers(1, LEVELS))
        lengths = np.unique(np.exp(rng.uniform(0, 6, size=count)))
        qualities = np.sort(rng.random(len(lengths))) ** rng.uniform(0.3, 3)
        found[f"random {index}"] = curve(lengths, qualities, "random")
    return found


@dataclass(frozen=True)
class Mixture:
    """Either of several normal distributions, equally likely."""

    means: tuple[float, ...]
    spread: float

    def sf(self, x: Any, /) -> Any:
        return np.mean([ndtr((mean - x) / self.spread) for mean in self.means], axis=0)


def interruptions(rng: np.random.Generator) -> dict[str, Interruption]:
    """Distributions of the interruption, in seconds."""
    observed = np.maximum(rng.gamma(2.0, 80.0, size=30), 1e-3).tolist()
    return {
        "uniform": stats.uniform(0, 400),
        "normal": stats.norm(200, 20),
        "exponential": stats.expon(scale=100),
        "bimodal": Mixture((100, 300), 10),
        "trimodal": Mixture((40, 150, 380), 5),
        "lognormal": stats.lognorm(1.0, scale=100),
        "weibull": stats.weibull_min(0.7, scale=120),
        "observed": observed,
    }


def sequences(rng: np.random.Generator, random: int) -> Figures:
    """The best sequence against doubling from its best first length, on every pair."""
    below, errors, durations = 0, [], []
    gains: list[float] = []
    plain: list[float] = []
    profiles = curves(rng, random)
    for steps in profiles.values():
        for when in interruptions(rng).values():
            survival = survival_of(when)
            tuned = tuned_doubling(steps, survival)
            rival = expected_quality(steps, tuned, survival)
            if rival <= 0:
                continue  # every interruption is too early for anything
            began = time.perf_counter()
            lengths = best_sequence(steps, survival)
            durations.append(time.perf_counter() - began)
            value = expected_quality(steps, lengths, survival)
            below += value < rival - 1e-9
            gains.append(value / rival - 1)
            first = doubled(steps, float(steps.lengths[0]))
            plain.append(value / max(expected_quality(steps, first, survival), 1e-3) - 1)
            errors.append(abs(_simulated(steps, lengths, when) - value))
    known = [least_ratio(steps) for steps in profiles.values()]
    kept = [
        acceleration_ratio(steps, best_sequence(steps, log_uniform(steps), 4.0))
        for steps in profiles.values()
    ]
    return {
        "schedule.below_doubling": below,
        "schedule.pairs": len(gains),
        "schedule.gain_mean": float(np.mean(gains)),
        "schedule.gain_max": max(gains),
        "schedule.gain_untuned_mean": float(np.mean(plain)),
        "schedule.simulation_error": max(errors),
        "schedule.ms": 1e3 * float(np.median(durations)),
        "ratio.known_profile_mean": float(np.mean(known)),
        "ratio.known_profile_max": max(known),
        "ratio.kept_max": max(kept),
    }


def _simulated(steps: Curve, lengths: Sequence[float], when: Interruption) -> float:
    """Mean quality over interruptions at equal quantiles, from what is done by then."""
    if isinstance(when, list):
        times = np.array(when)
    elif isinstance(when, Mixture):
        shares = (np.arange(SIMULATED // len(when.means)) + 0.5) / (SIMULATED // len(when.means))
        times = np.concatenate([stats.norm(mean, when.spread).ppf(shares) for mean in when.means])
    else:
        times = np.asarray(when.ppf((np.arange(SIMULATED) + 0.5) / SIMULATED))  # pyright: ignore
    done = np.searchsorted(np.cumsum(lengths), times * (1 + 1e-12), side="right")
    reached = np.maximum.accumulate(steps.quality(np.array(lengths)))
    return float(np.concatenate([[0.0], reached])[done].mean())


def predictions() -> Figures:
    """A predicted interruption against [AK21]: at time t, robust to any other, the longest contract
    done is at least t (r + √(r² − 4r)) / 2r."""
    steps = _steps(1.0, 1000.0, 2 * LEVELS)
    grain = float(steps.lengths[1] / steps.lengths[0])  # a contract may be a step too short
    behind, found = 0, {}
    for robustness in (4, 5, 6, 8):
        theory = 2 * robustness / (robustness + math.sqrt(robustness**2 - 4 * robustness))
        worst = 0.0
        for at in np.geomspace(20, 900, 12):
            survival = survival_of(float(at))
            lengths = np.array(best_sequence(steps, survival, float(robustness)))
            longest = lengths[np.cumsum(lengths) <= at * (1 + 1e-9)].max()
            behind += at / longest > theory * grain
            behind += acceleration_ratio(steps, tuple(lengths)) > robustness * (1 + 1e-9)
            worst = max(worst, float(at / longest))
        found[f"prediction.worst_{robustness}"] = worst
        found[f"prediction.theory_{robustness}"] = theory
    return {"prediction.behind_theory": behind, **found}


def _steps(first: float, last: float, count: int) -> Curve:
    """Lengths whose logarithms are even, so that no scale of time is special."""
    return Curve(np.geomspace(first, last, count), np.arange(1, count + 1) / count)
