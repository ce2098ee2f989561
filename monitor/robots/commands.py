"""Commands of the robots: run a monitored mission, compare, serve a simulated NAO."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anytime.command_line import (
    Answer,
    add_command,
    destination,
    folder,
    natural,
    positive,
    progress,
    target,
)
from anytime.errors import AnytimeError

if TYPE_CHECKING:
    from monitor.robots.grid_missions import GridMission


_OF_GRIDS = {
    "map": None, "start": None, "goal": None, "scenario": None, "library": None, "regret": 0,
    "policy": "optimal",
}  # fmt: skip
"""Options of `anytime run` that a NAO's scene has no use for, as they are by default."""


_FASTEST = 1000.0  # times real time that a served NAO can run at


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(commands, "run", run, "live a monitored mission and write its page")
    parser.add_argument("mission", type=Path, metavar="MISSION.toml", help="or a NAO's SCENE.toml")
    parser.add_argument("--map", type=Path, metavar="FILE", help="another floor (.map or .yaml)")
    parser.add_argument("--start", type=_cell, metavar="ROW,COLUMN", help="row 0 is the top")
    parser.add_argument(
        "--goal", type=_cell, action="append", metavar="ROW,COLUMN", help="again for each to visit"
    )
    parser.add_argument("--scenario", type=natural, metavar="N", help="the N-th of FILE.scen")
    parser.add_argument("--seed", type=natural, help="default: 0, or what a scene says")
    parser.add_argument(
        "--policy",
        default="optimal",
        help="optimal (default), paper, fixed, table, expected, min or max",
    )
    parser.add_argument(
        "--robot", default="simulated", metavar="WHERE", help="a NAO: simulated or naoqi:tcp://…"
    )
    parser.add_argument(
        "--drift", type=target, metavar="FILE", help="what a NAO learns of itself, from run to run"
    )
    parser.add_argument(
        "--faults", type=Path, metavar="FILE.toml", help="what goes wrong on purpose"
    )
    parser.add_argument("--clock", choices=["work", "wall"], default="work", help="work repeats")
    parser.add_argument("--library", type=folder, metavar="DIR", help="default: shipped profiles")
    parser.add_argument(
        "--regret", type=natural, default=0, metavar="N", help="live N other decisions a frame, too"
    )
    parser.add_argument(
        "--log",
        type=destination,
        default="anytime-run",
        metavar="DIR",
        help="for the log and the page (default anytime-run)",
    )

    summary = "what a change of profiles costs in the value of a mission"
    parser = add_command(commands, "compare", compare_sides, summary)
    for name in ("before", "after"):
        parser.add_argument(name, type=Path, help="a folder of profiles, or a schedule")
    parser.add_argument("--mission", type=Path, required=True, metavar="MISSION.toml")
    parser.add_argument(
        "--tolerance",
        type=_tolerated,
        default=0.0,
        metavar="V",
        help="loss put up with (default 0)",
    )

    parser = add_command(commands, "nao-sim", nao_sim, "serve a simulated NAO over NAOqi")
    parser.add_argument(
        "--scene", default="sitting", metavar="FILE|NAME", help="a shipped one (default sitting)"
    )
    parser.add_argument("--port", type=natural, default=0, help="on 127.0.0.1 (default: any)")
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument("--rate", type=positive, default=1.0, metavar="X", help="times real time")
    pace.add_argument("--lockstep", action="store_true", help="time stands until it is told")
    parser.add_argument("--seed", type=natural, metavar="N", help="instead of the scene's")
    parser.add_argument(
        "--fault", action="append", default=[], metavar="KIND[:FROM[:TO]]", help="what goes wrong"
    )


def run(options: argparse.Namespace) -> Answer:
    """Live one mission and write its log and its page into a folder."""
    from importlib.resources import files

    from anytime import ProfileLibrary, WallClock, WorkClock
    from anytime.faults import FaultyClock, read_schedule
    from monitor.logs import read_log
    from monitor.page import write_page
    from monitor.regrets import log_regrets, regrets
    from monitor.robots.briefing import POLICIES, brief
    from monitor.robots.faulty import kinds_of
    from monitor.robots.grid_missions import read_mission
    from monitor.robots.lessons import user_memory
    from monitor.robots.nao_scenes import is_scene
    from monitor.robots.navigation import navigate

    if is_scene(options.mission):
        if options.faults is not None:
            raise AnytimeError(
                "--faults is for a grid mission; a NAO's are anytime nao-sim --fault"
            )
        for name, ignored in _OF_GRIDS.items():
            if getattr(options, name) != ignored:
                raise AnytimeError(f"--{name} is for a grid mission, not for a NAO's scene")
        return _run_nao(options)
    if options.robot != "simulated":
        raise AnytimeError(f"--robot {options.robot} is for a NAO's scene, not for a grid mission")
    if options.drift:
        raise AnytimeError(f"--drift {options.drift} is for a NAO's scene, not for a grid mission")
    if options.faults is not None and not options.faults.is_file():
        raise AnytimeError(f"{options.faults}: no such file of faults")
    if options.regret and (options.regret < 2 or options.faults or options.clock == "wall"):
        raise AnytimeError(
            f"--regret {options.regret}: it takes 2 or more, and a mission that can be lived "
            "again: without --faults, on the work clock"
        )
    if options.policy not in POLICIES:
        raise AnytimeError(f"no policy {options.policy!r}; there are {', '.join(POLICIES)}")
    start, goals = options.start, options.goal or ()
    if options.scenario is not None:
        start, *goals = _ends(options.map, options.scenario)
    grid = read_mission(options.mission, map_path=options.map, start=start, goals=goals)
    profiles = options.library or Path(str(files("experiments") / "data" / "profiles"))
    library = ProfileLibrary(profiles)
    clock = WallClock() if options.clock == "wall" else WorkClock(grid.machine)
    faults = None
    if options.faults is not None:
        faults = read_schedule(options.faults, kinds_of(navigate))
        if options.clock == "work":
            clock = FaultyClock(grid.machine, faults)
        elif faults.of("clock"):
            raise AnytimeError(f"{options.faults}: faults of the clock take --clock work")
    with progress("calibrating"):
        briefing = brief(grid, library, memory=user_memory())
        monitor = briefing.monitor(options.policy)
    log = options.log / "mission.jsonl"
    report = briefing.live(monitor, options.seed or 0, clock=clock, log=log, faults=faults)
    if options.regret:
        shares = briefing.contracts.shares
        with progress("living other decisions") as bar:
            found = regrets(report, grid.mission, shares, count=options.regret, progress=bar)
        log_regrets(log, found)
    page = write_page([read_log(log)], options.log / "mission.html")
    purpose = f"faults on purpose, by {options.faults}\n" if faults is not None else ""
    return Answer(
        f"{report!r}\n{purpose}{_wide(grid)}\nlog {log}, page {page}",
        {
            "ending": report.ending.value,
            "net": report.net,
            "promised": report.promised,
            "seconds": report.seconds,
            "energy": report.energy,
            "frames": len(report.frames),
            "ledger": report.ledger,
            "log": str(log),
            "page": str(page),
        },
        0 if report else 1,
    )


def compare_sides(options: argparse.Namespace) -> Answer:
    """What a change costs, with its 95 % interval; exit code 1 if a loss is shown."""
    from monitor.robots.comparing import compare
    from monitor.robots.grid_missions import read_mission
    from monitor.robots.lessons import user_memory
    from monitor.robots.nao_scenes import is_scene

    if is_scene(options.mission):
        raise AnytimeError(f"{options.mission} is a NAO's scene; compare takes a grid mission")
    grid = read_mission(options.mission)
    with progress("living the mission"):
        found = compare(
            options.before, options.after, grid, options.tolerance, memory=user_memory()
        )
    figures = {
        "before": found.before,
        "after": found.after,
        "loss": found.loss,
        "loss_low": found.low,
        "loss_high": found.high,
        "tolerance": found.tolerance,
        "shown": found.shown,
        "modules": {
            name: {"slower": shift.slower, "quality": shift.quality, "loss": found.parts[name]}
            for name, shift in found.shifts.items()
        },
    }
    return Answer(repr(found), figures, 1 if found.shown else 0)


def _run_nao(options: argparse.Namespace) -> Answer:
    """Live a NAO's scene, on the simulated body or at an address."""
    from anytime import WallClock
    from monitor.logs import read_log
    from monitor.page import write_page
    from monitor.robots.nao_addresses import nao_body
    from monitor.robots.nao_drift import read_drift, write_drift
    from monitor.robots.nao_missions import brief
    from monitor.robots.nao_scenes import read_scene

    scene = read_scene(options.mission, seed=options.seed)
    drift = read_drift(options.drift) if options.drift else None
    with progress("measuring listening and planning"):
        briefing = brief()
    here = options.robot == "simulated" and options.clock == "work"
    clock = None if here else WallClock()
    body = None if here else nao_body(options.robot, scene, clock)
    robot = briefing.robot(scene, body=body, clock=clock, drift=drift)
    log = options.log / "mission.jsonl"
    report = briefing.log(robot, scene, log)
    robot.body.close()
    page = write_page([read_log(log)], options.log / "mission.html")
    if options.drift:
        write_drift(options.drift, robot.drift)
    told = (
        f"{robot.apart():.3f} m from the goal by odometry, {robot.plans} plans, {robot.falls} falls"
    )
    return Answer(
        f"{report!r}\n{told}\nlog {log}, page {page}",
        {
            "ending": report.ending.value,
            "net": report.net,
            "seconds": report.seconds,
            "frames": len(report.frames),
            "final_error_m": robot.apart(),
            "plans": robot.plans,
            "falls": robot.falls,
            "drift_rad": robot.drift.mean,
            "log": str(log),
            "page": str(page),
        },
        0 if report else 1,
    )


def nao_sim(options: argparse.Namespace) -> Answer:
    """Serve a simulated NAO until stdin closes or ctrl-c; the line with READY tells its url."""
    from importlib.resources import files

    from anytime.command_line import as_json
    from monitor.robots.nao_faults import read_fault
    from monitor.robots.nao_scenes import read_scene
    from monitor.robots.naoqi_server import end_without_teardown, serve, until_stdin_closes

    if options.rate > _FASTEST:
        raise AnytimeError(f"rate is {options.rate:g}; the simulation keeps up with {_FASTEST:g}")
    if options.port > 65535:
        raise AnytimeError(f"port is {options.port}; it must be 0 (any) to 65535")
    file = Path(options.scene)
    if not file.is_file() and len(file.parts) == 1 and not file.suffix:
        file = Path(str(files("experiments") / "data" / "scenes")) / f"{options.scene}.toml"
        if not file.exists():
            known = ", ".join(sorted(each.stem for each in file.parent.glob("*.toml")))
            raise AnytimeError(f"no scene {options.scene!r}; there are {known}, or give a file")
    scene = read_scene(file, seed=options.seed)
    faults = [read_fault(text) for text in options.fault]
    told: list[str] = []

    def ready(url: str) -> None:
        told.append(url)
        print(as_json({"ready": url}) if options.json else f"READY {url}", flush=True)

    rate = None if options.lockstep else options.rate
    done = until_stdin_closes()
    try:
        serve(scene, port=options.port, rate=rate, faults=faults, ready=ready, done=done)
    except KeyboardInterrupt:
        end_without_teardown(130)
        raise
    end_without_teardown(0)
    return Answer(f"served {scene.name} at {told[0]}", {"scene": scene.name, "url": told[0]})


def _wide(grid: GridMission) -> str:
    rows, columns = grid.scene.free.shape
    goals = ", ".join(map(str, grid.scene.goals))
    optimal = grid.scene.optimal
    way = f"shortest way {optimal:.1f} cells" if math.isfinite(optimal) else "no way leads there"
    return f"{grid.scene.name}, {rows} × {columns} cells, from {grid.scene.start} to {goals}, {way}"


def _ends(floor: Path | None, index: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """Start and goal of a map's published scenario."""
    from sensing import read_map, read_scenarios

    if floor is None:
        raise AnytimeError("--scenario belongs to a map; add --map FILE.map")
    file = floor.with_name(f"{floor.name}.scen")
    scenarios = read_scenarios(file, read_map(floor))
    if not 0 <= index < len(scenarios):
        raise AnytimeError(f"{file} has scenarios 0 to {len(scenarios) - 1}, not {index}")
    return scenarios[index].start, scenarios[index].goal


def _tolerated(text: str) -> float:
    return 0.0 if re.fullmatch(r"0*\.?0+|0+\.", text.strip()) else positive(text)


def _cell(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,6}),(\d{1,6})", text)
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not ROW,COLUMN")
    return int(found[1]), int(found[2])
