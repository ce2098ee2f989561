"""Optuna as a rival: the same text, define-by-run."""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from experiments.benchmarks.rivals.random_keys import (
    Problem,
    exponential_quantile,
    normal_quantile,
)
from experiments.benchmarks.rivals.trail import Stop, Trail, Watch

_FEW = 16


class TrialRng:
    """Answers a program's calls with the suggestions of an Optuna trial.

    A choice is named SOURCE#INDEX. Unbounded values are suggested as their quantiles, as Optuna has
    no other prior than the uniform one: random search then comes twice as near on NAO's plans.
    ordered: choices among few are suggested as integers, for samplers that know numbers only.
    """

    def __init__(self, trial: Any, *, ordered: bool = False) -> None:
        self._trial = trial
        self._ordered = ordered
        self._calls: dict[str, int] = {}

    def _name(self, source: str) -> str:
        index = self._calls.get(source, 0)
        self._calls[source] = index + 1
        return f"{source}#{index}"

    def flip(self, source: str, p: float = 0.5) -> bool:
        """True with probability p under random search."""
        return self._trial.suggest_float(self._name(source), 0.0, 1.0) < p

    def randint(self, source: str, n: int) -> int:
        """An integer below n."""
        if n > _FEW or self._ordered:
            return self._trial.suggest_int(self._name(source), 0, n - 1)
        return self._trial.suggest_categorical(self._name(source), range(n))

    def gaussian(self, source: str, mean: float, sigma: float) -> float:
        """A normal value."""
        return mean + sigma * normal_quantile(self.uniform(source, 0.0, 1.0))

    def uniform(self, source: str, low: float, high: float) -> float:
        """A value between low and high."""
        return self._trial.suggest_float(self._name(source), low, high)

    def categorical(self, source: str, weights: Sequence[float]) -> int:
        """An index; Optuna takes all of them for equally likely."""
        return self.randint(source, len(weights))

    def exponential(self, source: str, scale: float) -> float:
        """An exponential value of mean scale."""
        return scale * exponential_quantile(self.uniform(source, 0.0, 1.0))

    def lognormal(self, source: str, mean: float, sigma: float) -> float:
        """The exponential of a normal value."""
        return math.exp(self.gaussian(source, mean, sigma))


def _search(
    sampler: Callable[[Any, int], Any],
    problem: Problem,
    budget_seconds: float,
    target: float,
    seed: int,
    *,
    ordered: bool = False,
) -> Trail:
    optuna = importlib.import_module("optuna")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    function, world = problem.function, problem.world
    watch = Watch(
        lambda trial: function(TrialRng(trial, ordered=ordered), world), budget_seconds, target
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = optuna.create_study(sampler=sampler(optuna.samplers, seed))
        try:
            while True:
                trial = study.ask()
                study.tell(trial, watch(trial))
        except Stop:
            return watch.trail


optuna_random = partial(_search, lambda samplers, seed: samplers.RandomSampler(seed=seed))
optuna_tpe = partial(_search, lambda samplers, seed: samplers.TPESampler(seed=seed))
optuna_ga = partial(
    _search, lambda samplers, seed: samplers.NSGAIISampler(population_size=50, seed=seed)
)
optuna_cma = partial(_search, lambda samplers, seed: samplers.CmaEsSampler(seed=seed), ordered=True)
