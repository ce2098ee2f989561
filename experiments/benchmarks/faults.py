"""What the system does when things go wrong: modules, missions, planners, files, disks."""

from __future__ import annotations

import importlib.util
import os
import resource
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import anytime
from anytime.faults import Fault, FaultyClock, Schedule
from anytime.workers import workers
from compiler import CompiledProgram
from experiments import crossings
from experiments.benchmarks import (
    faulty_missions,
    hostile_clients,
    kills,
    link_faults,
    malformed,
    mutation,
    soak,
)
from experiments.benchmarks.deadline import CONTRACT, overrun_of_nothing, warm_up
from experiments.benchmarks.figures import Benchmark, share_interval
from experiments.benchmarks.misbehaving import MISBEHAVING
from experiments.benchmarks.nao_rig import Rig
from monitor.endings import Ending
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.robots.faulty import FaultyRobot, faulty_program
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE
from sensing.vision import Vision

BOUND = 250.0  # ms past its contract in which control is back, whatever an isolated module does
HOUR = 3600.0  # seconds of a soak, and of mutation, with --full
HUNG = 10.0  # seconds of a mission, of the processor's time: on a work clock nobody waits
HALT = 1.0  # seconds after the last sign of life in which a robot stands
LOUD = 100.0  # ms that an empty loop runs over, above which a trial is repeated
RUBBISH = (("rubbish", 0.1), ("nothing", 0.1), ("raises", 0.1))
"""What planners return instead of a plan, and how often: three times in ten together."""


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """Misbehaving modules, faulty missions, killed writers, failing disks, malformed files, failing
    links, hostile clients, a soak; with `full` an hour of it, and how many changed programs the
    tests notice."""
    trials, lived, floors, killed, files, links, clients = (
        (60, 200, 60, 5, 1000, 36, 200) if quick else (1000, 2000, 500, 200, 10_000, 500, 1000)
    )
    settings: dict[str, Any] = {"not_measured": {}}
    figures: dict[str, float | int | None] = {}
    program = crossings.compiled()
    progress(f"malformed: {files} files")
    figures |= _malformed(files, seed, settings)
    progress(f"missions: {lived} with one to three faults each")
    figures |= _missions(program, lived, seed, settings)
    progress(f"connected: {floors} floors, planners that return rubbish three times in ten")
    figures |= connected(program, floors, seed)
    progress(f"kills: {killed} of each of {len(kills.WRITERS)} writers")
    outcomes = [*kills.killed(killed, seed), *((corrupt, False) for corrupt in kills.failing())]
    figures["kills.corrupt"] = sum(corrupt for corrupt, _ in outcomes)
    figures["kills.lost"] = sum(lost for _, lost in outcomes)
    figures["kills.count"] = len(outcomes)
    progress(f"return_bound: {trials} trials of {len(MISBEHAVING)} misbehaving modules")
    figures |= return_bound(trials, settings)
    progress(f"halt: {links} faults of links to a walking robot")
    figures |= _halt(links, seed, settings)
    progress(f"qi: {clients} connections that speak nonsense, and as many calls")
    figures |= _qi(clients, seed, settings)
    long = HOUR if full else 20.0 if quick else 300.0
    progress(f"soak: {long:.0f} s of missions in a process of their own")
    figures |= _soak(long, seed, settings)
    progress("mutation: programs with one thing changed, for --full alone")
    figures |= _mutation(full, seed, settings)
    return Benchmark("faults", figures, settings, seed)


def _malformed(count: int, seed: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    malformed.read_all(20, seed)  # what is imported late is no memory of the files
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = malformed.read_all(count, seed)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    events = malformed.code_run(count // 5, seed + 1)
    settings["malformed.first_traceback"] = found.first
    settings["code_from_data.first"] = events[:3]
    return {
        "malformed.count": found.count,
        "malformed.tree_share": found.tree / found.count,
        "malformed.tracebacks": found.tracebacks,
        "malformed.bad_exit": found.bad_exit,
        "malformed.slowest_s": found.slowest,
        "malformed.extra_mb": (after - before) / 1024,
        "code_from_data.events": len(events),
    }


def _missions(
    program: CompiledProgram, count: int, seed: int, settings: dict[str, Any]
) -> dict[str, float | int | None]:
    raised: list[int] = []
    slow: list[int] = []
    unclosed: list[int] = []
    endings: dict[str, int] = {}
    slowest = 0.0
    files = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    for number in range(count):
        began = time.process_time()
        outcome = faulty_missions.live(program, faulty_missions.drawn(program, number, seed))
        took = time.process_time() - began
        slowest = max(slowest, took)
        if outcome.raised:
            raised.append(number)
        if outcome.unclosed:
            unclosed.append(number)
        if took > HUNG:
            slow.append(number)
        endings[outcome.ending] = endings.get(outcome.ending, 0) + 1
    left = len(os.listdir("/proc/self/fd")) - files if files else 0
    settings["missions.endings"] = endings
    settings["missions.numbers"] = {"raised": raised, "hung": slow, "unclosed": unclosed}
    return {
        "missions.count": count,
        "missions.exceptions": len(raised),
        "missions.hangs": len(slow),
        "missions.internal": endings.get(Ending.INTERNAL.value, 0),
        "missions.slowest_s": slowest,
        "missions.leaks": max(0, left) + _children(),
        "missions.unclosed_ledgers": len(unclosed),
    }


def _children() -> int:
    """Child processes that nobody waited for."""
    try:
        os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        return 0
    return 1


def connected(program: CompiledProgram, count: int, seed: int) -> dict[str, float | int | None]:
    """`connected.reached` over so many floors with a way, a fifth of each kind."""
    reached = [_reaches(program, number, seed) for number in range(count)]
    return share_interval("connected.reached", reached)


def _reaches(program: CompiledProgram, number: int, seed: int) -> bool:
    """Whether a floor with a way is crossed though plans are rubbish three times in ten."""
    kind = crossings.KINDS[number % len(crossings.KINDS)]
    floor = crossings.crossing(kind, number, reachable=True, seed=seed)
    schedule = Schedule([Fault(k, what="find_path", chance=p) for k, p in RUBBISH], number)
    device = replace(Vision(), t_a=1.0, t_b=1.0, q_a=floor.quality, q_b=floor.quality)
    scene = Scene(floor.free, floor.start, floor.goal, device=device)
    clock = FaultyClock(REFERENCE, schedule)
    robot = FaultyRobot(GridRobot(scene, crossings.ENDLESS.energy, clock), schedule)
    policy = constant(dict(zip(program.labels, (0.25, 5.0), strict=True)), 5.0)
    monitor = Monitor(faulty_program(program, schedule, robot), policy, "constant")
    return monitor.run(crossings.ENDLESS, robot, seed=floor.seed).ending is Ending.REACHED


def return_bound(trials: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    """How much later than its contract control is back, whatever an isolated module does."""
    over: list[float] = []
    floors: list[float] = []
    worst, repeated = "", 0
    for number, module in zip(range(trials), _in_turn(), strict=False):
        while True:
            warm_up(module)
            floor = overrun_of_nothing(CONTRACT)
            until = time.perf_counter() + CONTRACT
            anytime.run(module, deadline=anytime.Deadline(anytime.WallClock(), until))
            late = 1e3 * (time.perf_counter() - until)
            floor = max(floor, overrun_of_nothing(CONTRACT / 10))
            if floor <= LOUD or repeated > trials:
                break
            repeated += 1
        if not over or late > max(over):
            worst = f"{module.name}, trial {number}"
        over.append(late)
        floors.append(floor)
    workers.close()
    settings["return_bound.worst"] = worst
    return {
        **share_interval("return_bound.kept", [late <= BOUND for late in over]),
        "return_bound.worst_ms": max(over),
        "return_bound.p99_ms": float(np.quantile(over, 0.99)),
        "return_bound.floor_worst_ms": max(floors),
        "return_bound.repeated": repeated,
        "return_bound.count": len(over),
    }


def _halt(count: int, seed: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    """How old the last sign of life of its commander was when a robot still walked."""
    if importlib.util.find_spec("qi") is None:
        settings["not_measured"]["halt.worst_s"] = "libqi is not installed: extra nao"
        return {"halt.worst_s": None}
    seen = list(link_faults.trials(count, seed))
    walked = [each for each in seen if each.moved]
    kinds = sorted({each.kind for each in seen})
    settings["halt.worst_s"] = {
        kind: max(each.halt for each in seen if each.kind == kind) for kind in kinds
    }
    told = [each.told for each in seen if each.kind in link_faults.TOLD]
    return {
        "halt.worst_s": max(each.halt for each in seen),
        **share_interval("halt.within_1_s", [each.halt <= HALT for each in walked]),
        "halt.count": len(walked),
        "halt.commands_after_stop": sum(each.after for each in seen),
        "halt.unwatched_motions": sum(each.unwatched for each in seen),
        "halt.told_worst_s": max(told),
    }


def _qi(count: int, seed: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    """What hostile clients do to a robot that is served, in real time and in lock-step."""
    if importlib.util.find_spec("qi") is None:
        settings["not_measured"]["qi.motions"] = "libqi is not installed: extra nao"
        return {"qi.motions": None}
    with Rig(seed) as rig:
        harms = [
            hostile_clients.harmed(server, count // 2, count // 2, seed + place)
            for place, server in enumerate((rig.live(), rig.crowded()))
        ]
    waits = np.concatenate([each.waits for each in harms])
    settings["qi.taken"] = [call for each in harms for call in each.taken]
    settings["qi.told"] = [error for each in harms for error in each.told]
    return {
        "qi.connections": sum(each.connections for each in harms),
        "qi.calls": sum(each.calls for each in harms),
        "qi.motions": sum(each.motions for each in harms),
        "qi.calls_taken": len(settings["qi.taken"]),
        "qi.paths_told": len(settings["qi.told"]),
        "qi.served_worst_s": float(waits.max()),
        "qi.served_p50_s": float(np.quantile(waits, 0.5)),
        "qi.floor_worst_s": max(max(each.floors) for each in harms),
        "qi.extra_mb": max(each.grown for each in harms),
    }


def _soak(seconds: float, seed: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    """What a process does not give back that lives mission after mission."""
    if not os.path.isdir("/proc/self/fd"):
        settings["not_measured"]["soak.mb_per_hour"] = "what a process holds is told by Linux"
        return {"soak.mb_per_hour": None, "soak.missions": None}
    found = soak.soaked(seconds, seed)
    settled = found.settled()
    mean, low, high = found.mb_per_hour()
    files, children = found.grown()
    settings["soak.seconds"] = seconds
    return {
        "soak.missions": found.missions,
        "soak.mb_per_hour": mean,
        "soak.mb_per_hour_low": low,
        "soak.mb_per_hour_high": high,
        "soak.mb": float(settled[-1, 1]),
        "soak.mb_grown": float(settled[-1, 1] - settled[0, 1]),
        "soak.file_descriptors_grown": files,
        "soak.children_grown": children,
        "soak.exceptions": found.raised,
    }


def _mutation(full: bool, seed: int, settings: dict[str, Any]) -> dict[str, float | int | None]:
    """The share of changed programs that the tests notice."""
    if not full or not mutation.available():
        reason = "part of --full, or python -m experiments.benchmarks.mutation, beside the tests"
        settings["not_measured"]["mutation.killed"] = reason
        return {"mutation.killed": None}
    found = list(mutation.tried(HOUR, seed, list(mutation.TARGETS), lambda message: None))
    settings["mutation.survivors"] = [str(each) for each in found if not each.killed]
    return mutation.figures(found)


def _in_turn() -> Iterator[anytime.Module]:
    while True:
        yield from MISBEHAVING.values()
