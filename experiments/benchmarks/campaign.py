"""Campaigns: the same bytes whoever dies, what keeping costs, intervals and promises that hold."""

from __future__ import annotations

import functools
import importlib.util
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import anytime
import compiler
from anytime import Machine, ProfileLibrary, WorkClock
from anytime.calibrating import calibrate
from anytime.confidence import regret_bounds
from anytime.outcomes import SCHEMA
from experiments.benchmarks.clusters import cluster
from experiments.benchmarks.figures import (
    RESAMPLES,
    Benchmark,
    Figures,
    bounded,
    median_interval,
    ratio_interval,
    share_interval,
)
from experiments.benchmarks.footprint import footprint
from experiments.domains import MACHINE, Domain, cross, domain, plan_across
from planners.path_finding import Cell
from sensing.vision import Sensor

SIZE = 64  # cells of a domain
WORKED = MACHINE.with_rate("search", 0.001)
CLOCK = functools.partial(WorkClock, WORKED)
TRAP = "ANYTIME_BENCH_TRAP"
"""Names a file: the process that comes upon it removes it and dies of SIGKILL."""
WANTED = 0.05  # bound of the regret at which a synthetic campaign stops
_TURNS = 7  # of measuring with a store and without
SOON = 300  # problems of a synthetic campaign that are looked at first
TAIL = 0.3  # spread of the logarithm of what a step takes on the other machine
FACTORS = {"see": 1.5, "plan_across": 3.0}


@anytime.module(
    quality=lambda plan, problem: plan_across.score(plan, problem),
    estimate=lambda plan: plan.estimate,
)
def search(sensor: Sensor, start: Cell, goal: Cell) -> Iterator[Any]:
    """The paper's ATP on the domain as it is."""
    trap = os.environ.get(TRAP)
    if trap and Path(trap).exists():
        Path(trap).unlink(missing_ok=True)
        os.kill(os.getpid(), signal.SIGKILL)
    from planners import paper_atp

    blocked = (~sensor.free).astype(np.float32) * np.float32(0.999)
    for step in paper_atp.steps(blocked, start, goal):
        anytime.charge(step.work)
        yield step.plan


@anytime.module(quality=lambda value: value)
def nothing(start: float) -> Iterator[float]:
    """Next to no work, so that what is measured is the campaign itself."""
    anytime.charge(1)
    yield start
    anytime.charge(1)
    yield min(1.0, start + 0.1)


def domains(count: int, seed: int, size: int = SIZE) -> list[Domain]:
    """The paper's floors, corner to corner."""
    return [domain("r20", size, index, seed) for index in range(count)]


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """Equality over four ways of measuring, overhead, speed, and two promises of statistics."""
    count = 200 if quick else 10_000 if full else 1000
    settings: dict[str, Any] = {
        "runs": count,
        "store": SCHEMA,
        "cells": SIZE,
        "synthetic_campaigns": 2000,
        "not_measured": {},
    }
    figures: Figures = {}
    with tempfile.TemporaryDirectory() as folder:
        figures |= _equality(Path(folder), count, seed, settings, progress)
        progress("overhead of a serial campaign")
        figures |= overhead(Path(folder), 200 if quick else 1000)
    progress("synthetic campaigns that stop when they look good")
    figures |= _coverage(2000, seed)
    progress("promises on a machine that is slower")
    figures |= _calibrated(*((150, 150) if quick else (400, 1200)), seed)
    progress("what importing costs")
    figures |= footprint()
    return Benchmark("campaign", figures, settings, seed)


def _equality(
    folder: Path, count: int, seed: int, settings: dict[str, Any], progress: Callable[[str], None]
) -> Figures:
    """Whether the ways agree, and runs a second on two processes."""
    problems = domains(count, seed)
    progress(f"{count} runs here")
    first = _bytes(folder / "serial", _measured(problems))
    progress(f"{count} runs in 2 processes, one killed")
    began = time.perf_counter()
    with _trap(folder / "processes"):
        library = _measured(problems, executor="processes:2")
    took = time.perf_counter() - began
    second = _bytes(folder / "p", library)
    progress("a campaign is killed and resumed")
    same = {"processes": first == second, "resumed": first == _resumed(folder, count, seed)}
    if importlib.util.find_spec("distributed"):
        progress(f"{count} runs on a Dask cluster, one worker killed")
        with _trap(folder / "dask"), cluster(2) as address:
            same["dask"] = first == _bytes(folder / "d", _measured(problems, executor=address))
    else:
        settings["not_measured"]["equal.dask"] = "distributed is not installed"
    ways = {f"equal.{name}": int(equal) for name, equal in same.items()}
    return {"equal.bytes": int(all(same.values())), **ways, "runs_per_s": count / took}


def _measured(problems: list[Domain], **where: Any) -> ProfileLibrary:
    return anytime.measure(search, problems, seconds=1.0, clock=CLOCK, **where)


@contextmanager
def _trap(file: Path) -> Generator[None]:
    """The first worker that is begun in here kills itself. Raises RuntimeError if none did."""
    file.touch()
    os.environ[TRAP] = str(file)
    try:
        yield
    finally:
        del os.environ[TRAP]
    if file.exists():
        raise RuntimeError("no worker was killed")


def _bytes(folder: Path, library: ProfileLibrary) -> dict[str, bytes]:
    library.save(folder)
    return {name: (folder / name).read_bytes() for name in ("search.profile", "machine.json")}


def _resumed(folder: Path, count: int, seed: int) -> dict[str, bytes]:
    """Measured by a process that is killed half-way, and here from what it left."""
    store = folder / "search.runs"
    code = (
        "from pathlib import Path\nfrom experiments.benchmarks import campaign\n"
        f"campaign._measured(campaign.domains({count}, {seed}), store=Path({str(store)!r}))"
    )
    begun = subprocess.Popen([sys.executable, "-c", code])
    while not store.exists() or store.read_bytes().count(b"\n") < count // 2:
        if begun.poll() is not None:
            raise RuntimeError("the campaign ended before it could be killed")
        time.sleep(0.01)
    begun.kill()
    begun.wait()
    return _bytes(folder / "resumed", _measured(domains(count, seed), store=store))


def overhead(folder: Path, count: int) -> Figures:
    """Milliseconds that a serial campaign with a store adds to a run, and how many
    times as fast it would be without."""
    problems = [anytime_problem(index / count) for index in range(count)]
    clock = functools.partial(WorkClock, Machine("bench").with_rate("nothing", 0.001))
    differences: list[float] = []
    plain: list[float] = []
    for turn in range(_TURNS + 1):
        took: list[float] = []
        for where in ({}, {"executor": "serial", "store": folder / f"{turn}.runs"}):
            began = time.perf_counter()
            anytime.measure(nothing, problems, seconds=1.0, clock=clock, **where)
            took.append(1e3 * (time.perf_counter() - began) / count)
        if turn:  # the first is warmer for the second
            differences.append(took[1] - took[0])
            plain.append(took[0])
    return {
        "overhead.serial_ms": float(np.median(differences)),
        "plain_ms": float(np.median(plain)),
        **median_interval("overhead.vs_plain", np.array(plain) / np.add(plain, differences)),
    }


def anytime_problem(start: float) -> Any:
    """A problem of `nothing`."""
    from types import SimpleNamespace

    return SimpleNamespace(name=f"{start}", start=start)


def _coverage(campaigns: int, seed: int) -> Figures:
    """How often the true regret is within its bound when a campaign stops by it, and how often an
    interval for a fixed number of runs is, used in the same way."""
    covered: list[bool] = []
    fixed: list[bool] = []
    ended: list[int] = []
    for number in range(campaigns):
        rng = np.random.default_rng([seed, number])
        truth, values = _synthetic(rng)
        chosen, bounds = regret_bounds(values[:SOON])  # most are over by then
        if bounds[-1] > WANTED:
            chosen, bounds = regret_bounds(values)
        regret = truth.max() - truth[chosen]
        last = _first(bounds <= WANTED)
        covered.append(bool(regret[last] <= bounds[last] + 1e-12))
        ended.append(last + 1)
        naive = _fixed(values[: len(chosen)], chosen)
        last = _first(naive <= WANTED)
        fixed.append(bool(regret[last] <= naive[last] + 1e-12))
    return {
        **share_interval("coverage.until_regret", covered),
        "coverage.fixed_intervals": float(np.mean(fixed)),
        **ratio_interval("coverage.vs_fixed_intervals", covered, fixed),
        "coverage.problems_median": float(np.median(ended)),
    }


def _synthetic(rng: np.random.Generator, choices: int = 6, count: int = 1500) -> tuple[Any, Any]:
    """Qualities [count, choices] of choices that are nearly alike on problems that differ, and
    their true means."""
    level = np.clip(rng.normal(0.6, 0.1) - 0.06 * rng.random(choices), 0.05, 0.95)
    strength = rng.uniform(4, 30)
    hard = rng.beta(strength, strength, size=(count, 1))  # of the problem, shared by all
    own = rng.random((count, choices))
    # A choice succeeds on a problem with a probability whose mean is its level.
    shared = np.where(own < 0.5, hard, rng.beta(strength, strength, size=(count, choices)))
    return level, (2.0 * level - 1.0).clip(0) + shared * 2.0 * np.minimum(level, 1.0 - level)


def _first(small: Any) -> int:
    """The index of the first that is True, else the last one."""
    return int(np.argmax(small)) if small.any() else len(small) - 1


def _fixed(values: Any, chosen: Any) -> Any:
    """The usual 95 % bound of each difference, for a number of problems that was fixed before."""
    count = np.arange(1, len(values) + 1)[:, None]
    bounds = np.ones(len(values))
    for choice in np.unique(chosen):
        difference = values - values[:, [choice]]
        mean = np.cumsum(difference, axis=0) / count
        spread = np.cumsum(difference**2, axis=0) / count - mean**2
        upper = mean + 1.645 * np.sqrt(np.maximum(spread, 0.0) / count)
        here = (chosen == choice) & (count[:, 0] >= 5)
        bounds[here] = np.maximum(upper, 0.0).max(axis=1)[here]
    return bounds


class _Elsewhere(WorkClock):
    """Another machine: each module slower by its own factor, its steps with a heavier tail."""

    def __init__(self, seed: int) -> None:
        super().__init__(MACHINE)
        self._rng = np.random.default_rng(seed)

    def spend(self, module: str, work: float, step: int | None) -> None:
        tail = float(self._rng.lognormal(-0.5 * TAIL**2, TAIL))
        super().spend(module, work * FACTORS.get(module, 1.0) * tail, step)


def _calibrated(problems: int, unseen_problems: int, seed: int) -> Figures:
    """The greatest error of a promise made from profiles of one machine, ten problems of which
    were run again on another, against the mean on problems never seen, lived there."""
    learned = domains(problems, seed + 1, 32)
    there = functools.partial(WorkClock, MACHINE)
    library = anytime.measure(cross, learned, seconds=8.0, clock=there, seed=seed)
    seeds = iter(range(10**6))
    found = calibrate(library, cross, learned, clock=lambda: _Elsewhere(next(seeds)), seed=seed)
    moved, still = compiler.compile(cross, found.library), compiler.compile(cross, library)
    unseen = domains(unseen_problems, seed + 2, 32)
    budgets = (0.5, 1.0, 2.0, 4.0)
    lived = np.array([_lived(moved, budget, unseen, seeds) for budget in budgets])
    drawn = np.random.default_rng(0).integers(len(unseen), size=(RESAMPLES, len(unseen)))
    errors, resampled = (
        [
            np.abs(np.array([each.promise(budget) for budget in budgets]) - means).max(axis=-1)
            for each in (moved, still)
        ]
        for means in (lived.mean(axis=1), lived[:, drawn].mean(axis=2).T)
    )
    ratios = {f"calibrated.ratio_{each.module}": each.ratio for each in found.modules}
    return {
        "calibrated.promise_error": float(errors[0]),
        "uncalibrated.promise_error": float(errors[1]),
        **bounded("calibrated.vs_uncalibrated", errors[1] / errors[0], resampled[1] / resampled[0]),
        **ratios,
    }


def _lived(
    compiled: compiler.CompiledProgram, budget: float, problems: list[Domain], seeds: Iterator[int]
) -> list[float]:
    """Qualities achieved on the other machine; nothing in time counts 0."""
    found: list[float] = []
    for each in problems:
        inputs = {"sensor": each.sensor, "start": each.start, "goal": each.goal}
        result = compiled.run(budget, clock=_Elsewhere(next(seeds)), **inputs)
        found.append(plan_across.score(result.value, each) if result else 0.0)
    return found
