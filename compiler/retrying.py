"""Contracts chosen one by one, when luck is new each time: by what is achieved and when.

A sequence of ever longer contracts never repeats a length, because the same contract on the same
problem gives the same result. A randomised one may be luckier the next time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.modules import Module
from anytime.profiles import Floats, Profile
from anytime.programs import program_of
from anytime.recordings import Recording
from compiler.curves import curve
from compiler.deadlines import Survival
from compiler.tables import tables

CELLS = 512  # of time in the table of decisions
CHOICES = 16  # lengths of a contract to choose from, at most
SIMULATED = 200  # runs that stand for the profile
OVER = 1e-3  # chance of still not being interrupted that ends the table


@dataclass(frozen=True)
class Retries:
    """Which contract comes next: a policy over time and quality achieved.

    lengths: [K] seconds of the contracts to choose from. levels: [L] qualities, levels[0] = 0 is
    "no result". cell: seconds. choices: [cells, L] place of the next contract; -1 = none is worth
    its time.
    """

    lengths: Floats
    levels: Floats
    cell: float
    choices: NDArray[np.intp]

    def following(self, elapsed: float, quality: float | None) -> float | None:
        """Seconds of the next contract after `elapsed` seconds with this quality, or without a
        result; None when no contract is worth starting."""
        row = int(np.ceil(elapsed / self.cell - 1e-9))
        if row >= len(self.choices):
            return None
        choice = int(self.choices[row, self._level(quality)])
        return float(self.lengths[choice]) if choice >= 0 else None

    def _level(self, quality: float | None) -> int:
        if quality is None or len(self.levels) == 1:
            return 0
        return 1 + int(np.argmin(np.abs(self.levels[1:] - quality)))


def retrying(module: Module, profile: Profile, survival: Survival) -> tuple[Retries, Profile]:
    """The best policy over (time, quality achieved) [ZCC03], and its profile.

    Takes the results of two contracts for independent of each other, whatever their lengths. So
    where problems differ the policy is still of use, but the profile promises too much. The profile
    is simulated, each half of the problems with the policy from the other half, because the best of
    many measured means is partly luck.
    """
    problems = profile.problems
    halves = [dict.fromkeys(problems[start::2], 1.0) for start in (0, 1)]
    if len(problems) == 1:
        halves = [dict.fromkeys(problems, 1.0)] * 2
    whole = _chances(module, profile, None)
    lengths, levels = whole[0], whole[1]
    parts = [_chances(module, profile, counts)[2] for counts in halves]
    rng = np.random.default_rng(0)
    simulated = [
        run
        for fold, (own, other) in enumerate((parts, parts[::-1]))
        for run in _simulated(
            _policy(lengths, levels, own, survival), other, f"half {fold + 1}", rng
        )
    ]
    promised = Profile(profile.module, (), tuple(simulated), machine=profile.machine)
    return _policy(lengths, levels, whole[2], survival), promised


def _chances(
    module: Module, profile: Profile, counts: Mapping[str, float] | None
) -> tuple[Floats, Floats, Floats]:
    """Lengths [K], levels [L], and chances [K, L] of each level from one contract."""
    (table,) = tables(program_of(module), {module.name: profile}, counts)
    rising = curve(table.times, profile.mean(table.times), profile.module).lengths
    chosen = np.unique(np.linspace(0, len(rising) - 1, CHOICES).round().astype(int))
    rows = np.searchsorted(table.times, rising[chosen] * (1 + 1e-12), side="right") - 1
    return rising[chosen], table.levels, table.chances[rows]


def _policy(lengths: Floats, levels: Floats, chances: Floats, survival: Survival) -> Retries:
    """V(t, q) = max over L of (S(t) − S(t + L)) q + E V(t + L, max(q, q')), backwards in time."""
    horizon = float(lengths[-1])
    while horizon < 64 * lengths[-1] and survival(np.array([horizon]))[0] > OVER:
        horizon *= 1.25
    cell = horizon / CELLS
    steps = np.maximum(np.ceil(lengths / cell - 1e-9), 1).astype(np.intp)
    still = survival(np.arange(CELLS + int(steps.max()) + 1, dtype=float) * cell)
    better = np.maximum.outer(np.arange(len(levels)), np.arange(len(levels)))
    worth = still[:, None] * levels
    choices = np.full((CELLS, len(levels)), -1, dtype=np.intp)
    for now in range(CELLS - 1, -1, -1):
        ends = now + steps
        kept = (still[now] - still[ends])[:, None] * levels
        after = np.einsum("kc,kqc->kq", chances, worth[ends][:, better])
        best = (kept + after).argmax(axis=0)
        value = (kept + after)[best, np.arange(len(levels))]
        going = value > worth[now] + 1e-12
        choices[now] = np.where(going, best, -1)
        worth[now] = np.where(going, value, worth[now])
    return Retries(lengths, levels, cell, choices)


def _simulated(
    policy: Retries, chances: Floats, label: str, rng: np.random.Generator
) -> list[Recording]:
    """Runs of a policy whose contracts have these chances [K, L]."""
    cumulative: list[list[float]] = np.cumsum(chances, axis=1).tolist()
    outcomes = dict(zip(policy.lengths.tolist(), cumulative, strict=True))
    levels: list[float | None] = [None, *policy.levels[1:].tolist()]
    recordings: list[Recording] = []
    for number in range(SIMULATED // 2):
        elapsed, level = 0.0, 0
        ends: list[float] = []
        reached: list[float] = []
        while (length := policy.following(elapsed, levels[level])) is not None:
            elapsed += length
            row = outcomes[length]
            drawn = min(bisect_right(row, rng.random() * row[-1]), len(row) - 1)
            if drawn > level:
                level = drawn
                ends.append(elapsed)
                reached.append(float(policy.levels[level]))
        times = np.array(ends)
        recordings.append(
            Recording(
                problem=f"{label}, run {number}",
                call=label,
                inputs={},
                features={},
                seconds=times,
                work=times,
                raw=np.array(reached),
                estimates=np.full(len(times), np.nan),
                end=(elapsed, elapsed),
                complete=True,
            )
        )
    return recordings
