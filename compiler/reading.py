"""Reading a program from an ordinary Python function. [ZR93] §4, the program schema."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.programs import Call, Constant, Input, Program, reading


def program(function: Callable[..., Any]) -> Program:
    """Read a function that calls modules into a program.

    The function is called once with symbolic inputs, so it may only call modules and return the
    result of one. Raises AnytimeError, with the place in the source, for what cannot be compiled.
    """
    where = _where(function)
    if isinstance(function, Module):
        raise AnytimeError(
            f"{function.name} is a module; a program is a plain function that calls modules"
        )
    parameters = inspect.signature(function).parameters.values()
    for parameter in parameters:
        if parameter.kind is not parameter.POSITIONAL_OR_KEYWORD:
            raise AnytimeError(f"{where}: give {parameter.name!r} as an ordinary parameter")
    names = tuple(parameter.name for parameter in parameters)
    with reading(function.__name__) as opened:
        try:
            output = function(*(Input(name) for name in names))
        except AnytimeError as error:
            raise AnytimeError(f"{where}: {error}") from None
    if not isinstance(output, Call):
        raise AnytimeError(f"{where}: {_not_a_call(output)}")
    used = _used(output)
    for call in opened.calls:
        if call not in used:
            raise AnytimeError(
                f"{where}: the result of {call!r} is never used; remove the call or use its result"
            )
    return Program(function.__name__, names, tuple(opened.calls), output)


def _used(output: Call) -> set[Call]:
    """The call that makes the output and every call that it depends on."""
    used, pending = set[Call](), [output]
    while pending:
        call = pending.pop()
        used.add(call)
        pending += [a for a in call.arguments if isinstance(a, Call) and a not in used]
    return used


def _not_a_call(output: object) -> str:
    if isinstance(output, Input | Constant):
        return f"returns {output!r}, which no module makes; return the result of a module"
    if isinstance(output, tuple):
        return "returns several results; return one, or join them in a module"
    return f"returns {output!r}; return the result of a module"


def _where(function: Callable[..., Any]) -> str:
    code = getattr(function, "__code__", None)
    if code is None:
        return f"program {getattr(function, '__name__', function)!r}"
    return f"{code.co_filename}:{code.co_firstlineno}: program {function.__name__!r}"
