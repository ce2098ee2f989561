"""Running a program call by call: shares that are soft, one deadline that is hard."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, MutableMapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from anytime.clocks import Clock, Deadline, WorkClock
from anytime.joins import Known, Rule
from anytime.programs import Call, Constant, Input, Join, Program
from anytime.results import Change, Result, Status
from anytime.running import Run, execute
from anytime.structure import Arm, apart, due, only_for
from compiler import costs
from compiler.guarding import Steps, guard, last_guard
from compiler.policies import Share
from compiler.tables import Table
from compiler.watching import Watch

Listener = Callable[[str, Any, Change], None]
Memory = MutableMapping[str, dict[str, Any]]  # what modules keep between runs, by call
Shares = Callable[[str, float, Mapping[str, Known]], Share]  # call, seconds left, what is known


@dataclass
class Execution:
    """One run of a program in progress.

    shares: seconds of each call. planned: seconds from the start until its share ends, if no other
    arm has its processor first. unwanted: calls that are not run. thrifty: whether the last call
    keeps to its share too. decide: in place of the plan, the share of a call when it, or the
    parallel that it is in, is about to start. memory: of modules between runs, by call. parts: what
    has been run, by label. granted: seconds that were decided for calls when they began. watches:
    of calls that were watched while they ran.
    """

    program: Program
    tables: Mapping[str, Table]
    steps: Mapping[str, Steps]
    deadline: Deadline
    inputs: Mapping[str, Any]
    shares: Mapping[str, float]
    planned: Mapping[str, float]
    unwanted: frozenset[str]
    thrifty: bool = False
    rng: np.random.Generator | None = None
    interrupted: Callable[[], bool] = lambda: False
    on_result: Listener | None = None
    decide: Shares | None = None
    parts: dict[str, Result] = field(default_factory=dict[str, Result])
    memory: Memory = field(default_factory=dict[str, dict[str, Any]])
    granted: dict[str, float] = field(default_factory=dict[str, float])
    watches: dict[str, Watch] = field(default_factory=dict[str, Watch])

    def __post_init__(self) -> None:
        self.started = self.deadline.clock.now()
        self._skipped = set(self.unwanted)
        self._waits: dict[str, float] = {}  # seconds for which arms before it have its processor
        self._due = due(self.program)
        self._joins = [
            (node, only_for(self.program, node))
            for node in self.program.nodes
            if isinstance(node, Join)
        ]
        self._settle()

    def stages(self) -> Iterator[tuple[str, Result]]:
        """Run call after call and yield (label, result), until the output cannot come any more."""
        for call in self.program.calls:
            if not self._wanted(call):
                continue
            yield from self._next(call, self.deadline.clock)
            if self.interrupted() or not self._possible(self.program.output):
                return

    def known(self, node: object) -> Known | None:
        """What there is of a node by now."""
        return known_of(node, self.parts, self.inputs)

    def _everything(self) -> dict[str, Known]:
        """All that is known, by label; an input's label is its name after "input"."""
        nodes = {node.label: self.known(node) for node in self.program.nodes}
        given = {f"input {name}": Known(value) for name, value in self.inputs.items()}
        return given | {label: known for label, known in nodes.items() if known is not None}

    def _one(self, call: Call, clock: Clock, behind: float) -> list[tuple[str, Result]]:
        found = [self.known(argument) for argument in call.arguments]
        if any(argument is None for argument in found):
            self._skipped.add(call.label)  # what it needs never came, or is of an arm not taken
            return []
        share = None
        if self.decide is not None and call.label not in self.granted:
            share = self._decided([call.label])[call.label]
            if call.label in self._skipped:
                return []
        hard, ends, held = self._limits(call, clock, behind, share)
        own = replace(self.deadline, clock=clock, at=hard if held else ends)
        observe = None if self.on_result is None else partial(self.on_result, call.label)
        if share is not None and share.watched:
            watch = self.watches[call.label] = Watch(share, clock, observe)
            own, observe = own.earlier(Deadline(clock, event=watch.over)), watch.observe
        may_step = held or Run.may_step
        self.parts[call.label], _ = execute(
            call.module,
            tuple(argument.value for argument in found if argument is not None),
            own,
            rng=self.rng,
            memory=self.memory.setdefault(call.label, {})
            if "memory" in call.module.filled
            else None,
            may_step=lambda run: not self.interrupted() and may_step(run),
            observe=observe,
        )
        self._settle()
        return [(call.label, self.parts[call.label])]

    def _limits(
        self, call: Call, clock: Clock, behind: float, share: Share | None
    ) -> tuple[float, float, Callable[[Run], bool] | None]:
        """The latest that a call may end, the end of its share, and its guard, if it has one."""
        now, latest = clock.now(), self.deadline.at
        # Other arms of its groups are run beside it, or not at all; what follows both waits.
        rest = [
            other
            for other in self.program.calls
            if other is not call
            and self._wanted(other)
            and not apart(self.tables[other.label].path, self.tables[call.label].path)
        ]
        hard = latest - self._first(list(filter(self._surely, rest))) - behind
        hard = min(hard, self._due_of(call))
        ends = now + share.seconds if share else self._planned_end(call)
        known, guarded = self.steps.get(call.module.name), call.module.generator
        guarded = guarded and not call.module.contract
        if not rest and not behind:
            ends = min(ends, latest) if share or self.thrifty else latest
            ends = min(ends, self._due_of(call))
            return ends, ends, last_guard(known, ends) if guarded else None
        ends = min(ends, latest)
        held = guard(known, ends, hard) if guarded else None
        if not held:
            # A share that others have used up still leaves time for a first result.
            ends = max(ends, min(now + self.tables[call.label].first, hard))
        # A generator with a guard is held to its share by it, the others by their deadline.
        return hard, ends, held

    def _due_of(self, call: Call) -> float:
        return self.started + self._due.get(call.label, np.inf)

    def _planned_end(self, call: Call) -> float:
        return self.started + self.planned[call.label] + self._waits.get(call.label, 0.0)

    def _next(
        self, call: Call, clock: Clock, within: str = "", behind: float = 0.0
    ) -> list[tuple[str, Result]]:
        """Run a call, or the parallel that it begins. within: the group that is being run.
        behind: seconds that other arms which wait for its processor need."""
        arms = [arm for arm in self.tables[call.label].path if arm.processors]
        inner = arms[[arm.group for arm in arms].index(within) + 1 if within else 0 :]
        if inner:
            return self._at_once(inner[0], clock, behind)
        return self._one(call, clock, behind)

    def _at_once(self, parallel: Arm, clock: Clock, behind: float) -> list[tuple[str, Result]]:
        """The arms of a parallel, each processor one after the other those that it is given."""
        self._decide_all(parallel.group, clock)
        arms = self._arms(parallel.group)
        if not arms:
            return []  # a policy passes over all of it
        spent = [_least({c.label: self.tables[c.label] for c in arm}, self.shares) for arm in arms]
        queues: list[list[Call]] = []
        for block in costs.assignment(spent, parallel.processors):
            queues.append([call for place in block for call in arms[place]])
            for position, place in enumerate(block):
                waits = sum(spent[before] for before in block[:position])
                for call in arms[place]:
                    self._waits[call.label] = self._waits.get(call.label, 0.0) + waits
        if isinstance(clock, WorkClock):
            made: list[tuple[str, Result]] = []
            latest = clock.now()
            for queue in queues:  # nothing runs in threads: each has a clock that starts now
                own = WorkClock(clock.machine, clock.now())
                made += self._queue(queue, own, parallel.group, behind)
                latest = max(latest, own.now())
            clock.advance(latest - clock.now())
            return made
        with ThreadPoolExecutor(len(queues)) as pool:
            ran = pool.map(lambda queue: self._queue(queue, clock, parallel.group, behind), queues)
            return [pair for pairs in ran for pair in pairs]

    def _arms(self, group: str) -> list[list[Call]]:
        """What is to be run of each arm of a group."""
        arms: dict[int, list[Call]] = {}
        for call in self.program.calls:
            for arm in self.tables[call.label].path:
                if arm.group == group and self._wanted(call):
                    arms.setdefault(arm.index, []).append(call)
        return list(arms.values())

    def _decide_all(self, group: str, clock: Clock) -> None:
        """Where a policy decides, the shares of a parallel that begins and stands in no other."""
        labels = [call.label for arm in self._arms(group) for call in arm]
        if self.decide is None or labels[0] in self.granted:
            return
        decided = {label: share.seconds for label, share in self._decided(labels).items()}
        self.shares = {**self.shares, **decided}
        began = clock.now() - self.started
        ends = planned([self.tables[label] for label in labels], decided)
        self.planned = {**self.planned, **{label: began + end for label, end in ends.items()}}

    def _decided(self, labels: Sequence[str]) -> dict[str, Share]:
        """What a policy gives calls that are about to start; those that it passes over are
        skipped."""
        assert self.decide is not None
        left, known = self.deadline.remaining(), self._everything()
        shares = {label: self.decide(label, left, known) for label in labels}
        seconds = {label: share.seconds for label, share in shares.items()}
        self.granted |= seconds
        tables = [self.tables[label] for label in labels]
        self._skipped |= unwanted(self.program, tables, seconds, self._skipped)
        return shares

    def _queue(
        self, calls: Sequence[Call], clock: Clock, group: str, behind: float
    ) -> list[tuple[str, Result]]:
        """The arms of a parallel that one processor runs."""
        made: list[tuple[str, Result]] = []
        for place, call in enumerate(calls):
            if self._wanted(call):
                arms: dict[Arm, list[Call]] = {}
                for other in filter(self._wanted, calls[place + 1 :]):
                    arms.setdefault(self._arm(other, group), []).append(other)
                arms.pop(self._arm(call, group), None)
                waiting = sum(self._first(arm) for arm in arms.values())
                made += self._next(call, clock, group, behind + waiting)
        return made

    def _first(self, calls: Sequence[Call]) -> float:
        """Seconds until each of these calls has a first result."""
        first = {call.label: self.tables[call.label].first for call in calls}
        return _least(self.tables, first)

    def _arm(self, call: Call, group: str) -> Arm:
        return next(arm for arm in self.tables[call.label].path if arm.group == group)

    def _wanted(self, call: Call) -> bool:
        return call.label not in self.parts and call.label not in self._skipped

    def _surely(self, call: Call) -> bool:
        """Whether a call that is to come is needed, whatever a policy says."""
        decided = self.decide is None or call.label in self.granted
        return decided or not _without(self.program, self._skipped | {call.label})

    def _settle(self) -> None:
        """Pass over what no join needs any more."""
        for join, private in self._joins:
            known = [self.known(argument) for argument in join.arguments]
            for place in join.rule.unneeded(known):
                self._skipped |= private[place] - self.parts.keys()

    def _possible(self, node: object) -> bool:
        """Whether there is, or still may be, a result of a node."""
        if isinstance(node, Join):
            known = [self.known(argument) for argument in node.arguments]
            settled, tests = node.rule.unneeded(known), node.rule.tests
            there = [
                place in tests if place in settled else self._possible(argument)
                for place, argument in enumerate(node.arguments)
            ]
            return _may_come(node.rule, there)
        if not isinstance(node, Call):
            return True
        if node.label in self.parts:
            return bool(self.parts[node.label])
        return node.label not in self._skipped and all(map(self._possible, node.arguments))


def known_of(node: object, parts: Mapping[str, Result], inputs: Mapping[str, Any]) -> Known | None:
    """What there is of a node, from the results of calls by label and the program's inputs."""
    if isinstance(node, Input):
        return Known(inputs[node.name])
    if isinstance(node, Constant):
        return Known(node.value)
    if isinstance(node, Join):
        return node.rule.value([known_of(each, parts, inputs) for each in node.arguments])
    assert isinstance(node, Call)
    result = parts.get(node.label)
    if not result:
        return None
    return Known(result.value, result.history[-1].estimate if result.history else None)


def unwanted(
    program: Program,
    tables: Sequence[Table],
    shares: Mapping[str, float],
    missing: Collection[str] = (),
) -> frozenset[str]:
    """Calls that are given no time, have no result without, and are not needed for the output.

    tables: of the calls in question. missing: calls that are not run anyway.
    """
    found = set(missing)
    for table in tables:
        if table.rule is not None or not costs.idle(table, shares[table.label]):
            continue
        if _without(program, found | {table.label}):
            found.add(table.label)
    return frozenset(found)


def planned(tables: Sequence[Table], shares: Mapping[str, float]) -> dict[str, float]:
    """For each call, seconds from the start of the program until its share ends."""
    calls = [table for table in tables if table.rule is None]
    if not any(table.path for table in calls):
        ends = np.cumsum([shares[table.label] for table in calls])
        return dict(zip((table.label for table in calls), ends.tolist(), strict=True))
    found: dict[str, float] = {}
    for place, table in enumerate(calls):
        before = [t for t in calls[: place + 1] if not apart(t.path, table.path)]
        found[table.label] = _least({t.label: t for t in before}, shares)
    return found


def _least(tables: Mapping[str, Table], seconds: Mapping[str, float]) -> float:
    counted = [table for label, table in tables.items() if label in seconds]
    if not any(table.path for table in counted):
        return sum(seconds[table.label] for table in counted)
    return float(costs.total(counted, [np.asarray(seconds[t.label]) for t in counted]))


def _without(program: Program, missing: Collection[str]) -> bool:
    """Whether the output may come without these calls."""

    def may(node: object) -> bool:
        if isinstance(node, Join):
            return _may_come(node.rule, [may(argument) for argument in node.arguments])
        if not isinstance(node, Call):
            return True
        return node.label not in missing and all(map(may, node.arguments))

    return may(program.output)


def _may_come(rule: Rule, there: Sequence[bool]) -> bool:
    outcome = rule.outcome([1.0 if one else None for one in there])
    return any(chance > 0 and quality is not None for chance, quality in outcome)


def status_of(output: Known | None, parts: Mapping[str, Result]) -> Status:
    """What a program has to show: complete when each part that was run is."""
    if output is None:
        return Status.NO_RESULT
    complete = all(part.status is Status.COMPLETE for part in parts.values())
    return Status.COMPLETE if complete else Status.INTERRUPTED
