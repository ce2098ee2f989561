"""Commands of the experiments: demo, bench, reproduce, warm-up."""

from __future__ import annotations

import argparse
import json
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anytime.command_line import Answer, add_command, destination, natural, progress
from anytime.errors import AnytimeError

if TYPE_CHECKING:
    from experiments.benchmarks.figures import Benchmark

BENCHMARKS = (
    "planner",
    "compiler",
    "mission",
    "query",
    "nao",
    "monitor",
    "deadline",
    "faults",
    "campaign",
)
PARTS = ("zr", "nao", "rivals")


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(commands, "demo", demo, "the main job, on an office that ships with us")
    parser.add_argument(
        "--seeds", type=natural, default=100, help="missions a policy (default 100)"
    )
    parser.add_argument("--seed", type=natural, default=0, help="of the profiles and the page")
    parser.add_argument("--mission", type=Path, metavar="MISSION.toml", help="default: the office")
    parser.add_argument(
        "-o", "--output", type=destination, default=".", metavar="DIR", help="default: here"
    )
    parser = add_command(commands, "bench", bench, "a benchmark: " + ", ".join(BENCHMARKS))
    parser.add_argument("name", choices=BENCHMARKS)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--quick", action="store_true", help="at most 4 minutes on 2 cores")
    length.add_argument("--full", action="store_true", help="may take hours")
    parser.add_argument(
        "--maps", type=Path, metavar="DIR", help="MovingAI maps; default $ANYTIME_MAPS"
    )
    parser.add_argument(
        "--traces",
        type=Path,
        metavar="DIR",
        help="of monitor: recorded quality traces; default $ANYTIME_TRACES",
    )
    parser.add_argument("--seed", type=natural, default=0, help="of everything random")
    parser.add_argument(
        "-o", "--output", type=destination, metavar="DIR", help="for pictures, of those that draw"
    )
    parser = add_command(
        commands, "reproduce", reproduce, "the papers' claims, and rivals, beside our figures"
    )
    parser.add_argument(
        "parts", nargs="*", metavar="NAME", help=f"of {', '.join(PARTS)}; default: all"
    )
    parser.add_argument("--quick", action="store_true", help="at most 10 minutes on 2 cores")
    parser.add_argument(
        "--resume", action="store_true", help="go on with what the folder of the page has kept"
    )
    parser.add_argument("--seed", type=natural, default=0, help="of the first draw")
    parser.add_argument(
        "-o", "--output", type=destination, default=".", metavar="DIR", help="of the page"
    )
    add_command(commands, "warm-up", warm_up, "compile the kernels, so that the first call is fast")


def demo(options: argparse.Namespace) -> Answer:
    """Measure, compile, run the mission monitored and by the baselines; table and report.html."""
    from experiments import shipped
    from experiments.demo import run, write_report
    from monitor.robots.grid_missions import read_mission

    if options.seeds < 2:
        raise AnytimeError(f"--seeds {options.seeds}: at least 2 are needed for an interval")
    options.output.mkdir(parents=True, exist_ok=True)
    grid = read_mission(options.mission or shipped.mission_path())
    with progress("office") as bar:
        found = run(
            grid,
            seeds=range(options.seeds),
            seed=options.seed,
            tell=lambda what, done, total: bar(done, total),
        )
    page = write_report(found, options.output, options.seed)
    return Answer(f"{found!r}\n{page}", _figures(found.benchmark))


def bench(options: argparse.Namespace) -> Answer:
    """Run one benchmark and print its figures; nothing is remembered from an earlier run."""
    import importlib
    import sys

    if options.maps is not None and not options.maps.is_dir():
        raise AnytimeError(f"--maps {options.maps}: no such folder")
    given: dict[str, Path] = {}
    if options.traces is not None:
        if options.name != "monitor":
            raise AnytimeError(f"--traces is for bench monitor, not for bench {options.name}")
        if not options.traces.is_dir():
            raise AnytimeError(f"--traces {options.traces}: no such folder")
        given["traces"] = options.traces
    # BENCHMARKS is a closed list of ours, so this imports by no name that a user gave.
    benchmark = importlib.import_module(f"experiments.benchmarks.{options.name}")
    found = benchmark.measure(
        quick=options.quick,
        full=options.full,
        seed=options.seed,
        maps=options.maps,
        progress=lambda message: print(message, file=sys.stderr, flush=True),
        **given,
    )
    width = max(len(key) for key in found.figures)
    lines = [f"{key:<{width}}  {_shown(value)}" for key, value in found.figures.items()]
    if options.output is not None and found.picture is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        lines.append(str(found.picture(options.output / f"{found.name}.png")))
    return Answer("\n".join(lines), _figures(found))


def reproduce(options: argparse.Namespace) -> Answer:
    """Measure what the papers claim, in their way and in ours, and every benchmark beside its
    rivals: a page (`reproduce.html`) and the same as a document (`results.md`), both from
    `results.json`. What is found is kept in `reproduce.jsonl`, from which `--resume` goes on.

    A claim that does not hold is a finding and no failure: the exit code is 0.
    """
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        raise AnytimeError(f"nothing named {unknown[0]!r} to reproduce; choose {', '.join(PARTS)}")
    from experiments.reproduction.page import page
    from experiments.reproduction.reproducing import measure
    from experiments.reproduction.results import results

    with progress("draws") as bar:
        found = measure(
            tuple(dict.fromkeys(options.parts)) or PARTS,
            quick=options.quick,
            seed=options.seed,
            resume=options.resume,
            output=options.output,
            progress=bar,
        )
    told = _figures(found.benchmark)
    written = {
        "results.json": json.dumps(told, indent=1, allow_nan=False) + "\n",
        "results.md": results(told),
        "reproduce.html": page(told, options.output),
    }
    for name, text in written.items():
        (options.output / name).write_text(text, encoding="utf-8")
    files = [str(options.output / name) for name in written]
    return Answer("\n".join([repr(found), *files]), told)


def warm_up(options: argparse.Namespace) -> Answer:
    """Compile every kernel that missions and planners need; machine code is kept between
    processes."""
    import numpy as np

    from anytime import WorkClock, measure
    from compiler import elimination
    from experiments.domains import MACHINE, cross, domain
    from monitor.robots.grid import Scene
    from monitor.robots.grid_missions import REFERENCE
    from monitor.robots.navigation import frame_problems, navigate
    from planners import Grid, ara, astar, steps
    from sensing import instance

    elimination.warm_up()
    for family in ("r20", "rooms"):  # one is searched by its density, the other by its regions
        free, start, goal = instance(family, 128, 0)
        astar(free, start, goal)
        for grid in (Grid.known(free), Grid((~free).astype(np.float32))):
            for planner in (steps, ara.steps):
                list(planner(grid, start, goal))
    small = domain("r10", 32, 0)
    scene = Scene(small.free, small.start, small.goal, radius=16, frame=8.0)
    frames = list(frame_problems(scene, np.random.default_rng(0), 1))
    measure(navigate, frames, seconds=8.0, clock=lambda: WorkClock(REFERENCE))
    measure(cross, [small], seconds=1.0, clock=lambda: WorkClock(MACHINE))
    return Answer("kernels are compiled", {"compiled": True})


def _shown(value: float | int | None) -> str:
    if value is None:
        return "—"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _figures(found: Benchmark) -> dict[str, Any]:
    from experiments.benchmarks.figures import reasons

    machine = {"python": platform.python_version(), "system": platform.platform()}
    return {
        "name": found.name,
        "figures": _nested(found.figures),
        "settings": {**found.settings, "not_measured": reasons(found)},
        "machine": machine,
        "seed": found.seed,
    }


def _nested(figures: Any) -> dict[str, Any]:
    """Dotted names as nested objects."""
    tree: dict[str, Any] = {}
    for key, value in figures.items():
        *sections, last = key.split(".")
        place = tree
        for section in sections:
            place = place.setdefault(section, {})
        place[last] = value
    return tree
