"""Commands of the library: profile, library, plot."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from anytime.command_line import Answer, add_command, positive, progress, resolve
from anytime.errors import AnytimeError


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(commands, "profile", profile, "measure modules and fill a library")
    parser.add_argument("module", nargs="+", help="a registered name or FILE.py:NAME")
    parser.add_argument("--library", type=Path, default=Path("profiles"), metavar="DIR")
    parser.add_argument("--runs", type=int, default=30, metavar="N", help="problems (default 30)")
    parser.add_argument("--seconds", type=positive, default=1.0, help="of each run (default 1)")
    parser.add_argument("--problems", metavar="FILE.py:NAME", help="a function (rng) -> problems")
    parser.add_argument("--seed", type=int, default=0)
    parser = add_command(commands, "library", library, "show the profiles of a library")
    parser.add_argument("action", nargs="?", choices=["check"], help="only check the files")
    parser.add_argument("--library", type=Path, default=Path("profiles"), metavar="DIR")
    parser = add_command(commands, "plot", plot, "draw profiles, compiled programs and logs")
    parser.add_argument("file", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path(), metavar="DIR")


def profile(options: argparse.Namespace) -> Answer:
    """Measure modules or programs and add their profiles to a library."""
    import itertools

    import numpy as np

    from anytime import Module, ProfileLibrary, measure
    from anytime.programs import Program

    if options.runs < 1:
        raise AnytimeError(f"--runs {options.runs}: at least one problem is needed")
    folder: Path = options.library
    filled = ProfileLibrary(folder) if folder.is_dir() else ProfileLibrary()
    for reference in options.module:
        what = resolve(reference)
        if not isinstance(what, Module | Program):
            raise AnytimeError(f"{reference} is {type(what).__name__}, not a module or program")
        source = resolve(options.problems) if options.problems else _problems(what)
        problems = list(itertools.islice(source(np.random.default_rng(options.seed)), options.runs))
        with progress(f"measuring {what.name}") as report:
            measured = measure(
                what, problems, seconds=options.seconds, seed=options.seed, progress=report
            )
        filled = filled.updated(measured)
    filled.save(folder)
    return Answer(
        repr(filled), {"library": str(folder), "modules": list(filled), "problems": options.runs}
    )


def _problems(what: Any) -> Any:
    module = what if hasattr(what, "problems") else what.output.module
    if module.problems is None:
        raise AnytimeError(
            f"{what.name} names no problems of its own; add --problems FILE.py:FUNCTION, a "
            "function (rng) -> problems"
        )
    return module.problems


def library(options: argparse.Namespace) -> Answer:
    """Show what a library holds, or check that every file of it is whole."""
    from anytime import ProfileLibrary

    found = ProfileLibrary(options.library)
    text = f"{len(found)} profiles are whole" if options.action else repr(found)
    return Answer(text, {"modules": list(found), "machine": found.machine.name})


def plot(options: argparse.Namespace) -> Answer:
    """Draw each file as a PNG beside it, or in a folder of your choice."""
    from importlib.metadata import entry_points

    drawn: list[str] = []
    drawers = {point.name: point for point in entry_points(group="anytime.drawings")}
    options.output.mkdir(parents=True, exist_ok=True)
    for file in options.file:
        if not file.is_file():
            raise AnytimeError(f"{file}: no such file")
        kind = file.suffix.removeprefix(".")
        if kind not in drawers:
            raise AnytimeError(
                f"{file}: cannot draw .{kind}; drawn are "
                f"{', '.join('.' + name for name in sorted(drawers))}"
            )
        target = options.output / f"{file.name}.png"
        drawers[kind].load()(file, target)
        drawn.append(str(target))
    return Answer("\n".join(drawn), {"files": drawn})
