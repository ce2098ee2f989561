"""Profiles as a log of OMPL's benchmarks, which its statistics tool and Planner Arena read."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np

from anytime.errors import AnytimeError
from anytime.files import write_atomically
from anytime.library import ProfileLibrary
from anytime.profiles import Profile


def write_ompl_log(library: ProfileLibrary, path: Path) -> None:
    """Write the recorded runs of every module as those of a planner, atomically.

    Of each run: time, whether there is a result, its quality, its cost for a module with a cost,
    work, the quality of its inputs. Its progress is the performance profile as recorded: quality,
    and the least cost so far, over time. The format is that of ompl::tools::Benchmark, in the order
    in which `ompl_benchmark_statistics` 2.0.1 insists on it.
    Raises AnytimeError for a library without any profile.
    """
    if not library:
        raise AnytimeError("the library is empty; measure a module before its runs are written")
    write_atomically(path, ("\n".join(_lines(library)) + "\n").encode())


def _lines(library: ProfileLibrary) -> Iterator[str]:
    runs = [run for profile in library.values() for run in profile.recordings]
    yield f"anytime version {version('anytime-robots')}"
    yield "Experiment anytime"
    yield "0 experiment properties"
    yield f"Running on {'-'.join(library.machine.name.split())}"
    yield "Starting at 1970-01-01 00:00:00"  # profiles do not know when they were measured
    yield from ("<<<|", f"profiles of {', '.join(library)}", "|>>>")
    yield from ("<<<|", f"machine {library.machine.name}", "|>>>")
    yield "0 is the random seed"  # each run has one of its own
    yield f"{max(run.end[0] for run in runs):.9g} seconds per run"
    yield "0 MB per run"
    yield f"{max(len(profile.recordings) for profile in library.values())} runs per planner"
    yield f"{sum(run.end[0] for run in runs):.9g} seconds spent to collect the data"
    yield "0 enum types"
    yield f"{len(library)} planners"
    for profile in library.values():
        yield from _planner(profile)


def _planner(profile: Profile) -> Iterator[str]:
    cost = bool(profile.references)
    yield profile.module
    yield "0 common properties"
    columns = ["time REAL", "solved BOOLEAN", "quality REAL", "work REAL"]
    columns += ["solution_cost REAL"] * cost
    columns += [f"input_{name} REAL" for name in profile.inputs]
    yield f"{len(columns)} properties for each run"
    yield from columns
    yield f"{len(profile.recordings)} runs"
    for run, qualities in zip(profile.recordings, profile.qualities, strict=True):
        last = (float(qualities[-1]), float(run.raw[-1])) if len(qualities) else (math.nan,) * 2
        values = [run.end[0], int(len(qualities) > 0), last[0], run.end[1]]
        values += [last[1]] * cost
        values += [run.inputs[name] for name in profile.inputs]
        yield "".join(f"{value:.9g}; " for value in values)
    progress = ["time REAL", "quality REAL", *["best_cost REAL"] * cost]
    yield f"{len(progress)} progress properties for each run"
    yield from progress
    yield f"{len(profile.recordings)} runs"
    for run, qualities in zip(profile.recordings, profile.qualities, strict=True):
        best = np.minimum.accumulate(run.raw) if len(run.raw) else run.raw
        rows: dict[str, list[float]] = {}  # one row a moment, the last
        for seconds, quality, least in zip(run.seconds, qualities, best, strict=True):
            rows[f"{seconds:.9g}"] = [float(quality), *[float(least)] * cost]
        yield "".join(
            ",".join([moment, *(f"{value:.9g}" for value in values)]) + ",;"
            for moment, values in rows.items()
        )
    yield "."
