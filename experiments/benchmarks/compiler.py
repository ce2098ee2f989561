"""The compiler against brute force, and above MIN and MAX. [ZR93] Fig. 8."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from anytime import Deadline, WorkClock
from anytime import measure as measure_profiles
from compiler import CompiledProgram, compile
from compiler.baselines import divided, maximal, maximal_shares, minimal, minimal_shares
from compiler.division import divide
from experiments.benchmarks import (
    compiler_adaptive,
    compiler_constructs,
    compiler_export,
    compiler_interruption,
    compiler_watching,
)
from experiments.benchmarks.compiler_advice import measure_advice, measure_rover
from experiments.benchmarks.compiler_constructs import KINDS
from experiments.benchmarks.compiler_engine import engine_figures
from experiments.benchmarks.compiler_promises import measure_promises
from experiments.benchmarks.compiler_trees import mismatch, random_program
from experiments.benchmarks.figures import Benchmark, Figures, ratio_interval
from experiments.domains import MACHINE, Domain, cross, domain

FAMILY, SIZE = "r20", 128
UNSEEN = 100  # problems that the profiles never saw


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """Fig. 8 on measured profiles and on unseen problems; trees and DAGs against brute force."""
    problems = 200 if quick else 300
    progress(f"measuring on {problems} domains")
    library = measure_profiles(
        cross,
        [domain(FAMILY, SIZE, index, seed) for index in range(problems)],
        seconds=3.0,
        clock=lambda: WorkClock(MACHINE),
        seed=seed,
    )
    compiled = compile(cross, library)
    budgets = np.linspace(compiled.least, float(compiled.frontier.budgets[-1]), 400)
    promised = divided(compiled.tables, divide(compiled.tables), budgets)
    better = np.maximum(minimal(compiled.tables, budgets), maximal(compiled.tables, budgets))
    figures: Figures = {
        "fig8.below_min_max": int((promised < better - 1e-4).sum()),
        "fig8.gain": float((promised - better).max()),
        "fig8.gain_at_s": float(budgets[int((promised - better).argmax())]),
    }
    progress(f"running on {UNSEEN} domains never seen")
    unseen = [domain(FAMILY, SIZE, index, seed + 1) for index in range(UNSEEN)]
    figures |= _unseen(compiled, unseen, count=8 if quick else 16)
    progress("sequences of contracts, and the same in C")
    figures |= compiler_interruption.measure(compiled, unseen, quick=quick, seed=seed)
    in_c, not_measured = compiler_export.measure(compiled, programs=12 if quick else 42, seed=seed)
    figures |= in_c
    trees, dags = (200, 100) if quick else (2000, 1000)
    progress(f"{trees} trees and {dags} DAGs against brute force")
    rng = np.random.default_rng(seed)
    figures["tree.mismatches"] = sum(mismatch(random_program(rng, False)) for _ in range(trees))
    figures["tree.count"] = trees
    figures["dag.mismatches"] = sum(mismatch(random_program(rng, True)) for _ in range(dags))
    figures["dag.count"] = dags
    each = 40 if quick else 400
    progress(f"{each} programs with each construct against living every division")
    wrong = {kind: compiler_constructs.mismatches(kind, each, seed) for kind in KINDS}
    figures["constructs.mismatches"] = sum(wrong.values())
    figures |= {f"constructs.{kind}": count for kind, count in wrong.items()}
    progress("adaptive schedules on chains with bad luck")
    figures |= compiler_adaptive.measure(3 if quick else 12, seed)
    inside, below = compiler_watching.measure(2 if quick else 8, seed)
    figures |= inside
    figures["adaptive.below_static"] = (figures["adaptive.below_static"] or 0) + below
    for part in (measure_promises, measure_advice, measure_rover):
        figures |= part(quick=quick, seed=seed, progress=progress)
    figures["dag5.mismatches"] = sum(
        mismatch(random_program(rng, True, calls=5)) for _ in range(dags)
    )
    engine, how = engine_figures(quick, seed, progress)
    figures |= engine
    if engine["vs_cpsat"] is None:
        not_measured["vs_cpsat"] = str(how["vs_cpsat"])
    settings = how | {
        "family": FAMILY,
        "size": SIZE,
        "problems": problems,
        "unseen": UNSEEN,
        "unseen_error": "of the program's mean; unseen_below_paired: of the difference",
        "not_measured": not_measured,
    }
    return Benchmark("compiler", figures, settings, seed)


def _unseen(compiled: CompiledProgram, problems: Sequence[Domain], count: int) -> Figures:
    """Budgets at which running the program is worse than MIN or MAX by more than the standard
    error of its mean; and, sharper, by more than that of the paired difference. Over all budgets,
    its quality over theirs."""
    ends = compiled.least, float(compiled.frontier.budgets[-1])
    below, below_paired, gains = 0, 0, []
    totals = {name: np.zeros(len(problems)) for name in ("ours", "min", "max")}
    for budget in np.geomspace(*ends, count):
        achieved = _achieved(compiled, problems, float(budget), None)
        totals["ours"] += achieved
        for name, shares_of in (("min", minimal_shares), ("max", maximal_shares)):
            shares = shares_of(compiled.tables, float(budget))
            rival = _achieved(compiled, problems, float(budget), shares)
            totals[name] += rival
            difference = achieved - rival
            error = achieved.std(ddof=1) / np.sqrt(len(problems))
            paired = difference.std(ddof=1) / np.sqrt(len(problems))
            below += bool(difference.mean() < -error - 1e-9)
            below_paired += bool(difference.mean() < -paired - 1e-9)
            gains.append(float(difference.mean()))
    return {
        "fig8.unseen_below": below,
        "fig8.unseen_below_paired": below_paired,
        "fig8.unseen_gain": max(gains),
        "fig8.unseen_budgets": count,
        **ratio_interval("fig8.unseen_vs_min", totals["ours"], totals["min"]),
        **ratio_interval("fig8.unseen_vs_max", totals["ours"], totals["max"]),
    }


def _achieved(
    compiled: CompiledProgram,
    problems: Sequence[Domain],
    budget: float,
    shares: Sequence[float] | None,
) -> np.ndarray:
    """True quality of what was there at the deadline, by the compiled division or given shares;
    0 where there was nothing."""
    output = compiled.labels[-1]
    qualities = np.zeros(len(problems))
    if shares is not None and min(shares) < 0:
        return qualities
    for index, problem in enumerate(problems):
        inputs = {"sensor": problem.sensor, "start": problem.start, "goal": problem.goal}
        clock = WorkClock(MACHINE)
        deadline = Deadline.after(budget, clock)
        in_time: list[object] = []

        def keep(label: str, value: object, change: object, kept=in_time, until=deadline) -> None:
            if label == output and not until.remaining() < 0:
                kept.append(value)

        rng = np.random.default_rng([index])
        if shares is None:
            compiled.run(deadline=deadline, rng=rng, on_result=keep, **inputs)
        else:
            named = dict(zip(compiled.labels, shares, strict=True))
            dict(compiled.stages(named, deadline, inputs, rng=rng, on_result=keep))
        if in_time:
            qualities[index] = compiled.program.output.module.score(in_time[-1], problem)
    return qualities
