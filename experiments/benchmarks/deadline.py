"""How far modules run over their deadline, beside what the machine itself runs over."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import anytime
from anytime import naming
from anytime.workers import workers
from experiments.benchmarks.figures import Benchmark, Figures, bounded
from experiments.benchmarks.misbehaving import well_behaved

CONTRACT = 0.05  # seconds
STEP = 5e-4  # seconds of a step in process
NOISY = 5.0  # ms over a deadline of an empty loop, p99, above which the machine is too noisy
TRIES = 3
_RESAMPLED = 1000
WARM = 20  # trials of each way that are not counted

LOADS = {"free": 0, "busy": 1, "oversubscribed": 2}
"""Busy processes a core, of each condition."""


@anytime.module()
def steps() -> Iterator[int]:
    """Short steps of plain Python, for ever."""
    done = 0
    while True:
        until = time.perf_counter() + STEP
        while time.perf_counter() < until:
            pass
        yield (done := done + 1)


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """Overrun of 50 ms contracts in process and isolated, each beside an empty loop to the same
    deadline in the same second."""
    count = 5000 if full else 150 if quick else 1000
    settings: dict[str, Any] = {"contract_s": CONTRACT, "trials": count, "not_measured": {}}
    figures: Figures = {}
    progress(f"free: {count} contracts")
    figures |= free(count, settings)
    for load in ("busy", "oversubscribed"):
        progress(f"{load}: {count} contracts")
        figures |= _figures(load, *_trials(_in_process, count, LOADS[load]))
    progress(f"isolated, cores busy: {count} contracts")
    figures |= _figures("isolated_busy", *_trials(_isolated, count, LOADS["busy"]))
    progress(f"isolated, cores free: {count} contracts")
    figures |= _figures("isolated_free", *_trials(_isolated, count, 0))
    workers.close()
    return Benchmark("deadline", figures, settings, seed)


def free(count: int, settings: dict[str, Any]) -> Figures:
    """Overrun in process with the cores free; repeated while the machine is too noisy to tell."""
    for repeated in range(TRIES):
        floor, over = _trials(_in_process, count, 0)
        settings["floor_repeated"] = repeated
        if _p99(floor) <= NOISY:
            break
    settings["machine"] = "too noisy" if _p99(floor) > NOISY else "quiet enough"
    return {"floor.p99_ms": float(_p99(floor)), **_figures("free", floor, over)}


def overrun_of_nothing(seconds: float = CONTRACT) -> float:
    """Milliseconds by which an empty loop misses a deadline: the machine's own."""
    until = time.perf_counter() + seconds
    while (now := time.perf_counter()) < until:
        pass
    return 1e3 * (now - until)


@contextmanager
def burning(processes: int) -> Generator[None]:
    """So many processes that do nothing but use a core."""
    begun = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for each in begun:
            each.kill()
        for each in begun:
            each.wait()


def _trials(run: Callable[[], float], count: int, load: int) -> tuple[np.ndarray, np.ndarray]:
    """Milliseconds over the deadline of the empty loop [count], and of the module [count]."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with burning(load * (cores or 1)):
        for _ in range(WARM):
            overrun_of_nothing()
            run()
        rows = [(overrun_of_nothing(), run()) for _ in range(count)]
    return np.array([floor for floor, _ in rows]), np.array([over for _, over in rows])


def _in_process() -> float:
    return _overrun(steps)


def _isolated() -> float:
    warm_up(well_behaved)
    return _overrun(well_behaved)


def warm_up(module: anytime.Module, seconds: float = 30.0) -> None:
    """Wait until a worker process is ready."""
    worker = workers.take(naming.address(module.function), time.perf_counter() + seconds)
    if worker is not None:
        workers.give(worker)


def _overrun(module: anytime.Module) -> float:
    """Milliseconds over the deadline, seen from outside; < 0 when it was back before."""
    until = time.perf_counter() + CONTRACT
    anytime.run(module, deadline=anytime.Deadline(anytime.WallClock(), until))
    return 1e3 * (time.perf_counter() - until)


def _figures(name: str, floor: np.ndarray, over: np.ndarray) -> Figures:
    late = np.maximum(over, 0.0)
    drawn = np.random.default_rng(0).integers(len(late), size=(_RESAMPLED, len(late)))
    p99s = _p99(floor), _p99(late)
    resampled = _p99(floor[drawn]), _p99(late[drawn])
    return {
        f"{name}.p50_ms": float(np.quantile(late, 0.5)),
        f"{name}.p99_ms": float(np.quantile(late, 0.99)),
        f"{name}.max_ms": float(late.max()),
        f"{name}.over_floor_p50_ms": float(np.quantile(late, 0.5) - np.quantile(floor, 0.5)),
        f"{name}.floor_p99_ms": float(p99s[0]),
        **bounded(f"{name}.over_floor_p99_ms", p99s[1] - p99s[0], resampled[1] - resampled[0]),
        **bounded(f"{name}.vs_floor", _returned(*p99s), _returned(*resampled)),
    }


def _p99(late: np.ndarray) -> np.ndarray:
    """Of neighbouring pairs, resampled together. A p99 of a thousand rests on ten of them."""
    return np.quantile(late, 0.99, axis=-1)


def _returned(floor: np.ndarray, late: np.ndarray) -> np.ndarray:
    """Milliseconds of contract and overrun after which an empty loop has ended, over ours."""
    return (1e3 * CONTRACT + floor) / (1e3 * CONTRACT + late)
