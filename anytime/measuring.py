"""Measuring: running modules on problems, off line, and scoring what they registered."""

from __future__ import annotations

import hashlib
import itertools
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anytime.clocks import Clock, Deadline, WallClock, WorkClock
from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.machines import Machine, Rate, charged_rate, stepped_rate
from anytime.modules import Module
from anytime.profiles import Profile, Recording
from anytime.programs import Call, Input, Join, Program, makers, program_of, upstream
from anytime.results import Change, Result
from anytime.running import Run, execute, seed_of
from anytime.structure import answers

STRATA = 4  # qualities of an input that a consumer is run on, on one problem
COMBINATIONS = 9  # of several inputs that it is run on, at most
CHANGES = 64  # registrations kept of one run, at most
CONTRACTS = 8  # times for which a contract module is run, each half of the next


@dataclass(frozen=True)
class _Sample:
    """One run of a call: what it registered, scored afterwards, and what it was fed with."""

    module: Module
    values: tuple[Any, ...]
    changes: tuple[Change, ...]
    raw: np.ndarray
    fed: tuple[tuple[str, _Sample, int], ...]  # parameter, the run that fed it, which result
    result: Result
    run: Run
    features: Mapping[str, float]


def measure(
    what: Module | Program,
    problems: Iterable[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
    rest: float = 0.0,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> ProfileLibrary:
    """Measure how the results of a module, or of each module of a program, improve with time.

    problems: objects whose attributes are the inputs by name, plus what `quality` wants.
    seconds: how long each run may take. clock: makes the clock of a run; a `WorkClock` measures
    in simulated time. rest: seconds of idling before each run, as a control loop does (profiles
    measured hot fail in a cold loop). A contract module is run for `seconds` and for shares of it,
    because what it gives in less time is another run. progress: called with (problems done,
    problems).

    In a program, what each module really delivers feeds the next: at most `STRATA` runs a call
    and problem, on results equally spaced in achieved quality plus the last; of several inputs,
    `COMBINATIONS` of such results. Quality is scored after the clock has stopped, and a cost is
    normalised by the cheapest known for its problem when all of its runs are done.
    Raises AnytimeError for a problem without a needed attribute and for a module without a score.
    """
    if not isinstance(what, Module | Program):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"measure takes a module or a program, not {what!r}")
    if not isinstance(problems, Iterable):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"problems is {problems!r}; give a list of problems")
    program = what if isinstance(what, Program) else program_of(what)
    listed = list(problems)
    if not listed:
        raise AnytimeError("no problems to measure on; give at least one")
    if not seconds > 0:
        raise AnytimeError(f"seconds={seconds}; give the time that each run may take, > 0")
    samples: dict[str, dict[str, list[_Sample]]] = {call.label: {} for call in program.calls}
    keys = problem_keys(program, listed)
    for done, (key, problem) in enumerate(zip(keys, listed, strict=True)):
        for call in program.calls:
            told = _told(program, call, problem, key, samples)
            samples[call.label][key] = [
                _sample(call, problem, key, fed, told, seconds, clock, rest, seed)
                for fed in _feeds(call, key, samples)
            ]
        if progress is not None:
            progress(done + 1, len(listed))
    made = clock()
    known = made.machine if isinstance(made, WorkClock) else None
    return _library(program, keys, samples, known)


def _sample(
    call: Call,
    problem: Any,
    key: str,
    fed: tuple[tuple[str, _Sample, int], ...],
    told: Mapping[str, float],
    seconds: float,
    clock: Callable[[], Clock],
    rest: float,
    seed: int,
) -> _Sample:
    module = call.module
    by_name = {name: sample.values[index] for name, sample, index in fed}
    inputs = tuple(
        by_name[name] if isinstance(argument, Call | Join) else _argument(argument, problem)
        for name, argument in zip(module.parameters, call.arguments, strict=True)
    )
    levels = tuple(index for *_, index in fed)

    def once(budget: float) -> tuple[list[tuple[Any, Change]], Result, Run]:
        kept: list[tuple[Any, Change]] = []

        def observe(value: Any, change: Change) -> None:
            kept.append((value, change))
            if len(kept) >= 4 * CHANGES:  # bounds the memory of a module that registers for ever
                del kept[1:-1:2]

        if rest:  # even a sleep of 0 s gives the processor away
            time.sleep(rest)
        rng = np.random.default_rng(seed_of(seed, call.label, key, levels))
        deadline = Deadline.after(budget, clock())
        result, run = execute(module, inputs, deadline, rng=rng, observe=observe)
        return kept, result, run

    kept, result, run = once(seconds)
    if run.mixed:
        raise AnytimeError(
            f"module {module.name!r} charges work after a check-point that it did not charge for; "
            "charge before the first yield, register or expired"
        )
    if result.fault and not kept:
        raise AnytimeError(
            f"module {module.name!r} failed on problem {key} before any result: {result.fault}"
        )
    if module.contract:  # what it gives for less time is a run of its own
        shorter = [once(seconds * 0.5**halvings)[0] for halvings in range(CONTRACTS - 1, 0, -1)]
        kept = _in_order(pair for each in (*shorter, kept) for pair in each[-1:])
    if len(kept) > CHANGES:
        chosen = np.unique(np.linspace(0, len(kept) - 1, CHANGES).round().astype(int))
        kept = [kept[i] for i in chosen]
    raw = np.array([_scored(module, value, problem, key) for value, _ in kept])
    features = {**(module.features(*inputs) if module.features else {}), **told}
    values, changes = tuple(value for value, _ in kept), tuple(change for _, change in kept)
    return _Sample(module, values, changes, raw, fed, result, run, features)


def _told(
    program: Program,
    call: Call,
    problem: Any,
    key: str,
    samples: Mapping[str, Mapping[str, list[_Sample]]],
) -> dict[str, float]:
    """What the tests answer in the end on a problem, for a call in the arms of their branches:
    a branch runs its arms on different problems, and their profiles tell them apart by this."""
    told: dict[str, float] = {}
    for join, labels, _ in answers(program):
        if call.label not in labels:
            continue
        test = join.arguments[0]
        if isinstance(test, Input):
            told[join.label] = float(bool(_argument(test, problem)))
            continue
        ends = [s.values[-1] for m in makers(test) for s in samples[m.label][key] if s.values]
        if ends:
            told[join.label] = float(bool(ends[-1]))
    return told


def _in_order(results: Iterable[tuple[Any, Change]]) -> list[tuple[Any, Change]]:
    """The results without those that took less time or work than one before."""
    kept: list[tuple[Any, Change]] = []
    for value, change in results:
        if not kept or (change.seconds >= kept[-1][1].seconds and change.work >= kept[-1][1].work):
            kept.append((value, change))
    return kept


def _scored(module: Module, value: Any, problem: Any, key: str) -> float:
    try:
        score = float(module.score(value, problem))
    except AnytimeError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise AnytimeError(
            f"the score of {module.name!r} failed on problem {key}: {reason}"
        ) from error
    if module.quality is not None and not 0 <= score <= 1:
        raise AnytimeError(
            f"quality of {module.name!r} is {score} on problem {key}; it must lie in [0, 1]"
        )
    if not 0 <= score < float("inf"):
        raise AnytimeError(
            f"cost of {module.name!r} is {score} on problem {key}; it must be finite and >= 0"
        )
    return score


def _argument(argument: Any, problem: Any) -> Any:
    return getattr(problem, argument.name) if isinstance(argument, Input) else argument.value


def _feeds(
    call: Call, key: str, samples: Mapping[str, Mapping[str, list[_Sample]]]
) -> list[tuple[tuple[str, _Sample, int], ...]]:
    """Which results of the calls upstream this call is run on.

    Of several inputs: all as good as each other, from the worst together to the best together,
    because that is what a good division of time delivers; and a Latin square of the others.
    """
    feeding = upstream(call)
    if not feeding:
        return [()]
    columns: list[list[tuple[str, _Sample, int]]] = []
    for name, source in feeding.items():
        pool = [
            (name, sample, index)
            for maker in makers(source)
            for sample in samples[maker.label][key]
            for index in range(len(sample.values))
        ]
        columns.append(_strata(pool))
    if any(not column for column in columns):
        return []  # nothing arrived, so nothing is run: no result is never extrapolated to
    return [
        tuple(column[place] for column, place in zip(columns, row, strict=True))
        for row in _design([len(column) for column in columns], seed_of("latin", call.label, key))
    ]


def _design(sizes: Sequence[int], seed: int) -> list[tuple[int, ...]]:
    """Which of the strata of each input are fed together: all combinations if they are few."""
    if math.prod(sizes) <= COMBINATIONS:
        return list(itertools.product(*(range(size) for size in sizes)))
    count = max(sizes)
    spread = [np.linspace(0, size - 1, count).round().astype(int).tolist() for size in sizes]
    shifts = np.random.default_rng(seed).permutation(count).tolist()
    latin = [shifts[place % count] - shifts[0] for place in range(len(sizes))]
    rows = [
        tuple(places[(row + by) % count] for places, by in zip(spread, shifted, strict=True))
        for shifted in ([0] * len(sizes), latin)
        for row in range(count)
    ]
    return list(dict.fromkeys(rows))


def _strata(pool: Sequence[tuple[str, _Sample, int]]) -> list[tuple[str, _Sample, int]]:
    """At most `STRATA` results, equally spaced in achieved quality, and the last one; the worst
    first."""
    if not pool:
        return []
    # A cost rises where a quality falls. Where a join mixes both, they are spaced apart.
    quality = np.array(
        [s.raw[i] if s.module.quality is not None else -s.raw[i] for _, s, i in pool]
    )
    chosen = set(range(len(pool)))
    if len(pool) > STRATA:
        others = STRATA - int(quality[-1] < quality.max())  # the last is often the best as well
        targets = np.linspace(quality.min(), quality.max(), others)
        chosen = {int(np.argmin(np.abs(quality - target))) for target in targets}
        chosen.add(len(pool) - 1)
    return [pool[index] for index in sorted(chosen, key=lambda index: (quality[index], index))]


def _library(
    program: Program,
    keys: Sequence[str],
    samples: Mapping[str, Mapping[str, list[_Sample]]],
    machine: Machine | None,
) -> ProfileLibrary:
    references: dict[str, dict[str, float]] = {}
    for call in program.calls:
        if call.module.quality is not None:
            continue
        best = references.setdefault(call.module.name, {})
        for key, runs in samples[call.label].items():
            costs = [float(cost) for run in runs for cost in run.raw if cost > 0]
            if costs:
                best[key] = min([*costs, best.get(key, math.inf)])
    for best in references.values():
        for key in keys:  # where every cost is 0, or nothing arrived, any reference will do
            best.setdefault(key, 1.0)

    def quality(key: str, sample: _Sample, index: int) -> float:
        raw = float(sample.raw[index])
        if sample.module.quality is not None:
            return raw
        return 1.0 if raw == 0 else min(1.0, references[sample.module.name][key] / raw)

    profiles: dict[str, Profile] = {}
    rates: dict[str, Rate] = {}
    for call in program.calls:
        feeding, recordings = upstream(call), []
        for key, runs in samples[call.label].items():
            for sample in runs:
                inputs = {name: quality(key, fed, index) for name, fed, index in sample.fed}
                recordings.append(_recording(call, key, sample, inputs))
        name = call.module.name
        known = profiles.get(name)
        if known is not None and recordings:
            if set(known.inputs) != set(feeding):
                raise AnytimeError(
                    f"program {program.name!r} calls {name} in two ways, fed by other modules at "
                    f"({', '.join(known.inputs)}) and at ({', '.join(feeding)}); give one of them "
                    "a module of its own"
                )
            profiles[name] = replace(known, recordings=(*known.recordings, *recordings))
        elif recordings:
            best = references.get(name, {})
            here = machine.name if machine else "this"
            profiles[name] = Profile(name, tuple(feeding), tuple(recordings), best, here)
        same = [other.label for other in program.calls if other.module is call.module]
        rates[name] = _rate([run for at in same for runs in samples[at].values() for run in runs])
    return ProfileLibrary(profiles=profiles, machine=machine or Machine("this", rates))


def _recording(call: Call, key: str, sample: _Sample, inputs: Mapping[str, float]) -> Recording:
    changes = sample.changes
    return Recording(
        key,
        call.label,
        inputs,
        {name: float(value) for name, value in sample.features.items()},
        np.array([change.seconds for change in changes]),
        np.array([change.work for change in changes], dtype=float),
        sample.raw,
        np.array([np.nan if c.estimate is None else c.estimate for c in changes]),
        (sample.result.elapsed, sample.result.work),
        bool(sample.result.status.name == "COMPLETE"),
    )


def _rate(runs: Sequence[_Sample]) -> Rate:
    """Seconds per work from the runs: per unit if the module counts its own, else per step."""
    if not runs:
        return Rate()
    if any(sample.run.charges for sample in runs):
        pieces: list[tuple[float, float]] = []
        for sample in runs:
            marks = [(0.0, 0.0), *((c.work, c.seconds) for c in sample.changes)]
            marks.append((sample.result.work, sample.result.elapsed))
            pieces += [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(marks)]
        return charged_rate(pieces)
    return stepped_rate(
        (step, took) for sample in runs for step, took in enumerate(sample.run.step_seconds)
    )


def problem_keys(program: Program, problems: Sequence[Any]) -> list[str]:
    """A key for each problem: its name, or a hash of its inputs; equal problems are numbered."""
    keys: list[str] = []
    for problem in problems:
        missing = [name for name in program.inputs if not hasattr(problem, name)]
        if missing:
            raise AnytimeError(
                f"problems[{len(keys)}] has no .{missing[0]}; the inputs of {program.name} are "
                f"{', '.join(program.inputs)}"
            )
        name = getattr(problem, "name", None)
        key = name if isinstance(name, str) else _digest(program, problem)
        numbered = (f"{key}#{count}" for count in itertools.count(2))
        keys.append(key if key not in keys else next(k for k in numbered if k not in keys))
    return keys


def _digest(program: Program, problem: Any) -> str:
    digest = hashlib.blake2b(digest_size=8)
    for name in program.inputs:
        value = getattr(problem, name)
        try:
            array = np.asarray(value)
            plain = array.dtype != object
        except (ValueError, TypeError):
            plain = False
        digest.update(
            np.ascontiguousarray(array).tobytes() if plain else type(value).__name__.encode()
        )
    return digest.hexdigest()
