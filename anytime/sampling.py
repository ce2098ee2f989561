"""Running a program's modules on one problem, each on what the others really deliver."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from anytime import isolation
from anytime.clocks import Clock, Deadline
from anytime.errors import AnytimeError
from anytime.knobs import family_of
from anytime.machines import step_bin
from anytime.modules import Module
from anytime.outcomes import Outcome, Pace
from anytime.programs import Call, Input, Join, Program, makers, upstream
from anytime.recordings import Recording
from anytime.results import Change, Result
from anytime.running import Run, execute, seed_of
from anytime.structure import answers
from anytime.thinning import Thinned

STRATA = 4  # qualities of an input that a consumer is run on, on one problem
COMBINATIONS = 9  # of several inputs that it is run on, at most
CHANGES = 64  # registrations kept of one run, at most
CONTRACTS = 8  # times for which a contract module is run, each half of the next
STEPS = 16  # steps of one run that are kept in each bin of its machine's rate


@dataclass(frozen=True)
class How:
    """How runs are made: see `anytime.measure`."""

    seconds: float
    clock: Callable[[], Clock]
    rest: float = 0.0
    seed: int = 0


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


def sampled(program: Program, key: str, problem: Any, how: How) -> Outcome:
    """Run every call of a program on one problem, and score what was registered.

    Raises AnytimeError for what fails before any result, and for a score that is none.
    """
    samples: dict[str, list[_Sample]] = {}
    for call in program.calls:
        told = _told(program, call, problem, samples)
        samples[call.label] = [
            _sample(call, problem, key, fed, told, how) for fed in _feeds(call, key, samples)
        ]
    references = _references(program, samples)
    recordings: dict[str, tuple[Recording, ...]] = {}
    for call in program.calls:
        rows: list[Recording] = []
        for sample in samples[call.label]:
            inputs = {name: _quality(fed, at, references) for name, fed, at in sample.fed}
            rows.append(_recording(call, key, sample, inputs))
        recordings[call.label] = tuple(rows)
    paces: dict[str, tuple[Pace, ...]] = {}
    for call in program.calls:
        known = paces.get(call.module.name, ())
        paces[call.module.name] = known + tuple(map(_pace, samples[call.label]))
    faults = {
        sample.module.name: str(sample.result.fault)
        for sample in itertools.chain(*samples.values())
        if sample.result.fault
    }
    return Outcome(key, recordings, references, paces, faults)


def _references(program: Program, samples: Mapping[str, list[_Sample]]) -> dict[str, float]:
    """The cheapest known result of each module with a cost; where nothing arrived, any reference
    will do."""
    best: dict[str, float] = {}
    for call in program.calls:
        if call.module.quality is not None:
            continue
        costs = [float(cost) for run in samples[call.label] for cost in run.raw]
        # Settings of one module are compared with each other, so they share the reference.
        family = family_of(call.module.name)
        best[family] = min([*costs, best.get(family, math.inf)])
    names = [call.module.name for call in program.calls if call.module.quality is None]
    known = {name: best[family_of(name)] for name in names}
    return {name: cost if math.isfinite(cost) else 1.0 for name, cost in known.items()}


def _quality(sample: _Sample, index: int, references: Mapping[str, float]) -> float:
    raw = float(sample.raw[index])
    if sample.module.quality is not None:
        return raw
    return 1.0 if raw == 0 else min(1.0, references[sample.module.name] / raw)


def _pace(sample: _Sample) -> Pace:
    """How long units of work took in a run that charged, else steps: some of each bin."""
    if sample.run.charges:
        marks = [(0.0, 0.0), *((c.work, c.seconds) for c in sample.changes)]
        marks.append((sample.result.work, sample.result.elapsed))
        return Pace(True, tuple((b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(marks)))
    took = sample.run.step_seconds
    kept: list[tuple[float, float]] = []
    for _, members in itertools.groupby(range(len(took)), key=step_bin):
        steps = list(members)
        kept += [(float(step), took[step]) for step in steps[:: -(-len(steps) // STEPS)]]
    return Pace(False, tuple(kept))


def _sample(
    call: Call,
    problem: Any,
    key: str,
    fed: tuple[tuple[str, _Sample, int], ...],
    told: Mapping[str, float],
    how: How,
) -> _Sample:
    module = call.module
    by_name = {name: sample.values[index] for name, sample, index in fed}
    inputs = tuple(
        by_name[name] if isinstance(argument, Call | Join) else _argument(argument, problem)
        for name, argument in zip(module.parameters, call.arguments, strict=True)
    )
    levels = tuple(index for *_, index in fed)

    isolation.warm(module)  # a process that starts is no part of what is measured

    def once(budget: float) -> tuple[list[tuple[Any, Change]], Result, Run]:
        results = Thinned(4 * CHANGES)
        if how.rest:  # even a sleep of 0 s gives the processor away
            time.sleep(how.rest)
        rng = np.random.default_rng(seed_of(how.seed, call.label, key, levels))
        deadline = Deadline.after(budget, how.clock())
        result, run = execute(module, inputs, deadline, rng=rng, observe=results.add)
        return results.kept, result, run

    kept, result, run = once(how.seconds)
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
        shorter = [once(how.seconds * 0.5**halvings)[0] for halvings in range(CONTRACTS - 1, 0, -1)]
        kept = _in_order(pair for each in (*shorter, kept) for pair in each[-1:])
    if len(kept) > CHANGES:
        chosen = np.unique(np.linspace(0, len(kept) - 1, CHANGES).round().astype(int))
        kept = [kept[i] for i in chosen]
    raw = np.array([scored(module, value, problem, key) for value, _ in kept])
    features = {**(module.features(*inputs) if module.features else {}), **told}
    for name, value in features.items():
        if not math.isfinite(value):
            raise AnytimeError(
                f"feature {name!r} of {module.name!r} is {value} on problem {key}; features must "
                "be finite numbers"
            )
    values, changes = tuple(value for value, _ in kept), tuple(change for _, change in kept)
    return _Sample(module, values, changes, raw, fed, result, run, features)


def _told(
    program: Program,
    call: Call,
    problem: Any,
    samples: Mapping[str, list[_Sample]],
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
        ends = [s.values[-1] for m in makers(test) for s in samples[m.label] if s.values]
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


def scored(module: Module, value: Any, problem: Any, key: str) -> float:
    """The score of a result. Raises AnytimeError for one that is none."""
    try:
        score = float(module.score(value, problem))
    except AnytimeError:
        raise
    except (Exception, SystemExit) as error:
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
    call: Call, key: str, samples: Mapping[str, list[_Sample]]
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
            for sample in samples[maker.label]
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
        max(len(changes), len(sample.run.history)),  # changes of a contract are of several runs
        sample.run.steps,
    )
