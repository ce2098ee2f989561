"""Commands of the compiler: compile, explain, advise, export."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from anytime.command_line import Answer, add_command, folder, positive, resolve, target
from anytime.errors import AnytimeError


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(
        commands, "compile", compile_program, "divide time among a program's modules"
    )
    parser.add_argument("program", help="a registered name or FILE.py:NAME")
    parser.add_argument(
        "--library", type=folder, default=Path("profiles"), metavar="DIR", help="default: profiles"
    )
    parser.add_argument("-o", "--output", type=target, metavar="FILE", help="default NAME.schedule")
    for name, run, summary in (
        ("explain", explain, "who gets how much of a budget, and why"),
        ("advise", advise, "which module is worth speeding up"),
    ):
        parser = add_command(commands, name, run, summary)
        parser.add_argument("file", type=Path, help="what `anytime compile` wrote")
        parser.add_argument("--seconds", type=positive, required=True, help="the budget")
    summary = "a compiled program for those who have no Python"
    parser = commands.add_parser("export", help=summary, description=summary)
    parser.add_argument("file", type=Path, help="what `anytime compile` wrote")
    parser.add_argument("--c", type=target, metavar="FILE.h", help="a header for C99 and C++")
    parser.add_argument(
        "--json", type=target, metavar="FILE", dest="tables", help="the same tables as JSON"
    )
    parser.set_defaults(run=export, json=False)


def compile_program(options: argparse.Namespace) -> Answer:
    """Compile a program with the profiles of a library and write the result."""
    from anytime import Module, ProfileLibrary
    from anytime.programs import Program
    from compiler.compiling import compile

    program = resolve(options.program)
    if not isinstance(program, Module | Program):
        raise AnytimeError(f"{options.program} is {type(program).__name__}, not a program")
    compiled = compile(program, ProfileLibrary(options.library))
    written: Path = options.output or Path(f"{compiled.name}.schedule")
    compiled.save(written)
    return Answer(
        f"{compiled!r}\nwritten to {written}", {"file": str(written), "least": compiled.least}
    )


def explain(options: argparse.Namespace) -> Answer:
    """Print the division of a budget and the price of a little more time for each call."""
    from compiler.loading import inspect

    found = inspect(options.file).explain(options.seconds)
    data = {
        "seconds": found.seconds,
        "promised": found.promised,
        "shares": {price.label: price.share for price in found.prices},
        "prices": {price.label: price.gain for price in found.prices},
    }
    return Answer(repr(found), data)


def advise(options: argparse.Namespace) -> Answer:
    """Print what each module would be worth if it were faster, better, or a rung longer."""
    from compiler.loading import inspect

    found = inspect(options.file).advise(options.seconds)
    return Answer(
        repr(found),
        {"promised": found.promised, "gains": {c.label: c.gain for c in found.changes}},
    )


def export(options: argparse.Namespace) -> Answer:
    """Write the divisions of a compiled program as a C header, as JSON, or both."""
    from compiler.exporting import exported, write_json
    from compiler.headers import write_header
    from compiler.loading import inspect

    if options.c is None and options.tables is None:
        raise AnytimeError("nothing to write; add --c FILE.h, --json FILE, or both")
    tables = exported(inspect(options.file))
    if options.c is not None:
        write_header(tables, options.c)
    if options.tables is not None:
        write_json(tables, options.tables)
    written = ", ".join(str(file) for file in (options.c, options.tables) if file is not None)
    count = len(tables.from_ms)
    return Answer(f"{count} division{'s' * (count != 1)} of {tables.name} written to {written}")
