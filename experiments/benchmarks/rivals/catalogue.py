"""Who the rivals are, and which of them are here."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from experiments.benchmarks.rivals import trials, vectors
from experiments.benchmarks.rivals.random_keys import Problem
from experiments.benchmarks.rivals.trail import Trail

Search = Callable[[Problem, float, float, int], Trail]

_ONE = Problem(lambda rng, w: rng.uniform("x", 0.0, 1.0), None, {"x": 2})


@cache
def _warm(search: Search) -> None:
    """Let a library import what it imports on first use, once a process: no one's rate is that."""
    for seed in range(3):  # some import at their first candidate, some at their second
        if search(_ONE, 0.01, -math.inf, seed).evaluations > 2:
            return


@dataclass(frozen=True)
class Rival:
    """A library's optimiser, and the packages that it needs."""

    packages: tuple[str, ...]
    run: Search

    def search(self, problem: Problem, budget_seconds: float, target: float, seed: int) -> Trail:
        """Search until the target is reached or the CPU-seconds are spent; imports are free."""
        _warm(self.run)
        return self.run(problem, budget_seconds, target, seed)


RIVALS = {
    "optuna.random": Rival(("optuna",), trials.optuna_random),
    "optuna.tpe": Rival(("optuna",), trials.optuna_tpe),
    "optuna.ga": Rival(("optuna",), trials.optuna_ga),
    "optuna.cma": Rival(("optuna", "cmaes"), trials.optuna_cma),
    "deap": Rival(("deap",), vectors.deap),
    "pymoo.ga": Rival(("pymoo",), vectors.pymoo_ga),
    "pymoo.de": Rival(("pymoo",), vectors.pymoo_de),
    "nevergrad.ngopt": Rival(("nevergrad",), vectors.nevergrad_ngopt),
    "nevergrad.de": Rival(("nevergrad",), vectors.nevergrad_de),
    "nevergrad.oneplusone": Rival(("nevergrad",), vectors.nevergrad_oneplusone),
    "nevergrad.portfolio": Rival(("nevergrad",), vectors.nevergrad_portfolio),
    "pygad": Rival(("pygad",), vectors.pygad),
    "cma": Rival(("cma",), vectors.cma),
    "scipy.de": Rival(("scipy",), vectors.scipy_de),
}
"""The rivals by name, LIBRARY or LIBRARY.ALGORITHM."""


def missing() -> dict[str, str]:
    """The rivals that cannot run here, each with the reason."""
    lacking = {
        name: [package for package in rival.packages if not importlib.util.find_spec(package)]
        for name, rival in RIVALS.items()
    }
    return {
        name: f"{', '.join(packages)} not installed: pip install 'anytime-robots[bench]'"
        for name, packages in lacking.items()
        if packages
    }


def installed() -> dict[str, Rival]:
    """The rivals that can run here."""
    absent = missing()
    return {name: rival for name, rival in RIVALS.items() if name not in absent}
