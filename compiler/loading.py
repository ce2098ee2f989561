"""Compiled programs read from files. A file names its modules and never imports them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from anytime.errors import AnytimeError
from anytime.files import read_record
from anytime.modules import Module
from anytime.programs import Call, Constant, Input, Program, upstream
from compiler.compiled import CompiledProgram
from compiler.division import Frontier
from compiler.guarding import Steps
from compiler.intervals import Interval
from compiler.storing import SCHEMA, StoredSchedule, StoredTable
from compiler.tables import Table


def load(path: str | Path, modules: Sequence[Module]) -> CompiledProgram:
    """Read a compiled program and bind its calls to these modules by name.

    Raises AnytimeError for a broken file, for a module that is missing or has other parameters.
    """
    file = Path(path)
    return _restore(file, read_record(file, SCHEMA, StoredSchedule), modules)


def inspect(path: str | Path) -> CompiledProgram:
    """Read a compiled program to look at: its calls are bound to modules that cannot run."""
    file = Path(path)
    stored = read_record(file, SCHEMA, StoredSchedule)
    modules = {
        call.module: Module(call.module, _cannot_run, tuple(call.parameters))
        for call in stored.calls
    }
    return _restore(file, stored, list(modules.values()))


def _cannot_run(*inputs: object) -> None:
    raise AnytimeError(
        "this program was read to be looked at; compiler.load(…, modules=[…]) runs it"
    )


def _restore(file: Path, stored: StoredSchedule, modules: Sequence[Module]) -> CompiledProgram:
    program = _bind(file, stored, {module.name: module for module in modules})
    made = tuple(_restore_table(file, table) for table in stored.tables)
    _check_tables(file, program, made)
    _check_divisions(file, stored)
    return CompiledProgram(
        program=program,
        tables=made,
        frontier=Frontier(
            np.array(stored.budgets),
            np.array(stored.shares).reshape(len(stored.budgets), len(made)),
            np.array(stored.promised),
        ),
        intervals=tuple(Interval(*row) for row in stored.intervals),
        steps={name: Steps(tuple(rows[0]), tuple(rows[1])) for name, rows in stored.steps.items()},
        machine=stored.machine,
    )


def _bind(path: Path, stored: StoredSchedule, modules: dict[str, Module]) -> Program:
    calls: dict[str, Call] = {}
    for record in stored.calls:
        if record.label in calls:
            raise AnytimeError(f"{path}: two calls have the label {record.label!r}")
        if len(record.arguments) != len(record.parameters):
            raise AnytimeError(f"{path}: {record.label} has not one argument for each parameter")
        module = modules.get(record.module)
        if module is None:
            raise AnytimeError(
                f"{path} calls the module {record.module!r}, which is not among modules=[…] "
                f"({', '.join(modules) or 'none'})"
            )
        if list(module.parameters) != record.parameters:
            raise AnytimeError(
                f"{path} was compiled for {record.module}({', '.join(record.parameters)}); "
                f"the module given takes ({', '.join(module.parameters)}). Compile it again"
            )
        arguments: list[Input | Constant | Call] = []
        for argument in record.arguments:
            if argument.input is not None:
                if argument.input not in stored.inputs:
                    raise AnytimeError(f"{path}: the program has no input {argument.input!r}")
                arguments.append(Input(argument.input))
            elif argument.call is None:
                arguments.append(Constant(argument.constant))
            elif argument.call in calls:
                arguments.append(calls[argument.call])
            else:
                raise AnytimeError(f"{path}: {record.label} uses {argument.call!r} before its call")
        calls[record.label] = Call(module, tuple(arguments), record.label)
    if not calls:
        raise AnytimeError(f"{path}: has no calls; a program has at least one")
    return Program(
        stored.name, tuple(stored.inputs), tuple(calls.values()), list(calls.values())[-1]
    )


def _restore_table(path: Path, record: StoredTable) -> Table:
    def refuse(reason: str) -> AnytimeError:
        return AnytimeError(f"{path}: table {record.label}: {reason}")

    times, levels = np.array(record.times, dtype=float), np.array(record.levels, dtype=float)
    if not len(times) or times[0] != 0 or (np.diff(times) <= 0).any():
        raise refuse("times must increase from 0")
    if not len(levels) or levels[0] != 0 or levels.min() < 0 or levels.max() > 1:
        raise refuse("levels must begin with 0, for no result, and lie in [0, 1]")
    if record.first < 0:
        raise refuse("the time of the first result is negative")
    if record.shape[-2:] != [len(times), len(levels)] or min(record.shape) < 1:
        raise refuse("shape does not fit times and levels")
    if math.prod(record.shape) != len(record.chances):
        raise refuse(f"chances do not fill shape {record.shape}")
    chances = np.array(record.chances, dtype=float).reshape(record.shape)
    if chances.min() < -1e-9 or (np.abs(chances.sum(axis=-1) - 1) > 1e-6).any():
        raise refuse("chances must be >= 0 and sum to 1 over the levels")
    return Table(
        record.label, record.module, tuple(record.feeds), levels, times, chances, record.first
    )


def _check_tables(path: Path, program: Program, tables: Sequence[Table]) -> None:
    if [(t.label, t.module) for t in tables] != [(c.label, c.module.name) for c in program.calls]:
        raise AnytimeError(f"{path}: its tables are not those of its calls")
    levels = {table.label: len(table.levels) for table in tables}
    for call, table in zip(program.calls, tables, strict=True):
        feeds = tuple(source.label for source in upstream(call).values())
        if table.feeds != feeds or table.chances.shape[:-2] != tuple(levels[f] for f in feeds):
            raise AnytimeError(f"{path}: table {table.label} does not fit the calls that feed it")


def _check_divisions(path: Path, stored: StoredSchedule) -> None:
    count = len(stored.budgets)
    if not count or len(stored.shares) != count or len(stored.promised) != count:
        raise AnytimeError(f"{path}: budgets, shares and promised differ in length or are empty")
    if any(len(row) != len(stored.tables) for row in stored.shares):
        raise AnytimeError(f"{path}: a row of shares has not one share for each call")
    budgets, shares = np.array(stored.budgets, dtype=float), np.array(stored.shares, dtype=float)
    if budgets[0] < 0 or (np.diff(budgets) <= 0).any():
        raise AnytimeError(f"{path}: budgets must increase and be >= 0")
    if shares.min() < 0 or (shares.sum(axis=1) > budgets * (1 + 1e-9) + 1e-9).any():
        raise AnytimeError(f"{path}: shares must be >= 0 and sum to no more than their budget")
    promised = np.array(stored.promised, dtype=float)
    if promised[0] < 0 or promised[-1] > 1 + 1e-6 or (np.diff(promised) < 0).any():
        raise AnytimeError(f"{path}: promised qualities must lie in [0, 1] and not decrease")
    if not stored.intervals or any(low > high for _, low, high in stored.intervals):
        raise AnytimeError(f"{path}: intervals are missing, or one has its low end above its high")
    if any(a >= b for (a, *_), (b, *_) in pairwise(stored.intervals)):
        raise AnytimeError(f"{path}: the budgets of intervals must increase")
    for name, rows in stored.steps.items():
        if (
            len(rows) != 2
            or len(rows[0]) != len(rows[1])
            or min([*rows[0], *rows[1]], default=0) < 0
        ):
            raise AnytimeError(f"{path}: steps.{name} is not two rows of seconds >= 0")
