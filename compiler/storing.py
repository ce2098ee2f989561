"""Compiled programs written to files: what a file holds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from anytime.errors import AnytimeError
from anytime.files import Stored, write_record
from anytime.joins import Best, Branch, Rule, Several, Tests, Until
from anytime.programs import Call, Input, Join, Program
from compiler.calibrating import Calibration
from compiler.division import Frontier
from compiler.guarding import Steps
from compiler.objectives import Objective
from compiler.policies import Policy
from compiler.tables import Table

SCHEMA = "anytime.schedule/5"


class StoredArgument(Stored):
    input: str | None = None
    node: str | None = None
    constant: float | int | str | bool | None = None


class StoredRule(Stored):
    """A rule by its kind and what it is made with; the rest is left out."""

    kind: str
    everyone: bool | None = None
    wrong: float | None = None
    quality: float | None = None
    compare: bool | None = None
    chances: list[float] | None = None
    weights: list[float] | None = None
    deadlines: list[float | None] | None = None


class StoredNode(Stored):
    """A call of a module, or a join by a rule: one of the two is there."""

    label: str
    arguments: list[StoredArgument]
    module: str | None = None
    parameters: list[str] | None = None
    rule: StoredRule | None = None


class StoredSteps(Stored):
    median: list[float]
    p95: list[float]
    spread: float
    whole: bool


class StoredParallel(Stored):
    labels: list[str]
    processors: int


class StoredCourses(Stored):
    """Of each run its level at each moment, and how much it counts for each levels of inputs."""

    levels: list[list[int]]
    weights: list[list[float]]


class StoredTable(Stored):
    label: str
    module: str
    feeds: list[str]
    levels: list[float]
    times: list[float]
    shape: list[int]
    chances: list[float]
    first: float
    courses: StoredCourses | None = None


class StoredSchedule(Stored):
    name: str
    inputs: list[str]
    machine: str
    nodes: list[StoredNode]
    parallels: list[StoredParallel]
    objective: tuple[str, float]
    tables: list[StoredTable]
    budgets: list[float]
    shares: list[list[float]]
    promised: list[float]
    exact: bool
    calibration: list[tuple[float, float, float, float]]
    steps: dict[str, StoredSteps]
    regret: float
    seen: dict[str, list[list[float]]] | None


class Compiled(Protocol):
    """What a file holds of a compiled program."""

    @property
    def program(self) -> Program: ...
    @property
    def tables(self) -> Sequence[Table]: ...
    @property
    def frontier(self) -> Frontier: ...
    @property
    def calibration(self) -> Calibration: ...
    @property
    def steps(self) -> Mapping[str, Steps]: ...
    @property
    def machine(self) -> str: ...
    @property
    def regret(self) -> float: ...
    @property
    def objective(self) -> Objective: ...
    @property
    def policy(self) -> Policy | None: ...


def save(compiled: Compiled, path: Path) -> None:
    """Write a compiled program; of a policy, what it is made from.

    Raises AnytimeError for what no file holds: a constant that is no number or text, a utility.
    """
    frontier, policy = compiled.frontier, compiled.policy
    seen = None
    if policy is not None:
        seen = {name: [at.tolist(), is_.tolist()] for name, (at, is_) in policy.seen.items()}
    if not compiled.objective.timeless:
        raise AnytimeError(
            f"{compiled.program.name!r} is compiled for a utility, a function, which a file cannot "
            "hold; compile it where it is used"
        )
    record = StoredSchedule(
        name=compiled.program.name,
        inputs=list(compiled.program.inputs),
        machine=compiled.machine,
        nodes=[_store_node(node) for node in compiled.program.nodes],
        parallels=[
            StoredParallel(labels=list(p.labels), processors=p.processors)
            for p in compiled.program.parallels
        ],
        objective=(compiled.objective.kind, compiled.objective.parameter),
        tables=[
            _store_table(table, policy is not None and table.label in policy.watched)
            for table in compiled.tables
            if table.rule is None
        ],
        budgets=frontier.budgets.tolist(),
        shares=frontier.shares.tolist(),
        promised=frontier.promised.tolist(),
        exact=frontier.exact,
        calibration=compiled.calibration.rows(),
        steps={
            name: StoredSteps(
                median=list(s.median), p95=list(s.p95), spread=s.spread, whole=s.whole
            )
            for name, s in compiled.steps.items()
        },
        regret=compiled.regret,
        seen=seen,
    )
    write_record(path, SCHEMA, record)


def _store_node(node: Call | Join) -> StoredNode:
    arguments: list[StoredArgument] = []
    for argument in node.arguments:
        if isinstance(argument, Input):
            arguments.append(StoredArgument(input=argument.name))
        elif isinstance(argument, Call | Join):
            arguments.append(StoredArgument(node=argument.label))
        elif isinstance(argument.value, float | int | str | bool | None):
            arguments.append(StoredArgument(constant=argument.value))
        else:
            raise AnytimeError(
                f"{node!r} has a constant of type {type(argument.value).__name__}, which a file "
                "cannot hold; make it an input of the program"
            )
    if isinstance(node, Join):
        return StoredNode(label=node.label, arguments=arguments, rule=_store_rule(node.rule))
    return StoredNode(
        label=node.label,
        arguments=arguments,
        module=node.module.name,
        parameters=list(node.module.parameters),
    )


def _store_rule(rule: Rule) -> StoredRule:
    match rule:
        case Branch():
            return StoredRule(
                kind=rule.kind,
                chances=list(rule.chances),
                wrong=rule.wrong,
                everyone=rule.everyone,
            )
        case Best():
            return StoredRule(kind=rule.kind, compare=rule.compare)
        case Until():
            return StoredRule(kind=rule.kind, quality=rule.quality)
        case Tests():
            return StoredRule(kind=rule.kind, chances=list(rule.chances))
        case Several():
            deadlines = [None if math.isinf(at) else at for at in rule.deadlines]
            return StoredRule(kind=rule.kind, weights=list(rule.weights), deadlines=deadlines)


def _store_table(table: Table, watched: bool) -> StoredTable:
    """A table, with the runs that it counts where a policy watches them."""
    courses = None
    if watched and table.courses is not None:
        runs = table.courses.levels
        weights = table.courses.weights.reshape(-1, len(runs))
        courses = StoredCourses(
            levels=runs.tolist(),
            weights=[[float(f"{weight:.9g}") for weight in row] for row in weights],
        )
    return StoredTable(
        label=table.label,
        module=table.module,
        feeds=list(table.feeds),
        levels=table.levels.tolist(),
        times=table.times.tolist(),
        shape=list(table.chances.shape),
        chances=[float(f"{chance:.9g}") for chance in table.chances.ravel()],
        first=table.first,
        courses=courses,
    )
