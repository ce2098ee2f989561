"""Advice confirmed by really slowing a module; the promise of a real program of many modules."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from anytime import WorkClock
from anytime import measure as measure_profiles
from compiler import compile
from experiments import rover
from experiments.benchmarks.compiler_promises import FAMILIES, MACHINE, achieved, cases

ADVISED = ("smooth", "hard chain", "ladder")
SLOW = 2e-3  # seconds a unit, twice those of `MACHINE`
Figures = dict[str, float | int | None]


def measure_advice(*, quick: bool, seed: int, progress: Callable[[str], None]) -> Figures:
    """`advise.error`: what advice says of a module that is 2× slow, made fast again, against the
    difference between running the program with it slow and as it is, on problems never seen."""
    unseen = cases(200 if quick else 600, seed + 99)
    errors: list[float] = []
    for name in ADVISED[: 1 if quick else None]:
        progress(f"advice for the family {name!r}")
        program = FAMILIES[name]()
        library = measure_profiles(
            program, cases(300, seed), seconds=0.06, clock=lambda: WorkClock(MACHINE), seed=seed
        )
        normal = compile(program, library)
        for module in library:
            machine = MACHINE.with_rate(module, SLOW)
            slowed = compile(program, library, machine=machine)
            ends = slowed.least, float(slowed.frontier.budgets[-1])
            for budget in np.geomspace(*ends, 5)[1:4].tolist():
                changes = slowed.advise(budget).changes
                told = next(c for c in changes if c.label == module and c.what == "2× faster")
                fast = achieved(normal, unseen, budget).mean()
                slow = achieved(slowed, unseen, budget, machine).mean()
                errors.append(abs(told.gain - float(fast - slow)))
    return {
        "advise.error": max(errors),
        "advise.mean_error": float(np.mean(errors)),
        "advise.cases": len(errors),
    }


def measure_rover(*, quick: bool, seed: int, progress: Callable[[str], None]) -> Figures:
    """`real.modules`, `real.promise_error`: the rover compiled and run on turns never seen."""
    known, unseen = (30, 30) if quick else (80, 80)
    progress(f"measuring the rover on {known} turns")
    library = measure_profiles(
        rover.turn,
        rover.turns(known, seed),
        seconds=1.0,
        clock=lambda: WorkClock(rover.MACHINE),
        seed=seed,
    )
    progress("compiling the rover, and running it on as many new turns to calibrate its promises")
    recorded = compile(rover.turn, library)
    compiled = recorded.calibrated(
        rover.turns(known, seed + 50), clock=lambda: WorkClock(rover.MACHINE), seed=seed
    )
    progress(f"running the rover on {unseen} turns never seen")
    found = compiled.validate(
        rover.turns(unseen, seed + 99), clock=lambda: WorkClock(rover.MACHINE), seed=seed
    )
    from_recordings = [abs(recorded.promise(row.seconds) - row.achieved) for row in found.rows]
    return {
        "real.modules": len(compiled.labels),
        "real.promise_error": found.error,
        "real.promise_error_from_recordings": max(from_recordings),
        "real.budgets": len(found.rows),
        "real.budgets_held": sum(row.holds for row in found.rows),
        "real.quality": found.rows[-1].achieved,
    }
