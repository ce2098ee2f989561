"""Interruptible programs, really run and interrupted: against doubling, against their promise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

import anytime
from anytime import Deadline, Machine, Module, WorkClock
from anytime.results import Change
from compiler import CompiledProgram, interruptible
from compiler.contracts import contract_of, in_turn, one_after_the_other
from compiler.curves import curve
from compiler.deadlines import survival_of
from compiler.interruption import Interruptible
from compiler.sequencing import tuned_doubling
from experiments.benchmarks.compiler_sequences import Mixture, predictions, ratios, sequences
from experiments.domains import MACHINE, Domain

Figures = dict[str, float | int | None]


def measure(
    compiled: CompiledProgram, unseen: Sequence[Domain], *, quick: bool, seed: int
) -> Figures:
    """Figures `ratio.*`, `schedule.*`, `prediction.*`, `interrupted.*` and `retry.*`."""
    rng = np.random.default_rng([seed, 7])
    return {
        **ratios(),
        "ratio.run_error": abs(_run_ratio(warm=False) / 4 - 1),
        "ratio.warm": _run_ratio(warm=True),  # theory: 2 when all work is kept
        **sequences(rng, random=10 if quick else 60),
        **predictions(),
        **interrupted(compiled, unseen[: 40 if quick else 100], seed),
        **retries(rng, count=200 if quick else 600),
    }


def _run_ratio(*, warm: bool) -> float:
    """The ratio of doubling when a module is really run and interrupted before each end; warm: it
    goes on from the work of the contracts before."""

    @anytime.module(quality=lambda seconds: 1.0)
    def steady(*, seconds: float, memory: dict[str, float]) -> Iterator[float | None]:
        done = memory.get("done", 0.0) if warm else 0.0
        for step in range(32):
            anytime.charge(seconds / 32)
            memory["done"] = done + seconds * (step + 1) / 32
            yield memory["done"] if step == 31 else None

    machine = Machine("m").with_rate("steady", 1.0)
    lengths = tuple(2.0**power for power in range(13))
    function = one_after_the_other(
        contract_of(steady), "steady", in_turn(lengths), again=False, enough=False
    )
    module = Module("steadily", function, (), frozenset({"memory"}), generator=True)
    worst = 0.0
    for end in np.cumsum(lengths)[6:]:
        moment = float(end) * (1 - 1e-6)
        clock = WorkClock(machine)
        until = Deadline(clock, event=lambda clock=clock, moment=moment: clock.now() >= moment)
        in_time: list[float] = []  # what comes later is kept by the run, but was not there

        def keep(value: float, change: Change, kept=in_time, moment=moment) -> None:
            if change.seconds <= moment:
                kept.append(value)

        anytime.run(module, deadline=until, on_result=keep)
        worst = max(worst, moment / in_time[-1])
    return worst


def interrupted(compiled: CompiledProgram, unseen: Sequence[Domain], seed: int) -> Figures:
    """The compiled program interrupted on problems never seen, beside doubling."""
    end = float(compiled.frontier.budgets[-1])
    when = {
        "uniform": stats.uniform(0, 2 * end),
        "bimodal": Mixture((0.5 * end, 2 * end), 0.05 * end),
        "exponential": stats.expon(scale=end),
    }
    errors: list[float] = []
    gains: list[float] = []
    for name, distribution in when.items():
        patient = interruptible(compiled, interruption=distribution)
        survival = survival_of(distribution)
        steps = curve(compiled.frontier.budgets, compiled.frontier.promised, compiled.name)
        rival = _with_lengths(compiled, tuned_doubling(steps, survival))
        shares = (np.arange(len(unseen)) + 0.5) / len(unseen)
        grid = np.linspace(0, 20 * end, 40_001)
        ends = np.interp(1 - shares, survival(grid)[::-1], grid[::-1])
        ends = np.random.default_rng([seed, len(name)]).permutation(ends)
        own = _achieved(patient, patient.score, unseen, ends)
        errors.append(abs(float(own.mean()) - patient.expected))
        gains.append(float((own - _achieved(rival, patient.score, unseen, ends)).mean()))
    return {
        "interrupted.promise_error": max(errors),
        "interrupted.gain_mean": float(np.mean(gains)),
        "interrupted.runs": 2 * len(when) * len(unseen),
    }


def _with_lengths(compiled: CompiledProgram, lengths: tuple[float, ...]) -> Module:
    function = one_after_the_other(
        contract_of(compiled), compiled.name, in_turn(lengths), again=False, enough=False
    )
    return Module(
        "doubled",
        function,
        compiled.program.inputs,
        estimate=compiled.program.output.module.estimate,
        generator=True,
    )


def _achieved(
    module: Module,
    score: Callable[[Any, Any], float],
    problems: Sequence[Domain],
    ends: np.ndarray,
) -> np.ndarray:
    """True quality of what was there at the interruption; 0 where there was nothing."""
    qualities = np.zeros(len(problems))
    for index, (problem, end) in enumerate(zip(problems, ends.tolist(), strict=True)):
        clock = WorkClock(MACHINE)
        until = Deadline(clock, event=lambda clock=clock, end=end: clock.now() >= end)
        kept: list[Any] = []

        def keep(value: Any, change: Change, kept=kept, end=end) -> None:
            if change.seconds <= end:
                kept.append(value)

        anytime.run(
            module, problem.sensor, problem.start, problem.goal, deadline=until, on_result=keep
        )
        if kept:
            qualities[index] = score(kept[-1], problem)
    return qualities


@dataclass(frozen=True)
class _Puzzle:
    hard: float


def retries(rng: np.random.Generator, count: int) -> Figures:
    """Contracts chosen by what is achieved, on problems never seen, beside the best sequence, which
    takes a failure for the problem's fault: for a module with luck, and for one whose results
    differ by problem alone (`misused`)."""

    @anytime.module(quality=lambda found: found, estimate=lambda found: found)
    def guess(hard: float, *, seconds: float, rng: np.random.Generator) -> float | None:
        anytime.charge(seconds)
        lucky = rng.random() < 1 - np.exp(-seconds / (0.1 * hard))
        return float(rng.uniform(0.5, 1)) if lucky else None

    @anytime.module(quality=lambda found: found, estimate=lambda found: found)
    def dig(hard: float, *, seconds: float, rng: np.random.Generator) -> float | None:
        anytime.charge(seconds)
        return float(1 - np.exp(-seconds / (0.1 * hard**3)))

    gains, errors = _retried(guess, rng, count)
    losses, _ = _retried(dig, rng, count)
    return {
        "retry.gain_mean": float(np.mean(gains)),
        "retry.gain_min": min(gains),
        "retry.promise_error": max(errors),
        "retry.misused_mean": float(np.mean(losses)),
        "retry.misused_min": min(losses),
    }


def _retried(
    module: Module, rng: np.random.Generator, count: int
) -> tuple[list[float], list[float]]:
    """Gains of the policy over the best sequence, as shares, and errors of its promise, for three
    distributions of the interruption."""
    machine = Machine("m").with_rate(module.name, 1.0)
    puzzles = [_Puzzle(float(hard)) for hard in np.exp(rng.normal(0, 0.5, size=300))]
    library = anytime.measure(module, puzzles, seconds=1.0, clock=lambda: WorkClock(machine))
    gains: list[float] = []
    errors: list[float] = []
    for when in (stats.uniform(0, 0.4), stats.expon(scale=0.1), stats.norm(0.2, 0.02)):
        modules = [
            interruptible(module, library, interruption=when, adaptive=adaptive)
            for adaptive in (False, True)
        ]
        ends = np.asarray(when.ppf((np.arange(count) + 0.5) / count))
        hard = np.exp(rng.normal(0, 0.5, size=count))
        sequence, policy = (_found(each, machine, hard, ends) for each in modules)
        gains.append(policy / sequence - 1)
        errors.append(abs(policy - modules[1].expected))
    return gains, errors


def _found(module: Interruptible, machine: Machine, hard: np.ndarray, ends: np.ndarray) -> float:
    total = 0.0
    for index, (each, end) in enumerate(zip(hard.tolist(), ends.tolist(), strict=True)):
        clock = WorkClock(machine)
        until = Deadline(clock, event=lambda clock=clock, end=end: clock.now() >= end)
        result = anytime.run(module, each, deadline=until, rng=np.random.default_rng(index))
        in_time = (change.estimate or 0.0 for change in result.history if change.seconds <= end)
        total += max(in_time, default=0.0)
    return total / len(hard)
