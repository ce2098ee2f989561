"""The deadline guard: whether a module's next step is still worth starting."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from anytime.clocks import INSTANT
from anytime.profiles import Profile
from anytime.running import Run

USUAL = 0.95  # of the recorded runs have a pace within the spread
STEPS = 32  # steps whose durations are kept one by one; the last stands for all later ones


@dataclass(frozen=True)
class Steps:
    """How long each step of a module takes: median and 95th percentile by index, in seconds.

    spread: how far nearly every recorded run's pace is from that of the medians, as a logarithm.
    """

    median: tuple[float, ...]
    p95: tuple[float, ...]
    spread: float = 0.0

    def pace(self, seconds: Sequence[float]) -> float:
        """How long a run's steps took over how long they usually take; NaN if that is no time."""
        usual = [self.median[min(index, len(self.median) - 1)] for index in range(len(seconds))]
        took, normal = sum(seconds), sum(usual)
        return took / normal if took > 0 and normal > 0 else math.nan


def steps_of(profile: Profile) -> Steps:
    """The durations between registrations that a profile recorded."""
    gaps: list[list[float]] = [[] for _ in range(STEPS)]
    for run in profile.recordings:
        for index, gap in enumerate(np.diff(run.seconds, prepend=0.0)):
            gaps[min(index, STEPS - 1)].append(float(gap))
    known = [gap for gap in gaps if gap]
    steps = Steps(
        tuple(float(np.median(gap)) for gap in known),
        tuple(float(np.quantile(gap, 0.95)) for gap in known),
    )
    runs = (np.diff(run.seconds, prepend=0.0).tolist() for run in profile.recordings)
    paces = [pace for run in runs if not math.isnan(pace := steps.pace(run))]
    spread = float(np.quantile(np.abs(np.log(paces)), USUAL)) if paces else 0.0
    return replace(steps, spread=spread)


def guard(steps: Steps | None, share_ends: float, hard_end: float) -> Callable[[Run], bool] | None:
    """What decides before each step of a generator that is not the last call.

    Shares are soft and the program's deadline alone is hard: the median of the next step is held
    against the share, its p95 against `hard_end`, the deadline less the least time of the rest.
    Within that the first result is never refused.
    """
    if steps is None or not steps.median:
        return None
    known = steps

    def may_step(run: Run) -> bool:
        now = run.deadline.clock.now()
        index = min(len(run.history), len(known.median) - 1)
        if now + known.p95[index] > hard_end + INSTANT and run.history:
            return False
        if not run.history:
            return now < hard_end
        return now + known.median[index] <= share_ends + INSTANT

    return may_step


def guards_of(profiles: Mapping[str, Profile]) -> dict[str, Steps]:
    """The step durations of every module in a library."""
    return {name: steps_of(profile) for name, profile in profiles.items()}
