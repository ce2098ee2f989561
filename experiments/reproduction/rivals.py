"""Every benchmark beside its rivals: measured by its own command, or quickly by its own code."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from anytime.errors import AnytimeError
from experiments.benchmarks.figures import Figures
from experiments.reproduction.catalogue import BENCHMARKS, COMPARISONS
from experiments.reproduction.keeping import Kept
from experiments.reproduction.samples import CUT, SAMPLES

NAME = "rivals"
_MISSED = 1  # exit code of a benchmark that measured what is not good enough


@dataclass(frozen=True)
class Beside:
    """What the benchmarks found: figures and reasons by dotted names, the rows as JSON, and what
    was left out."""

    figures: Figures
    not_measured: dict[str, str]
    rows: tuple[dict[str, Any], ...]
    cut: tuple[str, ...]


def names(quick: bool) -> tuple[str, ...]:
    """The benchmarks, those that take seconds if quick."""
    return tuple(SAMPLES) if quick else BENCHMARKS


def measured(
    benchmarks: Sequence[str],
    kept: Kept,
    quick: bool,
    seed: int,
    progress: Callable[[int, int], None],
) -> Beside:
    """Run benchmarks, each in its standard form or as a sample of it.

    Each is kept when it is done; those that are kept are not run again. Raises AnytimeError when
    one of them breaks.
    """
    find, form = (_sampled, "sample of") if quick else (_benched, "bench")
    figures: Figures = {}
    missing: dict[str, str] = {}
    rows: list[dict[str, Any]] = []
    cut: list[str] = [*CUT] if quick and benchmarks else []
    for done, name in enumerate(benchmarks, 1):
        found = kept.once(f"{form} {name}, seed {seed}", lambda name=name: find(name, seed))
        progress(done, len(benchmarks))
        figures |= {f"{NAME}.{name}.{key}": value for key, value in found["figures"].items()}
        missing |= {f"{NAME}.{name}.{key}": why for key, why in found["not_measured"].items()}
        for each in (each for each in COMPARISONS if each.benchmark == name):
            row, why = each.told(found["figures"]), found["not_measured"].get(each.key)
            if row is not None:
                rows.append(row)
            elif why:
                cut.append(f"{name}: {each.ours} beside {each.rival}: {why}")
    return Beside(figures, missing, tuple(rows), tuple(cut))


def _sampled(name: str, seed: int) -> dict[str, Any]:
    settings: dict[str, Any] = {"not_measured": {}}
    figures = SAMPLES[name](seed, settings)
    return {"figures": figures, "not_measured": settings["not_measured"]}


def _benched(name: str, seed: int) -> dict[str, Any]:
    """The standard form of a benchmark, in a process of its own: some count what theirs holds."""
    words = [sys.executable, "-m", "anytime", "bench", name, "--json", "--seed", str(seed)]
    ran = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False)
    if ran.returncode not in (0, _MISSED):
        raise AnytimeError(
            f"anytime bench {name} ended with {ran.returncode}; what is done is kept, --resume "
            "goes on from there"
        )
    told = json.loads(ran.stdout)
    return {
        "figures": dict(flat(told["figures"])),
        "not_measured": told["settings"].get("not_measured", {}),
    }


def flat(figures: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """Nested objects as dotted names."""
    found: list[tuple[str, Any]] = []
    for key, value in figures.items():
        name = f"{before}{key}"
        found += flat(value, f"{name}.") if isinstance(value, Mapping) else [(name, value)]
    return found
