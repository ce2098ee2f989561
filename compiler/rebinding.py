"""A compiled program whose modules are exchanged for others of the same names and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.programs import Call, Program
from compiler.compiled import CompiledProgram


def rebound(compiled: CompiledProgram, modules: Mapping[str, Module]) -> CompiledProgram:
    """The same division of time over other modules, by the names of those that they replace.

    Raises AnytimeError for a module with another name or other parameters, and for a program with
    more than calls in it (branches, loops, what runs in parallel).
    """
    if len(compiled.program.calls) != len(compiled.program.nodes) or compiled.program.parallels:
        raise AnytimeError(f"{compiled.name!r} has more than calls; its modules stay as they are")
    made: dict[str, Call] = {}
    for call in compiled.program.calls:
        module = modules.get(call.module.name, call.module)
        if (module.name, module.parameters) != (call.module.name, call.module.parameters):
            raise AnytimeError(f"{module!r} cannot take the place of {call.module!r}")
        arguments = tuple(
            made[argument.label] if isinstance(argument, Call) else argument
            for argument in call.arguments
        )
        made[call.label] = Call(module, arguments, call.label)
    old = compiled.program
    calls = tuple(made.values())
    return replace(compiled, program=Program(old.name, old.inputs, calls, made[old.output.label]))
