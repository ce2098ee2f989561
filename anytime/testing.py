"""A conformance kit for modules: plain functions that raise one clear line.

For whoever ships modules: call them from any test, or use the fixture of `anytime.fixtures`.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import mean, median
from typing import Any, Protocol

import numpy as np

from anytime import isolation, naming
from anytime.clocks import Clock, Deadline, WallClock
from anytime.errors import AnytimeError
from anytime.measuring import measure
from anytime.modules import Limits, Module
from anytime.pictures import duration, number
from anytime.results import Change, Result
from anytime.running import execute, seed_of

EARLY = 0.5  # share of a run by which there should be something to use
OFTEN = 3  # results of a run, at least
LATE = 0.1  # of the seconds of a run, by which it may miss its deadline
FALLS = 0.05  # of quality below the best so far, on average
CUTS = (1, 2, 4, 8, 16, 32, 64)  # check-points after which a run is told to stop


class ConformanceError(AssertionError):
    """What a module or a robot does not keep of its contract, and what would be right."""


class Check(Protocol):
    """One check: raises ConformanceError, or AnytimeError for what cannot be tried."""

    __name__: str

    def __call__(
        self,
        module: Module,
        problems: Sequence[Any],
        *,
        seconds: float,
        clock: Callable[[], Clock] = WallClock,
    ) -> None: ...


def conforms(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Raise at the first of all checks that the module fails.

    problems: as `anytime.measure` takes them, three or more. seconds: of a run that is long enough
    for the module to get somewhere. clock: makes the clock of a run. Raises AnytimeError for a
    module whose knobs are not set.
    """
    if module.knobs:
        one = ", ".join(f"{name}={each.values[0]!r}" for name, each in module.knobs.items())
        raise AnytimeError(
            f"{module.name} has knobs; check its settings one by one, as {module.name}.set({one})"
        )
    for check in CHECKS:
        check(module, problems, seconds=seconds, clock=clock)


def registers_early(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Is there something to use long before the end?

    At the median over problems the first result comes in the first half of a run.
    """
    shares: list[float] = []
    for problem in problems:
        result, _ = _run(module, problem, seconds, clock())
        first = result.history[0].seconds if result else result.elapsed
        shares.append(first / max(result.elapsed, 1e-9))
    if median(shares) > EARLY:
        raise ConformanceError(
            f"{module.name} registers its first result after {100 * median(shares):.0f} % of a "
            f"run of {duration(seconds)}; register as soon as there is something to use"
        )


def registers_often(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Does it improve step by step? Three results or more, at the median over problems."""
    if module.contract:
        return  # told its time, it owes one result
    counts = [len(_run(module, problem, seconds, clock())[0].history) for problem in problems]
    if median(counts) < OFTEN:
        raise ConformanceError(
            f"{module.name} registers {median(counts):g} results in {duration(seconds)}, fewer "
            f"than {OFTEN}; register each improvement, or give it more seconds"
        )


def keeps_deadline(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Does it come to a check-point often enough to be back in time?

    Cut at an eighth, a quarter and a half of `seconds`, it misses its deadline by at most a tenth
    of `seconds`: the median over problems, because any machine hiccups.
    """
    for share in (0.125, 0.25, 0.5):
        budget = share * seconds
        late = median(_run(module, each, budget, clock())[0].overrun for each in problems)
        if late > LATE * seconds:
            raise ConformanceError(
                f"{module.name} comes back {duration(late)} after a deadline of "
                f"{duration(budget)}; it needs a check-point every {duration(LATE * seconds)}"
            )


def is_monotone(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Does quality stay once it is reached? On average over problems it falls by at most .05
    below the best so far; the truth of a single run may fall."""
    profile = measure(module, problems, seconds=seconds, clock=clock)[module.name]
    falls = [
        float(np.max(np.maximum.accumulate(quality) - quality))
        for quality in profile.qualities
        if len(quality)
    ]
    if falls and mean(falls) > FALLS:
        raise ConformanceError(
            f"quality of {module.name} falls by {number(mean(falls))} below its best so far, on "
            "average; go on registering the best result, by what can be seen of its quality"
        )


def is_deterministic(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Is a run that of its inputs and its `rng` alone, whatever ran and was cut before it?

    Results are compared one by one, as many as both runs came to.
    """
    for problem in problems:
        first = _results(module, problem, seconds, clock())
        _results(module, problem, seconds / 4, clock())
        again = _results(module, problem, seconds, clock())
        for place, (one, other) in enumerate(zip(first, again, strict=False)):
            if not _same(one, other):
                raise ConformanceError(
                    f"result {place + 1} of {module.name} differs when it is run again; draw from "
                    "its keyword-only parameter rng alone, and keep no state between runs"
                )


def leaves_values_alone(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Does it change neither its inputs nor what it has registered?"""
    for problem in problems:
        inputs = [(name, getattr(problem, name)) for name in module.parameters]
        before = [_pickled(value) for _, value in inputs]
        registered: list[tuple[Any, bytes | None]] = []

        def observe(value: Any, _: Change, kept: list[Any] = registered) -> None:
            kept.append((value, _pickled(value)))

        _run(module, problem, seconds, clock(), observe)
        for (name, value), was in zip(inputs, before, strict=True):
            if _pickled(value) != was:
                raise ConformanceError(
                    f"{module.name} changes its input {name!r}; work on a copy of it"
                )
        for place, (value, was) in enumerate(registered):
            if _pickled(value) != was:
                raise ConformanceError(
                    f"{module.name} changes its result {place + 1} after it has registered it; "
                    "register a copy of what it goes on working on"
                )


def is_interruptible(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Does it stop when it is told to, at any check-point?

    It is run in a worker process, told to stop after 1, 2, 4, … 64 check-points, because one that
    swallows the stop could never be ended here. Raises AnytimeError for a module that no worker
    can find, one that is not at the top level of a file.
    """
    naming.address(module.function)
    try:
        pickle.dumps(module)
    except pickle.PicklingError as error:
        raise AnytimeError(f"whether {module.name} stops is tried in a worker: {error}") from None
    outside = module if module.isolated else replace(module, isolated=Limits())
    isolation.warm(outside)
    for cut in CUTS:
        result, _ = _run(outside, problems[0], seconds, _Ticks(seconds / cut))
        if result.fault is not None:
            raise ConformanceError(
                f"{module.name}, told to stop at check-point {cut}: {result.fault}; let the stop "
                "pass (no bare except) and come to a check-point often"
            )
        if result.status.name == "COMPLETE":
            return


def is_measurable(
    module: Module,
    problems: Sequence[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
) -> None:
    """Can its results be scored, and does the score tell them apart?"""
    try:
        profile = measure(module, problems, seconds=seconds, clock=clock)[module.name]
    except AnytimeError as error:
        raise ConformanceError(f"{module.name} cannot be measured: {error}") from error
    nothing = sum(not len(quality) for quality in profile.qualities)
    if 2 * nothing > len(profile.qualities):
        raise ConformanceError(
            f"{module.name} has no result on {nothing} of {len(profile.qualities)} problems in "
            f"{duration(seconds)}; give it more seconds or easier problems"
        )
    levels = {round(float(value), 9) for quality in profile.qualities for value in quality}
    if len(levels) < 2:
        raise ConformanceError(
            f"every result of {module.name} has quality {number(min(levels))}; its quality or cost "
            "must tell a rough result from a good one"
        )


CHECKS: tuple[Check, ...] = (
    is_interruptible,
    is_measurable,
    registers_early,
    registers_often,
    keeps_deadline,
    is_monotone,
    is_deterministic,
    leaves_values_alone,
)
"""All checks. The first runs in a worker process: what cannot be ended would hold up the others."""


@dataclass
class _Ticks:
    """A clock that lets the same time pass at each check-point or charge, however long it took."""

    tick: float
    time: float = 0.0

    def now(self) -> float:
        return self.time

    def spend(self, module: str, work: float, step: int | None) -> None:
        self.time += self.tick

    def advance(self, seconds: float) -> None:
        self.time += seconds


def _run(
    module: Module,
    problem: Any,
    seconds: float,
    clock: Clock,
    observe: Callable[[Any, Change], None] | None = None,
) -> tuple[Result, float]:
    missing = [name for name in module.parameters if not hasattr(problem, name)]
    if missing:
        raise AnytimeError(
            f"a problem has no .{missing[0]}; the inputs of {module.name} are "
            f"{', '.join(module.parameters)}"
        )
    inputs = tuple(getattr(problem, name) for name in module.parameters)
    rng = np.random.default_rng(seed_of(module.name, "conformance"))
    deadline = Deadline.after(seconds, clock)
    result, run = execute(module, inputs, deadline, rng=rng, observe=observe)
    return result, run.work


def _results(module: Module, problem: Any, seconds: float, clock: Clock) -> list[Any]:
    """Everything that a run registered, as it was then."""
    kept: list[Any] = []

    def observe(value: Any, _: Change) -> None:
        content = _pickled(value)
        kept.append(value if content is None else pickle.loads(content))

    _run(module, problem, seconds, clock, observe)
    return kept


def _pickled(value: Any) -> bytes | None:
    try:
        return pickle.dumps(value)
    except Exception:  # what cannot be copied is taken as it is
        return None


def _same(one: Any, other: Any) -> bool:
    try:
        return bool(one == other) or _pickled(one) == _pickled(other)
    except ValueError:  # arrays
        return _pickled(one) == _pickled(other)
