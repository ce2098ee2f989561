"""Commands of the library: profile, library, calibrate, doctor, plot."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from anytime.command_line import (
    Answer,
    add_command,
    destination,
    folder,
    natural,
    positive,
    progress,
    resolve,
    target,
    told,
)
from anytime.errors import AnytimeError

RUNS = 30  # problems that are run, if nothing is said
MOST = 2000  # with --until-regret
CALIBRATION = 100  # problems among which known ones are sought


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(commands, "profile", profile, "measure modules and fill a library")
    parser.add_argument("module", nargs="+", help="a registered name or FILE.py:NAME")
    _add_library(parser, destination)
    parser.add_argument(
        "--runs", type=natural, metavar="N", help=f"problems, at most (default {RUNS}, or {MOST})"
    )
    parser.add_argument(
        "--until-regret",
        type=positive,
        metavar="R",
        help="end when no division of time is better than the compiled one by more than R",
    )
    parser.add_argument("--seconds", type=positive, default=1.0, help="of each run (default 1)")
    parser.add_argument("--problems", metavar="FILE.py:NAME", help="a function (rng) -> problems")
    parser.add_argument("--seed", type=natural, default=0, help="of the problems and the runs")
    parser.add_argument(
        "--executor",
        default="serial",
        metavar="WHERE",
        help="serial, processes:N, dask://HOST:PORT",
    )
    parser.add_argument(
        "--resume", action="store_true", help="go on with the runs that the library has kept"
    )
    parser = add_command(commands, "library", library, "show the profiles of a library")
    parser.add_argument("action", nargs="?", choices=["check"], help="only check the files")
    _add_library(parser)
    parser.add_argument(
        "--ompl", type=target, metavar="FILE", help="write the runs as a log of OMPL's benchmarks"
    )
    parser = add_command(
        commands, "calibrate", calibrate, "move a library to this machine, by a few runs"
    )
    parser.add_argument("module", help="a registered name or FILE.py:NAME")
    _add_library(parser)
    parser.add_argument("--problems", metavar="FILE.py:NAME", help="as `profile` had them")
    parser.add_argument("--seed", type=natural, default=0, help="as `profile` had it")
    parser.add_argument(
        "-o",
        "--output",
        type=destination,
        default="calibrated",
        metavar="DIR",
        help="for the library on this machine (default: calibrated)",
    )
    parser = add_command(commands, "doctor", doctor, "speed and noise of this machine")
    parser.add_argument("--seconds", type=positive, default=2.0, help="to look (default 2)")
    parser = add_command(commands, "plot", plot, "draw profiles, compiled programs and logs")
    parser.add_argument(
        "file", nargs="+", type=Path, help=".profile, .schedule, .jsonl, or a folder of them"
    )
    parser.add_argument(
        "-o", "--output", type=destination, default=".", metavar="DIR", help="default: here"
    )


def _add_library(parser: argparse.ArgumentParser, kind: Callable[[str], Path] = folder) -> None:
    parser.add_argument(
        "--library", type=kind, default="profiles", metavar="DIR", help="default: profiles"
    )


def profile(options: argparse.Namespace) -> Answer:
    """Measure modules or programs and add their profiles to a library.

    The runs are kept beside them, NAME.runs, as they come; `--resume` goes on where they end. A
    problem that fails is left out and told, and the exit code is then 1.
    """
    from anytime import Module, ProfileLibrary, measure
    from anytime.programs import Program

    until_regret: float | None = options.until_regret
    runs: int = (MOST if until_regret else RUNS) if options.runs is None else options.runs
    if runs < 1:
        raise AnytimeError(f"--runs {runs}: at least one problem is needed")
    kept: Path = options.library
    filled = ProfileLibrary(kept) if kept.is_dir() else ProfileLibrary()
    left_out, missed, told_of = 0, False, dict[str, Any]()
    for reference in options.module:
        what = resolve(reference)
        if not isinstance(what, Module | Program):
            raise AnytimeError(f"{reference} is {type(what).__name__}, not a module or program")
        problems = _problems(what, options, runs)
        store = kept / f"{what.name}.runs"
        until = _until_regret(what, until_regret, options.seconds) if until_regret else None
        with (
            told() as warned,
            progress(f"measuring {what.name}") as report,
        ):
            measured = measure(
                what,
                problems,
                seconds=options.seconds,
                seed=options.seed,
                executor=options.executor,
                store=store,
                resume=options.resume,
                progress=report,
                until=until,
            )
        if until is not None:
            print(f"anytime: {what.name}: {until!r}", file=sys.stderr)
            told_of |= {"problems": until.problems, "regret": until.bound, "left": until.left}
            missed |= until.left > 0
        left_out += sum("is left out" in line for line in warned)
        filled = filled.updated(measured)
    filled.save(kept)
    data = {"library": str(kept), "modules": list(filled), "problems": runs, **told_of}
    return Answer(repr(filled), {**data, "left_out": left_out}, int(left_out > 0 or missed))


def _until_regret(what: Any, wanted: float, seconds: float) -> Any:
    """The rule that the compiler brings: this layer does not know it."""
    from anytime import plugins
    from anytime.programs import program_of

    point = plugins.registered("anytime.endings")["regret"]
    program = what if hasattr(what, "output") else program_of(what)
    return plugins.load(point)(program, wanted, seconds)


def calibrate(options: argparse.Namespace) -> Answer:
    """Run a few of a library's problems again, and write the library as it is on this machine.

    The exit code is 1 when a module has changed, which no machine explains.
    """
    from anytime import Module, ProfileLibrary
    from anytime.calibrating import calibrate
    from anytime.programs import Program

    what = resolve(options.module)
    if not isinstance(what, Module | Program):
        raise AnytimeError(f"{options.module} is {type(what).__name__}, not a module or program")
    problems = _problems(what, options, CALIBRATION)
    found = calibrate(ProfileLibrary(options.library), what, problems, seed=options.seed)
    found.library.save(options.output)
    data = {
        each.module: {
            "ratio": each.ratio,
            "ratio_low": each.low,
            "ratio_high": each.high,
            "problems": len(each.ratios),
            "changed": each.changed,
        }
        for each in found.modules
    }
    changed = any(each.changed for each in found.modules)
    return Answer(f"{found!r}\n{options.output}", data, int(changed))


def doctor(options: argparse.Namespace) -> Answer:
    """Measure speed and noise of this machine, and load what other packages have registered."""
    from dataclasses import asdict

    from anytime.examining import examine

    found = examine(options.seconds)
    return Answer(repr(found), {**asdict(found), "quiet": found.quiet})


def _problems(what: Any, options: argparse.Namespace, most: int) -> list[Any]:
    """The first problems of a module or program, or of the function that the user names."""
    import itertools

    import numpy as np

    module = what if hasattr(what, "problems") else what.output.module
    source = resolve(options.problems) if options.problems else module.problems
    if source is None:
        raise AnytimeError(
            f"{what.name} names no problems of its own; add --problems FILE.py:FUNCTION, a "
            "function (rng) -> problems"
        )
    try:
        return list(itertools.islice(source(np.random.default_rng(options.seed)), most))
    except Exception as error:
        raise AnytimeError(
            f"{options.problems or f'problems of {what.name}'}: {type(error).__name__}: {error}; "
            "give a function (rng) that returns or yields problems"
        ) from error


def library(options: argparse.Namespace) -> Answer:
    """Show what a library holds, check that every file of it is whole, or write it for OMPL."""
    from anytime import ProfileLibrary

    found = ProfileLibrary(options.library)
    if options.ompl is not None:
        from anytime.ompl_log import write_ompl_log

        write_ompl_log(found, options.ompl)
    text = f"{len(found)} profiles are whole" if options.action else repr(found)
    return Answer(text, {"modules": list(found), "machine": found.machine.name})


def plot(options: argparse.Namespace) -> Answer:
    """Draw each file, or each file of a folder, as a PNG here or in a folder of your choice."""
    from anytime import plugins

    drawn: list[str] = []
    drawers = plugins.registered("anytime.drawings")
    known = ", ".join(f".{name}" for name in sorted(drawers))
    files: list[Path] = []
    for place in options.file:
        inside = [file for file in sorted(place.glob("*")) if file.suffix[1:] in drawers]
        if place.is_dir() and not inside:
            raise AnytimeError(f"{place}: a folder with nothing to draw; drawn are {known}")
        files += inside if place.is_dir() else [place]
    targets: dict[Path, Path] = {}
    for file in files:
        target = options.output / f"{file.name}.png"
        if targets.get(target, file) != file:
            raise AnytimeError(
                f"{targets[target]} and {file} would both be drawn as {target}; "
                "draw them into folders of their own"
            )
        targets[target] = file
    options.output.mkdir(parents=True, exist_ok=True)
    for target, file in targets.items():
        if not file.is_file():
            raise AnytimeError(f"{file}: no such file")
        kind = file.suffix.removeprefix(".")
        if kind not in drawers:
            what = f".{kind}" if kind else "a file without a suffix"
            raise AnytimeError(f"{file}: cannot draw {what}; drawn are {known}")
        plugins.load(drawers[kind])(file, target)
        drawn.append(str(target))
    return Answer("\n".join(drawn), {"files": drawn})
