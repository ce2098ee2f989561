"""Compiled programs read from files. A file names its modules and never imports them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from anytime.errors import AnytimeError
from anytime.files import read_record
from anytime.joins import Best, Branch, Rule, Several, Tests, Until
from anytime.modules import Module
from anytime.programs import Call, Constant, Input, Join, Parallel, Program, upstream
from anytime.structure import behind, groups, paths
from compiler import costs
from compiler.adaptive import adapt
from compiler.calibrating import Calibration
from compiler.compiled import CompiledProgram
from compiler.division import Floats, Frontier
from compiler.guarding import Steps
from compiler.objectives import EXPECTED, Objective, at_least, cvar, quantile
from compiler.policies import Seen
from compiler.storing import SCHEMA, StoredNode, StoredRule, StoredSchedule, StoredTable
from compiler.tables import Courses, Table, table_of


def load(path: str | Path, modules: Sequence[Module]) -> CompiledProgram:
    """Read a compiled program and bind its calls to these modules by name.

    Raises AnytimeError for a broken file, for a module that is missing or has other parameters.
    """
    file = Path(path)
    for module in modules:
        if not isinstance(module, Module):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(f"modules holds {module!r}; give the modules that the program calls")
    return _restore(file, read_record(file, SCHEMA, StoredSchedule), modules)


def inspect(path: str | Path) -> CompiledProgram:
    """Read a compiled program to look at: its calls are bound to modules that cannot run."""
    file = Path(path)
    stored = read_record(file, SCHEMA, StoredSchedule)
    modules = {
        node.module: Module(node.module, _cannot_run, tuple(node.parameters or ()))
        for node in stored.nodes
        if node.module is not None
    }
    return _restore(file, stored, list(modules.values()))


def _cannot_run(*inputs: object) -> None:
    raise AnytimeError(
        "this program was read to be looked at; compiler.load(…, modules=[…]) runs it"
    )


def _restore(file: Path, stored: StoredSchedule, modules: Sequence[Module]) -> CompiledProgram:
    program = _bind(
        file, stored, {each.name: each for module in modules for each in module.settings()}
    )
    made = _tables(file, program, [_restore_table(file, table) for table in stored.tables])
    _check_divisions(file, stored, made)
    objective = _restore_objective(file, *stored.objective)
    frontier = Frontier(
        np.array(stored.budgets),
        np.array(stored.shares).reshape(len(stored.budgets), len(made)),
        np.array(stored.promised),
        stored.exact,
    )
    policy = None
    if stored.seen is not None:
        seen = {name: _restore_seen(file, name, rows) for name, rows in stored.seen.items()}
        policy = adapt(program, made, seen, frontier, objective)
    return CompiledProgram(
        program=program,
        tables=made,
        objective=objective,
        frontier=frontier,
        policy=policy,
        calibration=Calibration(*np.array(stored.calibration).T),
        steps={
            name: Steps(tuple(known.median), tuple(known.p95), known.spread, known.whole)
            for name, known in stored.steps.items()
        },
        machine=stored.machine,
        regret=stored.regret,
    )


def _bind(path: Path, stored: StoredSchedule, modules: dict[str, Module]) -> Program:
    nodes: dict[str, Call | Join] = {}
    for record in stored.nodes:
        if record.label in nodes:
            raise AnytimeError(f"{path}: two nodes have the label {record.label!r}")
        arguments: list[Input | Constant | Call | Join] = []
        for argument in record.arguments:
            if argument.input is not None:
                if argument.input not in stored.inputs:
                    raise AnytimeError(f"{path}: the program has no input {argument.input!r}")
                arguments.append(Input(argument.input))
            elif argument.node is None:
                arguments.append(Constant(argument.constant))
            elif argument.node in nodes:
                arguments.append(nodes[argument.node])
            else:
                raise AnytimeError(f"{path}: {record.label} uses {argument.node!r} before its call")
        if (record.module is None) == (record.rule is None):
            raise AnytimeError(f"{path}: {record.label} is neither a call nor a join")
        if record.rule is not None:
            nodes[record.label] = _join(path, record.label, record.rule, arguments)
        else:
            module = _module(path, record, modules)
            nodes[record.label] = Call(module, tuple(arguments), record.label)
    if not any(isinstance(node, Call) for node in nodes.values()):
        raise AnytimeError(f"{path}: has no calls; a program has at least one")
    for parallel in stored.parallels:
        if parallel.processors < 1 or set(parallel.labels) - set(nodes):
            raise AnytimeError(f"{path}: a parallel has no processor or names what is not there")
    program = Program(
        stored.name,
        tuple(stored.inputs),
        tuple(nodes.values()),
        list(nodes.values())[-1],
        tuple(Parallel(tuple(p.labels), p.processors) for p in stored.parallels),
    )
    unused = set(nodes.values()) - behind(program.output)
    if unused:
        raise AnytimeError(f"{path}: the result of {unused.pop().label} is never used")
    try:
        groups(program)
    except AnytimeError as error:
        raise AnytimeError(f"{path}: {error}") from None
    return program


def _module(path: Path, record: StoredNode, modules: dict[str, Module]) -> Module:
    parameters = record.parameters or []
    if len(record.arguments) != len(parameters):
        raise AnytimeError(f"{path}: {record.label} has not one argument for each parameter")
    module = modules.get(record.module or "")
    if module is None:
        raise AnytimeError(
            f"{path} calls the module {record.module!r}, which is not among modules=[…] "
            f"({', '.join(modules) or 'none'})"
        )
    if list(module.parameters) != parameters:
        raise AnytimeError(
            f"{path} was compiled for {record.module}({', '.join(parameters)}); "
            f"the module given takes ({', '.join(module.parameters)}). Compile it again"
        )
    return module


def _join(path: Path, label: str, record: StoredRule, arguments: Sequence[object]) -> Join:
    chances = len(record.chances or ())
    takes = {
        "branch": chances + 2,
        "all_of": chances,
        "any_of": chances,
        "several": len(record.weights or ()),
    }.get(record.kind, 2)
    sources = tuple(a for a in arguments if isinstance(a, Input | Call | Join))
    try:
        rule = _rule(record)
    except (AnytimeError, TypeError, ValueError) as error:
        raise AnytimeError(f"{path}: {label}: {error}") from None
    passed = [a for i, a in enumerate(sources) if i not in rule.tests]
    if len(sources) != takes or not takes or any(isinstance(a, Input) for a in passed):
        raise AnytimeError(f"{path}: {label} has not the arguments of its kind, {record.kind}")
    return Join(rule, sources, label)


def _rule(record: StoredRule) -> Rule:
    def number(value: float | None) -> float:
        if value is None:
            raise AnytimeError(f"a rule of the kind {record.kind!r} misses a number")
        return value

    match record.kind:
        case "branch":
            return Branch(tuple(record.chances or ()), number(record.wrong), bool(record.everyone))
        case "choose":
            return Best(bool(record.compare))
        case "until":
            return Until(number(record.quality))
        case "all_of" | "any_of":
            return Tests(tuple(record.chances or ()), record.kind == "all_of")
        case "several":
            deadlines = [math.inf if at is None else at for at in record.deadlines or ()]
            return Several(tuple(record.weights or ()), tuple(deadlines))
        case _:
            raise AnytimeError(f"no rule is of the kind {record.kind!r}")


def _restore_objective(path: Path, kind: str, parameter: float) -> Objective:
    makers = {"at_least": at_least, "quantile": quantile, "cvar": cvar}
    if kind == "expected":
        return EXPECTED
    if kind not in makers:
        raise AnytimeError(f"{path}: no objective is of the kind {kind!r}")
    try:
        return makers[kind](parameter)
    except AnytimeError as error:
        raise AnytimeError(f"{path}: {error}") from None


def _restore_seen(path: Path, name: str, rows: list[list[float]]) -> Seen:
    if len(rows) != 2 or not rows[0] or len(rows[0]) != len(rows[1]):
        raise AnytimeError(f"{path}: seen.{name} is not two rows of as many numbers")
    if any(later <= before for before, later in pairwise(rows[0])):
        raise AnytimeError(f"{path}: the estimates in seen.{name} must increase")
    if not 0 <= min(rows[1]) <= max(rows[1]) <= 1 + 1e-9:
        raise AnytimeError(f"{path}: the qualities in seen.{name} must lie in [0, 1]")
    return np.array(rows[0]), np.array(rows[1])


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
        record.label,
        record.module,
        tuple(record.feeds),
        levels,
        times,
        chances,
        record.first,
        courses=_courses(record, chances, refuse),
    )


def _courses(
    record: StoredTable, chances: Floats, refuse: Callable[[str], AnytimeError]
) -> Courses | None:
    if record.courses is None:
        return None
    moments, count = chances.shape[-2:]
    rows, cells = record.courses.levels, record.courses.weights
    if not rows or any(
        len(row) != moments or not 0 <= min(row) <= max(row) < count for row in rows
    ):
        raise refuse("the levels of its runs are not one for each moment, of those it has")
    if len(cells) != math.prod(record.shape[:-2]) or any(len(row) != len(rows) for row in cells):
        raise refuse("the weights of its runs are not one for each run and input")
    levels = np.array(rows, dtype=np.intp)
    weights = np.array(cells, dtype=float).reshape(*chances.shape[:-2], len(rows))
    counted = np.stack([weights @ (levels == level) for level in range(1, count)], axis=-1)
    if weights.min() < 0 or np.abs(counted - chances[..., 1:]).max() > 1e-6:
        raise refuse("its chances are not those of its runs")
    return Courses(levels, weights)


def _tables(path: Path, program: Program, stored: Sequence[Table]) -> tuple[Table, ...]:
    """The tables of all nodes: those of calls as they are stored, those of joins by their rules."""
    calls = {call.label: call.module.name for call in program.calls}
    if {t.label: t.module for t in stored} != calls or len(stored) != len(calls):
        raise AnytimeError(f"{path}: its tables are not those of its calls")
    by_label = {table.label: table for table in stored}
    arms = paths(program)
    made: dict[str, Table] = {}
    for node in program.nodes:
        if isinstance(node, Join):
            made[node.label] = table_of(node, made, output=node is program.output)
            continue
        table = by_label[node.label]
        feeds = tuple(dict.fromkeys(source.label for source in upstream(node).values()))
        shape = tuple(len(made[feed].levels) for feed in feeds)
        if table.feeds != feeds or table.chances.shape[:-2] != shape:
            raise AnytimeError(f"{path}: table {table.label} does not fit the calls that feed it")
        made[node.label] = replace(table, path=arms[node.label])
    return tuple(made.values())


def _check_divisions(path: Path, stored: StoredSchedule, made: Sequence[Table]) -> None:
    count = len(stored.budgets)
    if not count or len(stored.shares) != count or len(stored.promised) != count:
        raise AnytimeError(f"{path}: budgets, shares and promised differ in length or are empty")
    if any(len(row) != len(made) for row in stored.shares):
        raise AnytimeError(f"{path}: a row of shares has not one share for each node")
    budgets, shares = np.array(stored.budgets, dtype=float), np.array(stored.shares, dtype=float)
    if budgets[0] < 0 or (np.diff(budgets) <= 0).any():
        raise AnytimeError(f"{path}: budgets must increase and be >= 0")
    spent = costs.total(made, list(shares.T))
    if shares.min() < 0 or (spent > budgets * (1 + 1e-9) + 1e-9).any():
        raise AnytimeError(f"{path}: shares must be >= 0 and sum to no more than their budget")
    promised = np.array(stored.promised, dtype=float)
    if promised[0] < 0 or promised[-1] > 1 + 1e-6 or (np.diff(promised) < 0).any():
        raise AnytimeError(f"{path}: promised qualities must lie in [0, 1] and not decrease")
    check_calibration(path, np.array(stored.calibration, dtype=float).reshape(-1, 4))
    if not 0 <= stored.regret <= 1:
        raise AnytimeError(f"{path}: a regret of {stored.regret}; it lies in [0, 1]")
    for name, known in stored.steps.items():
        if (
            len(known.median) != len(known.p95)
            or min([*known.median, *known.p95, known.spread]) < 0
        ):
            raise AnytimeError(
                f"{path}: steps.{name} has not two equal rows of seconds >= 0 and a spread >= 0"
            )


def check_calibration(path: Path, rows: Floats) -> None:
    """Raise AnytimeError if rows [K, 4] of a calibration contradict each other."""
    if not len(rows) or rows.min() < 0 or rows[:, 1:].max() > 1 + 1e-6:
        raise AnytimeError(f"{path}: calibration needs a row at least, of numbers in [0, 1]")
    if (np.diff(rows[:, 0]) <= 0).any() or (np.diff(rows[:, 1:], axis=0) < 0).any():
        raise AnytimeError(
            f"{path}: the levels of the calibration must increase, the rest not fall"
        )
    if (rows[:, 2] > rows[:, 1]).any() or (rows[:, 1] > rows[:, 3]).any():
        raise AnytimeError(f"{path}: a promise of the calibration lies outside its interval")
