"""Reading a program from an ordinary Python function. [ZR93] §4, the program schema."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, cast

from anytime.errors import AnytimeError
from anytime.joins import Several, Tests
from anytime.modules import Module
from anytime.programs import Call, Constant, Input, Join, Program, reading
from anytime.structure import Group, behind, groups, in_order
from compiler.constructs import Output, several

_TAKEN = {"self", "seconds", "deadline", "clock", "rng", "on_result", "memory"}
"""What `CompiledProgram.run` takes besides the inputs."""


def program(function: Callable[..., Any]) -> Program:
    """Read a function that calls modules into a program.

    The function is called once with symbolic inputs, so it may only call modules, join their
    results by the constructs of this package (`branch`, `choose`, `all_of`, `any_of`, `loop`,
    `parallel`) and return one result or a tuple of several, each perhaps as `output(…)`.
    Raises AnytimeError, with the place in the source, for what cannot be compiled.
    """
    where = _where(function)
    if not isinstance(function, Module) and not inspect.isroutine(function):
        raise AnytimeError(f"program takes a function that calls modules, not {function!r}")
    if isinstance(function, Module):
        raise AnytimeError(
            f"{function.name} is a module; a program is a plain function that calls modules"
        )
    parameters = inspect.signature(function).parameters.values()
    for parameter in parameters:
        if parameter.kind is not parameter.POSITIONAL_OR_KEYWORD:
            raise AnytimeError(f"{where}: give {parameter.name!r} as an ordinary parameter")
        if parameter.default is not parameter.empty:
            raise AnytimeError(
                f"{where}: {parameter.name!r} has a default; every input is given when it runs"
            )
        if parameter.name in _TAKEN:
            raise AnytimeError(
                f"{where}: the input {parameter.name!r} has the name of something that running a "
                "program takes; give it another"
            )
    names = tuple(parameter.name for parameter in parameters)
    try:
        with reading(function.__name__) as opened:
            output: object = function(*(Input(name) for name in names))
            if isinstance(output, tuple):
                output = several(opened, cast("tuple[object, ...]", output))
            elif isinstance(output, Output):
                output = several(opened, (output,))
        if not isinstance(output, Call | Join):
            raise AnytimeError(_not_a_call(output))
        used = behind(output)
        for node in opened.nodes:
            if node not in used:
                raise AnytimeError(
                    f"the result of {node!r} is never used; remove the call or use its result"
                )
        for call in used:
            _check(call)
        found = in_order(function.__name__, names, output, opened.parallels, opened.nodes)
        _check_deadlines(found, groups(found))
    except AnytimeError as error:
        raise AnytimeError(f"{where}: {error}") from None
    return found


def _check(node: Call | Join) -> None:
    """Refuse what is read well and cannot be compiled."""
    for argument in node.arguments:
        test = isinstance(argument, Join) and isinstance(argument.rule, Tests)
        if test and isinstance(node, Call):
            raise AnytimeError(f"{node.label} is called with a test, {argument!r}; use branch")


def _check_deadlines(program: Program, groups: Sequence[Group]) -> None:
    """Refuse results with deadlines of their own that are not independent of each other."""
    output = program.output
    if not isinstance(output, Join) or not isinstance(output.rule, Several):
        return
    if all(deadline == float("inf") for deadline in output.rule.deadlines):
        return
    parts = [{node.label for node in behind(argument)} for argument in output.arguments]
    shared = sum(map(len, parts)) > len(set[str]().union(*parts))
    beside = any(sum(bool(part & group.calls) for part in parts) > 1 for group in groups)
    if shared or beside:
        raise AnytimeError(
            f"results with deadlines of their own share a {'call' if shared else 'parallel'}; give "
            "each its own, or let one deadline do for all"
        )


def _not_a_call(output: object) -> str:
    if isinstance(output, Input | Constant):
        return f"returns {output!r}, which no module makes; return the result of a module"
    return f"returns {output!r}; return the result of a module"


def _where(function: Callable[..., Any]) -> str:
    code = getattr(function, "__code__", None)
    if code is None:
        return f"program {getattr(function, '__name__', function)!r}"
    return f"{code.co_filename}:{code.co_firstlineno}: program {function.__name__!r}"
