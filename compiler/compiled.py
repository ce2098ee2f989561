"""A compiled program: a contract algorithm with an optimal performance profile. [ZR93] §4."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anytime import running
from anytime.clocks import DECIMALS, Clock, Deadline, WallClock, is_number
from anytime.errors import AnytimeError
from anytime.joins import Several
from anytime.modules import Module
from anytime.pictures import duration, figure
from anytime.profiles import Profile
from anytime.programs import Join, Program, makers
from anytime.results import Result, Status
from compiler.adaptive import ceiling
from compiler.advising import Advice, advise
from compiler.allocations import Allocation
from compiler.calibrating import Calibration, calibrate_by_running
from compiler.compiled_profiles import profile_of
from compiler.costs import stretched
from compiler.division import Floats, Frontier
from compiler.executing import Execution, Listener, Memory, Shares, planned, status_of, unwanted
from compiler.explaining import Explanation, decided, explain
from compiler.guarding import Steps
from compiler.objectives import EXPECTED, Objective
from compiler.policies import Plan, Policy
from compiler.replaying import Replay
from compiler.showing import picture_of, text_of
from compiler.storing import save
from compiler.tables import Table
from compiler.validating import Validation, lived, validate

if TYPE_CHECKING:
    from compiler.activities import Activity


@dataclass(frozen=True)
class CompiledProgram:
    """A program with the best division of any amount of time among its calls.

    tables: one for each call; frontier: the divisions worth having; steps: durations of each
    module's steps, for the deadline guard. calibration: from what the tables say to what is
    promised. regret: no division promises more by more than that, at 95 %. replay: the recorded
    problems, not in files.
    """

    program: Program
    tables: tuple[Table, ...]
    frontier: Frontier
    calibration: Calibration
    steps: Mapping[str, Steps]
    machine: str
    regret: float
    objective: Objective = EXPECTED
    policy: Policy | None = None
    replay: Replay | None = field(default=None, compare=False)

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
        """What the result is worth for a budget: its expected quality, unless it was compiled for
        another objective; 0 below the least budget."""
        plan = self._plan(_finite(seconds))
        worth = self.frontier.promise(seconds)
        return self.calibration.promise(plan.value) if plan else worth

    def ceiling(self, seconds: float) -> float:
        """What no division of this budget promises more than: the promise itself where it is
        exact, else the value of a policy that sees what every call achieves; 1 where even that
        is out of reach."""
        if self.frontier.exact:
            return self.promise(seconds)
        bound = ceiling(self.program, self.tables, _finite(seconds), self.objective)
        return max(self.promise(seconds), 1.0 if bound is None else self.calibration.promise(bound))

    def _plan(self, seconds: float) -> Plan | None:
        """The plan of the policy for a budget, where it is worth more than the best division."""
        plan = self.policy.plan(seconds) if self.policy else None
        if plan is None:
            return None
        worth = self.calibration.promise(plan.value)
        return plan if worth > self.frontier.promise(seconds) + 1e-9 else None

    def interval(self, seconds: float) -> tuple[float, float]:
        """The 95 % interval of the promise for a budget; (0, 0) below the least one."""
        if self.frontier.index(_finite(seconds)) < 0:
            return 0.0, 0.0
        return self.calibration.interval(self.promise(seconds))

    def allocate(self, seconds: float) -> Allocation:
        """The best division of a budget. Raises AnytimeError for one below the least."""
        seconds = _finite(seconds)
        index = self.frontier.index(seconds)
        if index < 0:
            raise AnytimeError(
                f"{duration(seconds)} is below the least budget of {self.name!r}, "
                f"{duration(self.least)}"
            )
        named = self.divided(self.frontier.shares[index].tolist(), seconds)
        return Allocation(seconds, named, self.promise(seconds))

    def divided(self, shares: Sequence[float], seconds: float) -> Mapping[str, float]:
        """Seconds of each call when a budget is divided like this row of the frontier's shares."""
        if self.objective.timeless:
            return stretched(self.tables, shares, seconds)
        # More time was not worth its cost.
        return {t.label: s for t, s in zip(self.tables, shares, strict=True) if not t.rule}

    @cached_property
    def profile(self) -> Profile:
        """The performance profile of the whole program, by the budget that it is given."""
        return profile_of(self.name, self.tables, self.frontier, self.machine)

    @cached_property
    def module(self) -> Module:
        """This program as a contract module, to be called in other programs.

        Raises AnytimeError where its output is not the result of modules that are scored alike:
        several outputs, or the answer of `all_of` or `any_of`.
        """
        output = self.program.output
        scored = makers(output)
        if not scored or (isinstance(output, Join) and isinstance(output.rule, Several)):
            raise AnytimeError(
                f"program {self.name!r} cannot be a module, which has one result of one quality: "
                f"it returns {'several outputs' if scored else 'the answer of tests'}"
            )

        def contract(*inputs: Any, seconds: float) -> Any:
            named = dict(zip(self.program.inputs, inputs, strict=True))
            running.charge(0.0)  # its calls charge their own work
            deadline = running.here().deadline
            return self.run(deadline=deadline.sooner(seconds), **named).value

        scorer = scored[0].module
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
        memory: Memory | None = None,
        **inputs: Any,
    ) -> Result:
        """Run the program for a budget: each call gets its share, unspent time passes on.

        seconds or deadline: the budget; clock: whose time it is (real time by default). Inside
        another run it ends at the earlier deadline.
        on_result: called with (label, value, change) whenever a call registers a result.
        memory: what modules with a `memory` keep between runs, by call; fresh without.
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
        plan, decide = self._plan(budget), None
        if self.policy is not None and plan is not None:
            decide = partial(self.policy.share, self.program, plan)
        execution = self._execution(allocation.shares, deadline, inputs, rng, on_result, decide)
        execution.memory = {} if memory is None else memory
        for _ in execution.stages():
            pass
        return self._composed(allocation, execution)

    def start(
        self, *, clock: Clock | None = None, rng: np.random.Generator | None = None
    ) -> Activity:
        """An activity: this program for a loop that calls it again and again.

        clock: whose time it is (real time by default). rng: of everything random in the modules.
        """
        from compiler.activities import Activity

        return Activity(self, clock, rng)

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
        """Run call after call and yield (label, result), until there cannot be an output any more.

        shares: seconds of each call, by label; the last call has all that is left. interrupted:
        asked before each step of a generator; true ends the program.
        """
        execution = self._execution(shares, deadline, inputs, rng, on_result)
        execution.interrupted = interrupted
        return execution.stages()

    def _execution(
        self,
        shares: Mapping[str, float],
        deadline: Deadline,
        inputs: Mapping[str, Any],
        rng: np.random.Generator | None,
        on_result: Listener | None,
        decide: Shares | None = None,
    ) -> Execution:
        return Execution(
            self.program,
            {table.label: table for table in self.tables},
            self.steps,
            deadline,
            inputs,
            shares,
            planned(self.tables, shares),
            frozenset() if decide else unwanted(self.program, self.tables, shares),
            thrifty=not self.objective.timeless,
            rng=rng,
            on_result=on_result,
            decide=decide,
        )

    def _composed(self, allocation: Allocation, execution: Execution) -> Result:
        deadline, parts = execution.deadline, execution.parts
        now = deadline.clock.now()
        output = execution.known(self.program.output)
        fault = next((part.fault for part in parts.values() if part.fault), None)
        shares = {**allocation.shares, **execution.granted}
        why = {label: watch.why for label, watch in execution.watches.items()}
        spent = " → ".join(
            f"{label} {duration(part.elapsed)} of {duration(shares[label])}{why.get(label, '')}"
            for label, part in parts.items()
        )
        if output is None:
            silent = next((label for label, part in parts.items() if not part), "nothing")
            spent += f"; {silent} had no result"
        last = parts.get(self.program.output.label)
        return Result(
            status_of(output, parts),
            None if output is None else output.value,
            fault,
            now - execution.started,
            round(max(0.0, now - max(deadline.at, execution.started)), DECIMALS),
            last.history if output is not None and last is not None else (),
            sum(part.work for part in parts.values()),
            dict(parts),
            spent,
        )

    def explain(self, seconds: float) -> Explanation:
        """Who gets how much of a budget, and what a second more would be worth to each; of an
        adaptive schedule also what it decides while it runs."""
        seconds = _finite(seconds)
        found = explain(
            self.name,
            self.tables,
            self.frontier,
            seconds,
            self.calibration,
            self.regret,
            self.objective,
        )
        plan = self._plan(seconds)
        if self.policy is None or plan is None:
            return found
        return replace(
            found,
            promised=self.promise(seconds),
            less=self.promise(0.9 * seconds),
            more=self.promise(1.1 * seconds),
            within=self.interval(seconds),
            decided=decided(self.program, self.tables, self.policy, plan),
        )

    def advise(self, seconds: float) -> Advice:
        """Which module is worth making faster or better at this budget."""
        seconds = _finite(seconds)
        if seconds <= 0:
            raise AnytimeError(f"a budget of {seconds} s; give one > 0 to be advised on")
        return advise(self.name, self.tables, self.frontier, seconds, self.calibration, self.replay)

    def validate(
        self,
        problems: Iterable[Any],
        *,
        budgets: Sequence[float] | None = None,
        clock: Callable[[], Clock] = WallClock,
        seed: int = 0,
    ) -> Validation:
        """Promised against achieved on problems that the profiles never saw.

        budgets: seconds; six from the least to that beyond which nothing is gained by default.
        Raises AnytimeError for less than two problems or one without a needed attribute.
        """
        asked = self._budgets() if budgets is None or not len(budgets) else budgets
        return validate(self, problems, budgets=asked, clock=clock, seed=seed)

    def calibrated(
        self,
        problems: Iterable[Any],
        *,
        clock: Callable[[], Clock] = WallClock,
        seed: int = 0,
    ) -> CompiledProgram:
        """This program with promises from really running it on problems that the profiles never
        saw, for where `validate` shows that those from recordings do not hold: in long programs
        the quality of an input may not be enough to describe it. Divisions that achieve less than
        others with less time are dropped.

        Raises AnytimeError as `validate` does.
        """
        listed = list(problems)

        def run(budgets: Sequence[float]) -> Floats:
            lives = lived(self, listed, budgets, clock, seed)
            return np.nan_to_num(lives.qualities[self.program.output.label]).T

        frontier, calibration = calibrate_by_running(self.tables, self.frontier, run)
        return replace(self, frontier=frontier, calibration=calibration)

    def save(self, path: str | Path) -> None:
        """Write the compiled program to a file; `compiler.load` reads it back."""
        save(self, Path(path))

    def _budgets(self, count: int = 6) -> Sequence[float]:
        most = float(self.frontier.budgets[-1])
        return np.geomspace(max(self.least, 1e-3 * most, 1e-9), max(most, 1e-9), count).tolist()

    def __repr__(self) -> str:
        title = f"{self.program!r} on machine {self.machine}"
        rows = [(self.allocate(each), self.interval(each)) for each in self._budgets()]
        return text_of(title, rows, self.regret)

    def _repr_html_(self) -> str:
        first, last = self._budgets(2)
        allocations = [self.allocate(each) for each in np.geomspace(first, last, 80).tolist()]
        return figure(picture_of(self.name, self.tables, allocations), repr(self))


def _check_inputs(program: Program, inputs: Mapping[str, Any]) -> None:
    missing = [name for name in program.inputs if name not in inputs]
    unknown = [name for name in inputs if name not in program.inputs]
    if missing or unknown:
        wrongs = [f"misses {name!r}" for name in missing[:1]]
        wrongs += [f"does not take {name!r}" for name in unknown[:1]]
        wrong = " and ".join(wrongs)
        raise AnytimeError(f"{program.name} {wrong}; its inputs are {', '.join(program.inputs)}")


def _finite(seconds: float) -> float:
    if not is_number(seconds) or not -np.inf < seconds < np.inf:
        raise AnytimeError(f"a budget of {seconds!r} s; give a finite number of seconds")
    return float(seconds)
