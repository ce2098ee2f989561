"""What [ZR93] §3.5 and §4 say of conditional profiles and of compiling sensing and planning."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from anytime import ProfileLibrary, WorkClock, measure
from compiler import CompiledProgram, compile
from compiler.baselines import divided as divided_by_tables
from compiler.baselines import maximal, minimal
from compiler.curves import curve
from compiler.division import divide
from compiler.sequencing import acceleration_ratio, doubled, least_ratio
from experiments.benchmarks.compiler_trees import mismatch, random_program
from experiments.domains import MACHINE, cross, cross_anywhere, domain
from experiments.reproduction.abstraction import FAMILY, SIZE
from experiments.reproduction.ways import PAPER, Way

DOMAINS = 30
"""Random domains of one draw; the paper says "many times"."""
SECONDS = 3.0  # of the work clock, for each run that is measured
VISION = (0.8, 0.9, 0.96, 1.0)
"""Qualities of vision whose curves are compared, as in Fig. 7."""
BUDGETS = 200
CLOSE = 1e-4
"""Expected qualities that differ by less are equal."""
_NOISE = 0.005  # by which a curve of a finite sample may be out of order


@dataclass(frozen=True, eq=False)
class Divided:
    """Sensing and planning, measured and compiled."""

    library: ProfileLibrary
    compiled: CompiledProgram
    planner: str

    @property
    def budgets(self) -> NDArray[np.float64]:
        """Seconds, from the least that gives a plan to what suffices for everything."""
        return np.linspace(self.compiled.least, float(self.compiled.frontier.budgets[-1]), BUDGETS)

    def divided(self) -> NDArray[np.float64]:
        """The compiled profile, expected quality for each budget, by the profiles as MIN's and
        MAX's are. A program that is run drops divisions that do not stand on other domains."""
        tables = self.compiled.tables
        return divided_by_tables(tables, divide(tables), self.budgets)

    def pinned(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Those of MIN and of MAX."""
        tables, budgets = self.compiled.tables, self.budgets
        return minimal(tables, budgets), maximal(tables, budgets)

    def curves(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """The conditional profile: expected quality by vision and time, [V, T]."""
        profile = self.library[self.planner]
        return np.array([profile.given(sensed=quality).mean(times) for quality in VISION])


@lru_cache(maxsize=2)  # one seed, both ways
def divided(seed: int, way: Way, count: int = DOMAINS) -> Divided:
    """Measure `count` random domains that no other seed has, and compile."""
    program = cross if way is PAPER else cross_anywhere
    floors = [domain(FAMILY, SIZE, index, seed) for index in range(count)]
    library = measure(program, floors, seconds=SECONDS, clock=lambda: WorkClock(MACHINE), seed=seed)
    planner = program.output.module.name
    return Divided(library, compile(program, library), planner)


# --- The claims, one draw each.


def conditional_ordered(seed: int, way: Way) -> bool:
    """Better vision promises better plans: at no time is its curve below that of worse vision, and
    in the end it is above."""
    times = np.linspace(0.0, SECONDS, 61)
    steps = np.diff(divided(seed, way).curves(times), axis=0)
    return bool((steps >= -_NOISE).all() and (steps[:, -1] > 0.0).all())


def tree_optimal(seed: int, way: Way) -> bool:
    """Of a random tree of anytime modules, the compiled profile is that of brute force. Both ways
    are one: a module at a time, bottom up."""
    return not mismatch(random_program(np.random.default_rng((seed, 8)), False))


def compiled_above_min_max(seed: int, way: Way) -> bool:
    """At every budget the compiled profile is at least MIN's and MAX's, somewhere above both."""
    found = divided(seed, way)
    better = np.maximum(*found.pinned())
    apart = found.divided() - better
    return bool(apart.min() >= -CLOSE and apart.max() > CLOSE)


def interruptible(seed: int, way: Way) -> tuple[float, ...]:
    """How many times as long an interruptible sequence of contracts takes at worst to be as good as
    one contract: each twice as long as the one before [RZ91]; of ours, the best lengths."""
    compiled = divided(seed, way).compiled
    steps = curve(compiled.frontier.budgets, compiled.frontier.promised, compiled.name)
    if way is PAPER:
        return (acceleration_ratio(steps, doubled(steps, float(steps.lengths[0]))),)
    return (least_ratio(steps),)
