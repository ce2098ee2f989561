"""Profiles on another machine: a few runs again, and each module's speed here against there."""

from __future__ import annotations

import itertools
import math
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anytime.clocks import Clock, WallClock, WorkClock
from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.machines import Machine, Rate, processor
from anytime.measuring import problem_keys
from anytime.modules import Module
from anytime.outcomes import Outcome
from anytime.pictures import number
from anytime.profiles import Profile
from anytime.programs import Program, program_of
from anytime.recordings import Recording
from anytime.running import seed_of
from anytime.sampling import How, sampled

PROBLEMS = 10  # that are run again
LONGEST = 60.0  # seconds after which no further one is begun
LIKE = 1e-6  # relative difference of qualities that counts as none


@dataclass(frozen=True)
class Calibrated:
    """One module here against there.

    ratio: seconds here / there for the same work, with a 95 % interval over problems. ratios: of
    each problem. changed: how its quality over work differs, which no machine explains.
    """

    module: str
    ratio: float
    low: float
    high: float
    ratios: tuple[float, ...]
    changed: str | None = None

    def __repr__(self) -> str:
        span = f"{self.ratio:.2f} [{self.low:.2f}, {self.high:.2f}]"
        count = len(self.ratios)
        line = f"{self.module}  ×{span} the seconds, from {count} problem{'s' * (count != 1)}"
        return line if self.changed is None else f"{line}; it has changed: {self.changed}"


@dataclass(frozen=True)
class Calibration:
    """What a library becomes on this machine."""

    machine: str
    modules: tuple[Calibrated, ...]
    library: ProfileLibrary

    def __repr__(self) -> str:
        return "\n".join([f"machine {self.machine}", *(f"  {each!r}" for each in self.modules)])


def calibrate(
    library: ProfileLibrary,
    what: Module | Program,
    problems: Iterable[Any],
    *,
    clock: Callable[[], Clock] = WallClock,
    seed: int = 0,
) -> Calibration:
    """Run some of a library's problems again, and move it to this machine.

    problems: among them some that the library was measured on, told by their names or inputs; the
    first `PROBLEMS` of them are run, for at most about a minute. seed: that of the measurement, so
    that a module which draws draws the same. Each module has a ratio of its own: memory, caches
    and compilers make no two alike. Recorded seconds are multiplied by ratios drawn from those of
    the problems, so that a heavier tail here shows; quality over work stays as it was.
    Raises AnytimeError when the library knows none of the problems.
    """
    program = what if isinstance(what, Program) else program_of(what)
    names = tuple(dict.fromkeys(call.module.name for call in program.calls))
    profiles = {name: library[name] for name in names if name in library}
    if len(profiles) < len(names):
        missing = next(name for name in names if name not in profiles)
        raise AnytimeError(f"no profile for module {missing!r}; measure it before you calibrate")
    outcomes = _again(program, profiles, list(problems), clock, seed)
    made = tuple(_compared(program, profiles[name], outcomes) for name in names)
    machine = platform.node() or "here"
    moved = {each.module: _moved(profiles[each.module], each, machine) for each in made}
    rates = {
        each.module: _scaled(library.machine.rates[each.module], each.ratio)
        for each in made
        if each.module in library.machine.rates
    }
    host = "" if isinstance(clock(), WorkClock) else processor()
    here = ProfileLibrary(profiles=moved, machine=Machine(machine, rates, host))
    return Calibration(machine, made, library.updated(here))


def _again(
    program: Program,
    profiles: Mapping[str, Profile],
    problems: list[Any],
    clock: Callable[[], Clock],
    seed: int,
) -> list[Outcome]:
    """Outcomes of the first problems that every profile knows."""
    known = set[str].intersection(*(set(profile.problems) for profile in profiles.values()))
    seconds = max(run.end[0] for profile in profiles.values() for run in profile.recordings)
    how = How(max(seconds, 1e-3), clock, seed=seed)
    shared = list(zip(problem_keys(program, problems), problems, strict=True))
    shared = [(key, problem) for key, problem in shared if key in known][:PROBLEMS]
    if not shared:
        raise AnytimeError(
            f"the profiles of {', '.join(profiles)} know none of the {len(problems)} problems; "
            "give those that they were measured on, with the same seed"
        )
    began, outcomes = time.perf_counter(), list[Outcome]()
    for key, problem in shared:
        outcomes.append(sampled(program, key, problem, how))
        if time.perf_counter() - began > LONGEST:
            break
    return outcomes


def _compared(program: Program, profile: Profile, outcomes: list[Outcome]) -> Calibrated:
    calls = [call for call in program.calls if call.module.name == profile.module]
    module = calls[0].module
    ratios: list[float] = []
    changed: str | None = None
    for outcome in outcomes:
        logs: list[float] = []
        for call in calls:
            there = [
                run
                for run in profile.recordings
                if run.problem == outcome.problem and run.call == call.label
            ]
            for run in outcome.recordings[call.label]:
                like = min(there, key=lambda old: _apart(old, run), default=None)
                if like is None:
                    continue
                ratio = _ratio(like, run)
                if ratio is not None:
                    logs.append(math.log(ratio))
                if not module.contract and not (profile.inputs and "rng" in module.filled):
                    changed = changed or _change(like, run)
        if logs:
            ratios.append(math.exp(sum(logs) / len(logs)))
    if not ratios:
        raise AnytimeError(
            f"no run of {profile.module!r} could be compared; its results take no time or no work"
        )
    middle, half = _interval(np.log(ratios))
    # Their mean as factors: one run that the machine kept waiting is an outlier, not the rate.
    ratio, low, high = (math.exp(middle + step) for step in (0.0, -half, half))
    return Calibrated(profile.module, ratio, low, high, tuple(ratios), changed)


def _apart(one: Recording, other: Recording) -> float:
    return sum(abs(one.inputs[name] - value) for name, value in other.inputs.items())


def _ratio(there: Recording, here: Recording) -> float | None:
    """Seconds here / there until the last amount of work that both runs came to."""
    ends = [(*run.seconds.tolist(), run.end[0]) for run in (there, here)]
    works = [(*run.work.tolist(), run.end[1]) for run in (there, here)]
    common = min(works[0][-1], works[1][-1])
    took = [
        float(np.interp(common, (0.0, *work), (0.0, *end)))
        for work, end in zip(works, ends, strict=True)
    ]
    return took[1] / took[0] if common > 0 and min(took) > 0 else None


def _change(there: Recording, here: Recording) -> str | None:
    """How quality over work differs between runs of the same inputs."""
    if there.inputs != here.inputs:
        return None
    was = dict(zip(there.work.tolist(), there.raw.tolist(), strict=True))
    for work, raw in zip(here.work.tolist(), here.raw.tolist(), strict=True):
        if work in was and abs(raw - was[work]) > LIKE * max(1.0, abs(raw)):
            return (
                f"{number(raw)} after {work:g} units of work on {here.problem}, "
                f"where it was {number(was[work])}"
            )
    return None


def _interval(logs: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float]:
    """Mean and half of its 95 % interval, by Student's t; its quantile by Abramowitz & Stegun
    26.7.5. One value alone tells nothing of the spread: a factor of 2 is stated."""
    freedom = len(logs) - 1
    if freedom < 1:
        return float(logs[0]), math.log(2.0)
    z = 1.959964
    t = z + (z**3 + z) / (4 * freedom) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * freedom**2)
    t = {1: 12.706, 2: 4.303}.get(freedom, t)
    return float(logs.mean()), t * float(logs.std(ddof=1)) / math.sqrt(len(logs))


def _moved(profile: Profile, here: Calibrated, machine: str) -> Profile:
    ratios = np.sort(here.ratios)
    runs: list[Recording] = []
    for problem, members in itertools.groupby(profile.recordings, key=lambda run: run.problem):
        rng = np.random.default_rng(seed_of("calibrate", profile.module, problem))
        ratio = float(rng.choice(ratios))
        runs += [
            replace(run, seconds=run.seconds * ratio, end=(run.end[0] * ratio, run.end[1]))
            for run in members
        ]
    return replace(profile, recordings=tuple(runs), machine=machine, unsure=1.0)


def _scaled(rate: Rate, ratio: float) -> Rate:
    return replace(
        rate,
        per_work=rate.per_work * ratio,
        per_step=tuple(seconds * ratio for seconds in rate.per_step),
    )
