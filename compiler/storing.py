"""Compiled programs written to files: what a file holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from anytime.errors import AnytimeError
from anytime.files import Stored, write_record
from anytime.programs import Call, Input, Program
from compiler.division import Frontier
from compiler.guarding import Steps
from compiler.intervals import Interval
from compiler.tables import Table

SCHEMA = "anytime.schedule/1"


class StoredArgument(Stored):
    input: str | None = None
    call: str | None = None
    constant: float | int | str | bool | None = None


class StoredCall(Stored):
    label: str
    module: str
    parameters: list[str]
    arguments: list[StoredArgument]


class StoredTable(Stored):
    label: str
    module: str
    feeds: list[str]
    levels: list[float]
    times: list[float]
    shape: list[int]
    chances: list[float]
    first: float


class StoredSchedule(Stored):
    name: str
    inputs: list[str]
    machine: str
    calls: list[StoredCall]
    tables: list[StoredTable]
    budgets: list[float]
    shares: list[list[float]]
    promised: list[float]
    intervals: list[tuple[float, float, float]]
    steps: dict[str, list[list[float]]]


class Compiled(Protocol):
    """What a file holds of a compiled program."""

    @property
    def program(self) -> Program: ...
    @property
    def tables(self) -> Sequence[Table]: ...
    @property
    def frontier(self) -> Frontier: ...
    @property
    def intervals(self) -> Sequence[Interval]: ...
    @property
    def steps(self) -> Mapping[str, Steps]: ...
    @property
    def machine(self) -> str: ...


def save(compiled: Compiled, path: Path) -> None:
    """Write a compiled program. Raises AnytimeError for constants that no file holds."""
    frontier = compiled.frontier
    record = StoredSchedule(
        name=compiled.program.name,
        inputs=list(compiled.program.inputs),
        machine=compiled.machine,
        calls=[_store_call(call) for call in compiled.program.calls],
        tables=[_store_table(table) for table in compiled.tables],
        budgets=frontier.budgets.tolist(),
        shares=frontier.shares.tolist(),
        promised=frontier.promised.tolist(),
        intervals=[(i.seconds, i.low, i.high) for i in compiled.intervals],
        steps={name: [list(s.median), list(s.p95)] for name, s in compiled.steps.items()},
    )
    write_record(path, SCHEMA, record)


def _store_call(call: Call) -> StoredCall:
    arguments: list[StoredArgument] = []
    for argument in call.arguments:
        if isinstance(argument, Input):
            arguments.append(StoredArgument(input=argument.name))
        elif isinstance(argument, Call):
            arguments.append(StoredArgument(call=argument.label))
        elif isinstance(argument.value, float | int | str | bool | None):
            arguments.append(StoredArgument(constant=argument.value))
        else:
            raise AnytimeError(
                f"{call!r} has a constant of type {type(argument.value).__name__}, which a file "
                "cannot hold; make it an input of the program"
            )
    return StoredCall(
        label=call.label,
        module=call.module.name,
        parameters=list(call.module.parameters),
        arguments=arguments,
    )


def _store_table(table: Table) -> StoredTable:
    return StoredTable(
        label=table.label,
        module=table.module,
        feeds=list(table.feeds),
        levels=table.levels.tolist(),
        times=table.times.tolist(),
        shape=list(table.chances.shape),
        chances=[float(f"{chance:.9g}") for chance in table.chances.ravel()],
        first=table.first,
    )
