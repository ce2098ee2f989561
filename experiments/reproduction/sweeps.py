"""What the papers leave open, swept: the claims of [ZR93] on other floors and of other tasks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from experiments.reproduction import abstraction, tasks
from experiments.reproduction.abstraction import Floors
from experiments.reproduction.claims import Value, Verdict, judge
from experiments.reproduction.ways import OURS, PAPER, Way

SIZES, FAMILIES = (32, 64, 128, 256), ("r10", "r15", "r20", "r30")
"""Of floors: cells a side, and the share of them that is blocked."""
COUNT, QUICK_COUNT = 60, 30
TIMED = 6
"""Draws, of a batch each, of what is said on average."""


@dataclass(frozen=True)
class Sweep:
    """One table: a row for each setting, a column for each figure of the paper's."""

    title: str
    columns: tuple[str, ...]
    paper: tuple[float, ...]
    rows: dict[str, tuple[Verdict, ...]]


def sweeps(quick: bool) -> tuple[Sweep, ...]:
    """The tables that the page shows."""
    count = QUICK_COUNT if quick else COUNT
    sizes, families = (SIZES[:-1], ("r10", "r20")) if quick else (SIZES, FAMILIES)
    return floors(sizes, families, count), values(count)


def floors(sizes: Sequence[int], families: Sequence[str], count: int) -> Sweep:
    """The paper's planner on floors of other sizes and densities."""
    swept = {
        "level 3": (0.826, "drawing", abstraction.level3, count),
        "level 1/0": (0.985, "drawing", abstraction.level10, count),
        "at completion": (0.93, "mean", abstraction.final_quality, count),
        "work / A*": (0.27, "mean", abstraction.final_work, TIMED),
        "time / A*": (0.27, "mean", abstraction.final_time, TIMED),
        "time / fastest A*": (0.27, "mean", abstraction.time_over_fastest, TIMED),
    }
    rows: dict[str, tuple[Verdict, ...]] = {}
    for family, size in itertools.product(families, sizes):
        cells: list[Verdict] = []
        for paper, kind, draw, draws in swept.values():
            drawn = [draw(seed, PAPER, Floors(family, size))[0] for seed in range(draws)]
            cells.append(judge(Value(paper, kind), drawn))  # pyright: ignore[reportArgumentType]
        rows[f"{int(family[1:])} % of {size} × {size} blocked"] = tuple(cells)
    title = "The paper's planner by size and density of the floor"
    return Sweep(title, tuple(swept), tuple(row[0] for row in swept.values()), rows)


def values(count: int) -> Sweep:
    """The share of the promised task value that is not achieved, by what the task is worth."""
    ways: tuple[Way, ...] = (PAPER, OURS)
    rows: dict[str, tuple[Verdict, ...]] = {}
    for value in tasks.VALUES:
        gaps = [partial(tasks.within_4, way=way, value=value) for way in ways]
        cells = [
            judge(Value(tasks.ERROR, "mean", "less"), [gap(seed)[0] for seed in range(count)])
            for gap in gaps
        ]
        rows[f"{value.kind}, {value.seconds:g} s"] = tuple(cells)
    title = "The share of the promised task value that is not achieved, by its course over time"
    return Sweep(title, ("the paper's policy", "ours"), (tasks.ERROR, tasks.ERROR), rows)
