"""The papers' claims beside our figures, measured in this run."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from experiments.benchmarks.figures import Benchmark
from experiments.reproduction import rivals
from experiments.reproduction.animations import Animated
from experiments.reproduction.claims import Claim, Verdict
from experiments.reproduction.draws import drawn, known, verdicts
from experiments.reproduction.keeping import opened
from experiments.reproduction.pictures import Picture
from experiments.reproduction.rows import SIGNS, bounds, shown
from experiments.reproduction.sweeps import Sweep
from experiments.reproduction.ways import OURS, PAPER

DRAWS, QUICK_DRAWS = 100, 30
FIGURES = "figures"
"""Folder of the pictures, within that of the page."""
CUT = f"--quick: {QUICK_DRAWS} draws a claim of {DRAWS}, smaller sweeps"
NOTHING = "what is claimed does not occur in this way"


@dataclass(frozen=True)
class Judged:
    """A claim and what became of it: verdicts for each of its values, the paper's way and ours."""

    claim: Claim
    papers: tuple[Verdict, ...]
    ours: tuple[Verdict, ...]

    @property
    def held(self) -> bool:
        return all(verdict.held for verdict in self.papers)

    @property
    def held_by_ours(self) -> bool:
        return all(verdict.held for verdict in self.ours)


@dataclass(frozen=True)
class Reproduction:
    """What `reproduce` found, and the pictures and animations that it made.

    comparisons: rows of the table beyond the papers, as JSON.
    """

    judged: tuple[Judged, ...]
    comparisons: tuple[dict[str, Any], ...]
    benchmark: Benchmark
    pictures: tuple[Picture, ...]
    animations: tuple[Animated, ...]

    def __repr__(self) -> str:
        lines: list[str] = []
        if self.judged:
            width = max(len(each.claim.name) for each in self.judged)
            lines.append(
                f"{'claim':<{width}}  {'paper':>7} {'its way':>8}  {'low to high':<18} {'ours':>8}"
            )
            for each in self.judged:
                lines += _rows(each, width)
            held = sum(each.held for each in self.judged)
            lines.append(f"{held} of {len(self.judged)} claims hold in the paper's own way")
        lines += map(_line, self.comparisons)
        lines += map(str, self.benchmark.settings["cut"])  # pyright: ignore[reportArgumentType]
        return "\n".join(lines)


def measure(
    parts: Sequence[str],
    *,
    quick: bool = False,
    seed: int = 0,
    resume: bool = False,
    output: Path = Path(),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Reproduction:
    """Measure the claims of the parts, each in the paper's way and in ours, and draw pictures.

    parts: names of files here, which hold `CLAIMS`, `draw` and `animate`. A draw of all claims is
    one seed; the same seeds serve both ways. What is found is kept beside the page as it comes.
    resume: go on from there; else what is there makes way for the first new finding.
    """
    modules = {
        part: importlib.import_module(f"experiments.reproduction.{part}")
        for part in parts
        if part != rivals.NAME
    }
    claims = tuple(claim for module in modules.values() for claim in module.CLAIMS)
    count = QUICK_DRAWS if quick else DRAWS
    form = "quick " if quick else ""
    with opened(output, anew=not resume) as kept:
        draws = drawn(claims, range(seed, seed + count), kept, progress) if claims else []
        swept = [
            sweep
            for part, module in modules.items()
            for sweep in kept.once(f"{form}sweeps of {part}", lambda m=module: _swept(m, quick))
        ]
        names = rivals.names(quick) if rivals.NAME in parts else ()
        beside = rivals.measured(names, kept, quick, seed, progress)
    judged: list[Judged] = []
    for module in modules.values():
        for claim in module.CLAIMS:
            papers, ours = (verdicts(claim, way, draws) for way in (PAPER, OURS))
            judged.append(Judged(claim, papers, ours))
    pictures = tuple(
        picture for module in modules.values() for picture in module.draw(output / FIGURES, seed)
    )
    animations = tuple(
        each for module in modules.values() for each in module.animate(output / FIGURES, seed)
    )
    missing = dict(beside.not_measured)
    figures = _figures(judged, missing) | beside.figures
    settings = {
        "parts": list(parts),
        "quick": quick,
        "draws": count,
        **{name: told for module in modules.values() for name, told in module.settings().items()},
        "cut": [*[CUT] * bool(quick and modules), *beside.cut],
        "not_measured": missing,
        "claims": {each.claim.name: each.claim.text for each in judged},
        "sweeps": swept,
        "comparisons": list(beside.rows),
        "pictures": list(map(_shown, pictures)),
        "animations": list(map(_shown, animations)),
    }
    benchmark = Benchmark("reproduce", figures, settings, seed)
    return Reproduction(tuple(judged), beside.rows, benchmark, pictures, animations)


def _shown(each: Picture | Animated) -> dict[str, str]:
    return {"part": each.part, "file": f"{FIGURES}/{each.file.name}", "caption": each.caption}


def _swept(module: ModuleType, quick: bool) -> list[dict[str, object]]:
    return [_told(sweep) for sweep in module.sweeps(quick)]


def _told(sweep: Sweep) -> dict[str, object]:
    """A sweep as JSON: ours, low and high in each cell."""
    return {
        "title": sweep.title,
        "columns": list(sweep.columns),
        "paper": list(sweep.paper),
        "rows": {
            name: [[known(x) for x in (each.ours, each.low, each.high)] for each in cells]
            for name, cells in sweep.rows.items()
        },
    }


def _figures(judged: Sequence[Judged], missing: dict[str, str]) -> dict[str, float | int | None]:
    """By key; why one is null goes to `missing`."""
    figures: dict[str, float | int | None] = {
        "claims.total": len(judged),
        "claims.held": sum(each.held for each in judged),
    }
    for each in judged:
        rows = zip(each.claim.values, each.papers, each.ours, strict=True)
        for value, papers, ours in rows:
            key = ".".join(part for part in ("claim", each.claim.name, value.name) if part)
            told = {
                f"{key}.paper": value.paper,
                f"{key}.ours": papers.ours,
                f"{key}.low": papers.low,
                f"{key}.high": papers.high,
                f"{key}.held": papers.held if value.name else each.held,
                f"{key}.ours_best": ours.ours,
                f"{key}.held_by_ours": ours.held if value.name else each.held_by_ours,
            }
            missing |= {name: NOTHING for name, it in told.items() if math.isnan(it)}
            figures |= {name: known(it) for name, it in told.items()}
    return figures


def _rows(each: Judged, width: int) -> list[str]:
    lines: list[str] = []
    for value, papers, ours in zip(each.claim.values, each.papers, each.ours, strict=True):
        first = not value.name
        held, best = (each.held, each.held_by_ours) if first else (papers.held, ours.held)
        sign = "holds" if held else "only ours" if best else "no"
        name = each.claim.name if first else f"  {value.name}"
        bounds = f"{_number(papers.low)} to {_number(papers.high)}"
        lines.append(
            f"{name:<{width}}  {_number(value.paper):>7} {_number(papers.ours):>8}  {bounds:<18} "
            f"{_number(ours.ours):>8}  {sign:<9}  {each.claim.text if first else ''}".rstrip()
        )
    return lines


def _line(row: Mapping[str, Any]) -> str:
    """A comparison with a rival as text."""
    return (
        f"{row['benchmark']:<9} {shown(row['times']):>7} {bounds(row):>18}  "
        f"{SIGNS[row['verdict']]:<8}  {row['ours']} | {row['rival']}"
    )


def _number(value: float) -> str:
    return shown(known(value))
