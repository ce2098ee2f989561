"""A compiled program: a contract algorithm with an optimal performance profile. [ZR93] §4."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from anytime import running
from anytime.clocks import Clock, Deadline
from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.pictures import duration, figure, line_chart, number
from anytime.profiles import Profile, Recording
from anytime.programs import Call, Input, Program
from anytime.results import Change, Result, Status
from anytime.running import Run, execute
from compiler import baselines
from compiler.division import Floats, Frontier, moments_within, output_chances
from compiler.explaining import Advice, Explanation, advise, explain
from compiler.guarding import Steps, guard
from compiler.intervals import Interval
from compiler.storing import save
from compiler.tables import Table

Listener = Callable[[str, Any, Change], None]
QUANTILES = 20  # that stand for the distribution of the result in the compiled profile


@dataclass(frozen=True)
class Allocation:
    """Who gets how much of a budget, and what is expected of it.

    shares: seconds by call; what is left of the budget is the last call's.
    """

    seconds: float
    shares: Mapping[str, float]
    promised: float

    def __repr__(self) -> str:
        parts = ", ".join(f"{label} {duration(s)}" for label, s in self.shares.items())
        return f"{duration(self.seconds)}: {parts} → {number(self.promised)}"


@dataclass(frozen=True)
class CompiledProgram:
    """A program with the best division of any amount of time among its calls.

    tables: one for each call; frontier: the divisions worth having; steps: durations of each
    module's steps, for the deadline guard.
    """

    program: Program
    tables: tuple[Table, ...]
    frontier: Frontier
    intervals: tuple[Interval, ...]
    steps: Mapping[str, Steps]
    machine: str

    @property
    def name(self) -> str:
        return self.program.name

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(call.label for call in self.program.calls)

    @property
    def least(self) -> float:
        """The least budget with a result, in seconds."""
        return float(self.frontier.budgets[0])

    def promise(self, seconds: float) -> float:
        """Expected quality of the result for a budget; 0 below the least one."""
        return self.frontier.promise(seconds)

    def allocate(self, seconds: float) -> Allocation:
        """The best division of a budget. Raises AnytimeError for one below the least."""
        index = self.frontier.index(_finite(seconds))
        if index < 0:
            raise AnytimeError(
                f"{duration(seconds)} is below the least budget of {self.name!r}, "
                f"{duration(self.least)}"
            )
        shares = [float(s) for s in self.frontier.shares[index]]
        shares[-1] = seconds - sum(shares[:-1])
        return Allocation(
            seconds,
            dict(zip(self.labels, shares, strict=True)),
            float(self.frontier.promised[index]),
        )

    @cached_property
    def profile(self) -> Profile:
        """The performance profile of the whole program, by the budget that it is given."""
        rows: list[Floats] = []
        for shares in self.frontier.shares:
            chances = output_chances(self.tables, moments_within(self.tables, shares))
            rows.append(_quantiles(chances, self.tables[-1].levels))
        table = np.array(rows)  # [budgets, quantiles], NaN = no result
        recordings: list[Recording] = []
        end = float(self.frontier.budgets[-1])
        for column in range(QUANTILES):
            there = ~np.isnan(table[:, column])
            budgets = self.frontier.budgets[there]
            recordings.append(
                Recording(
                    problem=f"quantile {column}",
                    call=self.name,
                    inputs={},
                    features={},
                    seconds=budgets,
                    work=budgets,
                    raw=table[there, column],
                    estimates=np.full(len(budgets), np.nan),
                    end=(end, end),
                    complete=True,
                )
            )
        return Profile(self.name, (), tuple(recordings), machine=self.machine)

    @cached_property
    def module(self) -> Module:
        """This program as a contract module, to be called in other programs."""

        def contract(*inputs: Any, seconds: float) -> Any:
            named = dict(zip(self.program.inputs, inputs, strict=True))
            running.charge(0.0)  # its calls charge their own work
            deadline = running.here().deadline
            return self.run(deadline=deadline.sooner(seconds), **named).value

        scorer = self.program.output.module
        return Module(
            self.name,
            contract,
            self.program.inputs,
            frozenset({"seconds"}),
            scorer.quality,
            scorer.cost,
            scorer.estimate,
        )

    def __call__(self, *inputs: Any) -> Any:
        return self.module(*inputs)

    def run(
        self,
        seconds: float | None = None,
        *,
        deadline: Deadline | None = None,
        clock: Clock | None = None,
        rng: np.random.Generator | None = None,
        on_result: Listener | None = None,
        **inputs: Any,
    ) -> Result:
        """Run the program for a budget: each call gets its share, unspent time passes on.

        seconds or deadline: the budget; clock: whose time it is (real time by default). Inside
        another run it ends at the earlier deadline.
        on_result: called with (label, value, change) whenever a call registers a result.
        inputs: by name. Below the least budget nothing is run and there is no result.
        Raises AnytimeError for missing or unknown inputs.
        """
        if (seconds is None) == (deadline is None):
            raise AnytimeError(f"give seconds=… or deadline=… to run {self.name!r}, one of them")
        _check_inputs(self.program, inputs)
        if seconds is not None:
            _finite(seconds)
        deadline = running.bounded(seconds, deadline, clock)
        budget = deadline.remaining()
        if self.frontier.index(budget) < 0:
            why = f"{duration(budget)} is below the least budget, {duration(self.least)}"
            return Result(Status.NO_RESULT, None, None, 0.0, max(0.0, -budget), (), why=why)
        allocation = self.allocate(budget)
        started = deadline.clock.now()
        stages = self.stages(allocation.shares, deadline, inputs, rng=rng, on_result=on_result)
        parts = dict(stages)
        return self._composed(allocation, deadline, started, parts)

    def stages(
        self,
        shares: Mapping[str, float],
        deadline: Deadline,
        inputs: Mapping[str, Any],
        *,
        rng: np.random.Generator | None = None,
        interrupted: Callable[[], bool] = lambda: False,
        on_result: Listener | None = None,
    ) -> Iterator[tuple[str, Result]]:
        """Run call after call and yield (label, result); the end of one without a result.

        shares: seconds of each call, by label; the last call has all that is left. interrupted:
        asked before each step of a generator; true ends the program.
        """
        clock = deadline.clock
        share_ends = clock.now()
        parts: dict[str, Result] = {}
        for place, call in enumerate(self.program.calls):
            last = place == len(self.program.calls) - 1
            share_ends += shares[call.label]
            ends = deadline.at if last else min(share_ends, deadline.at)
            hard = deadline.at - sum(table.first for table in self.tables[place + 1 :])
            held = None
            if call.module.generator and not call.module.contract and not last:
                held = guard(self.steps.get(call.module.name), ends, hard)
            if not last and not held:
                # A share that others have used up still leaves time for a first result.
                ends = max(ends, min(clock.now() + self.tables[place].first, hard))
            # A generator with a guard is held to its share by it, the others by their deadline.
            own = replace(deadline, at=hard if held else ends)
            may_step = held or Run.may_step
            parts[call.label], _ = execute(
                call.module,
                tuple(_value(argument, inputs, parts) for argument in call.arguments),
                own,
                rng=rng,
                may_step=lambda run, may=may_step: not interrupted() and may(run),
                observe=None if on_result is None else partial(on_result, call.label),
            )
            yield call.label, parts[call.label]
            if not parts[call.label] or interrupted():
                return

    def _composed(
        self,
        allocation: Allocation,
        deadline: Deadline,
        started: float,
        parts: Mapping[str, Result],
    ) -> Result:
        now = deadline.clock.now()
        output = parts.get(self.program.output.label)
        fault = next((part.fault for part in parts.values() if part.fault), None)
        complete = all(part.status is Status.COMPLETE for part in parts.values())
        status = Status.NO_RESULT
        if output:
            status = Status.COMPLETE if complete else Status.INTERRUPTED
        spent = " → ".join(
            f"{label} {duration(part.elapsed)} of {duration(allocation.shares[label])}"
            for label, part in parts.items()
        )
        if not output:
            silent = next(label for label, part in parts.items() if not part)
            spent += f"; {silent} had no result"
        return Result(
            status,
            output.value if output else None,
            fault,
            now - started,
            max(0.0, now - max(deadline.at, started)),
            output.history if output else (),
            sum(part.work for part in parts.values()),
            dict(parts),
            spent,
        )

    def explain(self, seconds: float) -> Explanation:
        """Who gets how much of a budget, and what a second more would be worth to each."""
        return explain(self.name, self.tables, self.frontier, _finite(seconds))

    def advise(self, seconds: float) -> Advice:
        """Which module is worth speeding up at this budget."""
        return advise(self.name, self.tables, self.frontier, _finite(seconds))

    def save(self, path: str | Path) -> None:
        """Write the compiled program to a file; `compiler.load` reads it back."""
        save(self, Path(path))

    def _budgets(self, count: int = 6) -> Sequence[float]:
        most = float(self.frontier.budgets[-1])
        return np.geomspace(max(self.least, 1e-3 * most, 1e-9), max(most, 1e-9), count).tolist()

    def __repr__(self) -> str:
        width = max(12, *(len(label) + 2 for label in self.labels))
        header = "".join(f"{label:>{width}}" for label in self.labels)
        lines = [
            f"{self.program!r} on machine {self.machine}"[:100],
            f"{'budget':>10}{header}   promised  95 %",
        ]
        for seconds in self._budgets():
            allocation = self.allocate(seconds)
            shares = "".join(f"{duration(s):>{width}}" for s in allocation.shares.values())
            low, high = self._interval(seconds)
            lines.append(
                f"{duration(seconds):>10}{shares}   {number(allocation.promised):>8}"
                f"  [{number(low)}, {number(high)}]"
            )
        return "\n".join(line[:100] for line in lines)

    def _interval(self, seconds: float) -> tuple[float, float]:
        at = [interval.seconds for interval in self.intervals]
        low = float(np.interp(seconds, at, [interval.low for interval in self.intervals]))
        high = float(np.interp(seconds, at, [interval.high for interval in self.intervals]))
        promised = self.promise(seconds)
        return min(low, promised), max(high, promised)

    def _repr_html_(self) -> str:
        first, last = self._budgets(2)
        times = np.geomspace(first, last, 80)
        x = times.tolist()
        series = {
            "compiled": (x, [self.promise(t) for t in x]),
            "MIN": (x, baselines.minimal(self.tables, times).tolist()),
            "MAX": (x, baselines.maximal(self.tables, times).tolist()),
        }
        above = line_chart(
            series,
            x_label="budget [s]",
            y_label="expected quality",
            dashed=("MIN", "MAX"),
            title=self.name,
        )
        shares = {
            label: (x, [self.allocate(t).shares[label] / t for t in x]) for label in self.labels
        }
        below = line_chart(shares, x_label="budget [s]", y_label="share of the budget")
        return figure(above + below, repr(self))


def _value(argument: Any, inputs: Mapping[str, Any], parts: Mapping[str, Result]) -> Any:
    if isinstance(argument, Input):
        return inputs[argument.name]
    return parts[argument.label].value if isinstance(argument, Call) else argument.value


def _check_inputs(program: Program, inputs: Mapping[str, Any]) -> None:
    missing = [name for name in program.inputs if name not in inputs]
    unknown = [name for name in inputs if name not in program.inputs]
    if missing or unknown:
        wrong = f"misses {missing[0]!r}" if missing else f"does not take {unknown[0]!r}"
        raise AnytimeError(f"{program.name} {wrong}; its inputs are {', '.join(program.inputs)}")


def _finite(seconds: float) -> float:
    if not seconds > -np.inf or not seconds < np.inf:
        raise AnytimeError(f"a budget of {seconds} s; give a finite number of seconds")
    return float(seconds)


def _quantiles(chances: Floats, levels: Floats) -> Floats:
    """Means of equal slices of a distribution over levels, [QUANTILES]; NaN = no result."""
    edges = np.concatenate([[0.0], np.cumsum(chances)])
    edges = edges / edges[-1]
    slices = np.linspace(0, 1, QUANTILES + 1)
    overlap = np.clip(
        np.minimum(edges[1:, None], slices[None, 1:]) - np.maximum(edges[:-1, None], slices[:-1]),
        0,
        None,
    )
    mean = QUANTILES * (levels @ overlap)
    return np.where(QUANTILES * overlap[0] > 0.5, np.nan, np.clip(mean, 0.0, 1.0))
