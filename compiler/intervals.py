"""How sure a promise is: bootstrap over problems."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from anytime.profiles import Profile
from anytime.programs import Program
from compiler.division import Frontier, expected_quality, moments_within
from compiler.tables import tables

BUDGETS = 8  # at which intervals are given
RESAMPLES = 60  # of the problems, for each interval


@dataclass(frozen=True)
class Interval:
    """A 95 % interval of the promised expected quality for one budget in seconds."""

    seconds: float
    low: float
    high: float


def intervals_of(
    program: Program, profiles: Mapping[str, Profile], frontier: Frontier, seed: int
) -> tuple[Interval, ...]:
    """Bootstrap over problems of what the chosen divisions promise."""
    problems = sorted({p for profile in profiles.values() for p in profile.problems})
    rng = np.random.default_rng(seed)
    chosen = np.unique(
        np.linspace(0, len(frontier.budgets) - 1, min(BUDGETS, len(frontier.budgets))).astype(int)
    )
    sampled = np.zeros((RESAMPLES, len(chosen)))
    for row in range(RESAMPLES):
        drawn = rng.integers(0, len(problems), size=len(problems))
        counts = Counter(problems[int(index)] for index in drawn)
        resampled = tables(program, profiles, counts)
        for column, index in enumerate(chosen):
            moments = moments_within(resampled, frontier.shares[index].tolist())
            sampled[row, column] = expected_quality(resampled, moments)
    low, high = np.quantile(sampled, [0.025, 0.975], axis=0)
    return tuple(
        Interval(float(frontier.budgets[index]), float(a), float(b))
        for index, a, b in zip(chosen, low, high, strict=True)
    )
