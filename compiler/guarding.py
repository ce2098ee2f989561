"""The deadline guard: whether a module's next step is still worth starting."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import INSTANT
from anytime.profiles import Profile
from anytime.recordings import Recording
from anytime.running import Run

Floats = NDArray[np.float64]
USUAL = 0.95  # of the recorded runs have a pace within the spread
STEPS = 32  # steps whose durations are kept one by one; the last stands for all later ones
LONGEST = 256  # steps of one recorded run that are looked at


@dataclass(frozen=True)
class Steps:
    """How long each step of a module takes: median and 95th percentile by index, in seconds.

    spread: how far nearly every recorded run's pace is from that of the medians, as a logarithm.
    whole: whether every step ends with a result; else it can be ended between two of them.
    """

    median: tuple[float, ...]
    p95: tuple[float, ...]
    spread: float = 0.0
    whole: bool = True

    def pace(self, seconds: Sequence[float]) -> float:
        """How long a run's steps took over how long they usually take; NaN if that is no time."""
        usual = [self.median[min(index, len(self.median) - 1)] for index in range(len(seconds))]
        took, normal = sum(seconds), sum(usual)
        return took / normal if took > 0 and normal > 0 else math.nan

    def next(self, done: int, seconds: Floats) -> Floats:
        """How long the next step may take of runs whose first `done` took these seconds, [runs]:
        the 95th percentile, and more for who has been slower than that so far."""
        usual = sum(self.p95[:done])
        pace = seconds / usual if usual > 0 else np.ones_like(seconds)
        return self.p95[done] * np.maximum(pace, 1.0)


def steps_of(profile: Profile) -> Steps:
    """The durations between registrations that a profile recorded; where it left some out, they
    count as evenly spread."""
    runs = [_durations(run) for run in profile.recordings]
    gaps: list[list[float]] = [[] for _ in range(STEPS)]
    for run in runs:
        for index, gap in enumerate(run):
            gaps[min(index, STEPS - 1)].append(gap)
    known = [gap for gap in gaps if gap]
    steps = Steps(
        tuple(float(np.median(gap)) for gap in known),
        tuple(float(np.quantile(gap, 0.95)) for gap in known),
    )
    paces = [pace for run in runs if not math.isnan(pace := steps.pace(run))]
    spread = float(np.quantile(np.abs(np.log(paces)), USUAL)) if paces else 0.0
    # The last step of a run may find that there is nothing left to do.
    whole = all(run.steps <= run.results + 1 for run in profile.recordings)
    return replace(steps, spread=spread, whole=whole)


def _durations(run: Recording) -> list[float]:
    """Seconds of each of a run's first steps; the last may find that nothing is left to do."""
    places = np.linspace(1, run.results, len(run.seconds)).round()
    each = np.arange(1, min(run.results, LONGEST) + 1)
    ends = np.interp(each, [0, *places], [0.0, *run.seconds])
    steps: list[float] = np.diff(ends, prepend=0.0).tolist()
    rest = run.end[0] - float(run.seconds[-1]) if run.complete and len(run.seconds) else 0.0
    return [*steps, rest] if rest > INSTANT and run.results < LONGEST else steps


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


def last_guard(steps: Steps | None, ends: float) -> Callable[[Run], bool] | None:
    """What decides before each step of a generator that nothing follows.

    All that is left is its own, up to the end of its share. Where its step is a recorded one, that
    tells how long it takes; beyond, and where it can be ended between two results, `Run.may_step`
    goes by the run's own steps alone.
    """
    if steps is None or not steps.median or not steps.whole:
        return None
    known = steps

    def may_step(run: Run) -> bool:
        done = len(run.history)
        if not 0 < done < min(len(known.median), STEPS - 1):
            return run.may_step()
        took = np.array([run.history[-1].seconds])
        step_ends = run.started + float(took[0] + known.next(done, took)[0])
        return max(run.deadline.clock.now(), step_ends) <= ends + INSTANT

    return may_step


def guards_of(profiles: Mapping[str, Profile]) -> dict[str, Steps]:
    """The step durations of every module in a library."""
    return {name: steps_of(profile) for name, profile in profiles.items()}
