"""Contracts run one after the other, the best result kept, so that they may be interrupted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from anytime import running
from anytime.clocks import Deadline
from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.profiles import Profile
from anytime.recordings import Recording
from anytime.results import Change, Result, Status
from anytime.running import Run, execute
from compiler.compiled import CompiledProgram

SLACK = 1 + 1e-9  # so that rounding does not cost a contract the step that just fits
Observer = Callable[[Any, Change], None]
# (inputs, deadline, what the run fills in, told of each result) -> what one contract has to show
Contract = Callable[[tuple[Any, ...], Deadline, Mapping[str, Any], Observer], Result]
# (contracts done, seconds since the start, quality seen) -> seconds of the next, None = no more
Following = Callable[[int, float, float | None], float | None]


def contract_of(what: Module | CompiledProgram) -> Contract:
    """How a contract module or a compiled program is run for a time that it is told."""
    if isinstance(what, Module):
        module = what

        def run_module(
            inputs: tuple[Any, ...],
            deadline: Deadline,
            filled: Mapping[str, Any],
            observe: Observer,
        ) -> Result:
            return execute(module, inputs, deadline, **filled, observe=observe)[0]

        return run_module
    compiled, output = what, what.program.output.label

    def run_program(
        inputs: tuple[Any, ...], deadline: Deadline, filled: Mapping[str, Any], observe: Observer
    ) -> Result:
        def of_output(label: str, value: Any, change: Change) -> None:
            if label == output:
                observe(value, change)

        kept = filled.get("memory")
        return compiled.run(
            deadline=deadline,
            rng=filled.get("rng"),
            on_result=of_output,
            memory=None if kept is None else {n: kept.setdefault(n, {}) for n in compiled.labels},
            **dict(zip(compiled.program.inputs, inputs, strict=True)),
        )

    return run_program


class _Best:
    """The best result of all contracts so far, registered with the run as soon as it is there."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.longest = 0.0  # seconds of the longest contract that has a result
        self.estimate: float | None = None

    def seen(self, value: Any, change: Change) -> None:
        """A result within a contract: better than the best only if that can be seen."""
        if change.estimate is not None and (
            self.estimate is None or change.estimate > self.estimate
        ):
            self.run.record(value)
            self.estimate = change.estimate

    def finished(self, part: Result, seconds: float) -> None:
        """The result of a contract of this length; where nothing is seen the longest is best."""
        if not part:
            return
        estimate = self.run.module.estimate
        if estimate is not None:
            self.seen(part.value, Change(0.0, 0.0, float(estimate(part.value))))
        elif seconds > self.longest:
            self.run.record(part.value)
        self.longest = max(self.longest, seconds)


def one_after_the_other(
    contract: Contract, name: str, following: Following, *, again: bool, enough: bool
) -> Callable[..., Iterator[None]]:
    """The function of a module that runs contracts until no more follow.

    again: whether one that is not longer than an earlier one is of use. enough: whether a contract
    that completes before its time leaves nothing to do.
    A deadline that is known shortens the contract that it would cut.
    """

    def refine(*inputs: Any, **filled: Any) -> Iterator[None]:
        running.charge(0.0)  # the contracts charge their own work
        run = running.here()
        clock, started = run.deadline.clock, run.deadline.clock.now()
        best, done = _Best(run), 0
        while True:
            planned = following(done, clock.now() - started, best.estimate)
            if planned is None:
                return
            seconds = min(planned, run.deadline.remaining())
            if seconds <= (0.0 if again else best.longest):
                run.cut = True  # not the end of the sequence but the deadline ends it
                return
            part = contract(inputs, run.deadline.sooner(seconds * SLACK), filled, best.seen)
            run.cut = run.cut or run.deadline.interrupted()
            if run.cut and part.elapsed < seconds:
                return  # what was cut is no result of a contract of this length
            best.finished(part, seconds)
            if part.fault is not None:
                raise AnytimeError(f"a contract of {name} for {seconds:.4g} s failed: {part.fault}")
            done += 1
            if enough and part.status is Status.COMPLETE:
                return
            yield

    return refine


def profile_of_sequence(name: str, profile: Profile, lengths: Sequence[float]) -> Profile:
    """The profile of contracts of these lengths run one after the other, from that of one."""
    recordings = tuple(_in_sequence(run, lengths) for run in profile.recordings)
    return Profile(
        name, profile.inputs, recordings, profile.references, profile.machine, profile.condition
    )


def _in_sequence(run: Recording, lengths: Sequence[float]) -> Recording:
    rows: list[tuple[float, float, float, float]] = []
    elapsed, work = 0.0, 0.0
    for length in lengths:
        elapsed += length
        last = int(np.searchsorted(run.seconds, length * (1 + 1e-12), side="right")) - 1
        if last < 0:
            continue
        work += float(run.work[last])
        estimate = float(run.estimates[last])
        if not rows or math.isnan(estimate) or estimate > rows[-1][3]:
            rows.append((elapsed, work, float(run.raw[last]), estimate))
    seconds, done, raw, estimates = np.array(rows).reshape(-1, 4).T
    return Recording(
        run.problem,
        run.call,
        run.inputs,
        run.features,
        seconds,
        done,
        raw,
        estimates,
        (elapsed, work),
        complete=True,
    )


def in_turn(lengths: Sequence[float]) -> Following:
    """These lengths, one after the other."""
    return partial(_in_turn, tuple(lengths))


def _in_turn(
    lengths: tuple[float, ...], done: int, elapsed: float, quality: float | None
) -> float | None:
    return lengths[done] if done < len(lengths) else None
