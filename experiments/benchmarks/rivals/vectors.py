"""Libraries that optimise vectors, each searching over a program's random keys."""

from __future__ import annotations

import importlib
import math
import random
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from experiments.benchmarks.rivals.random_keys import Problem
from experiments.benchmarks.rivals.trail import Restart, Stop, Trail, Watch

_FOREVER = 10**9
# A stalled search begins again after a patience, in evaluations: without it, half of the runs of
# every genetic algorithm here stay in a local optimum for good.


def _watched(
    run: Callable[[Watch, int, int], object],
    problem: Problem,
    budget_seconds: float,
    target: float,
    seed: int,
    *,
    patience: float = math.inf,
) -> Trail:
    """Search `run(objective, size, seed)`, again from another seed when it ends or stalls."""
    watch = Watch(problem.objective(), budget_seconds, target, patience=patience)
    with warnings.catch_warnings(), suppress(Stop):
        warnings.simplefilter("ignore")
        for restart in count():
            with suppress(Restart):
                run(watch, problem.size, seed + 1000 * restart)
    return watch.trail


@contextmanager
def _seeded(seed: int) -> Iterator[None]:
    """Seed the global generators that libraries draw from, and give them back as they were."""
    ours, numpys = random.getstate(), np.random.get_state()  # noqa: NPY002
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(ours)
        np.random.set_state(numpys)  # noqa: NPY002


def deap(problem: Problem, budget_seconds: float, target: float, seed: int) -> Trail:
    """DEAP's (mu + lambda) evolution.

    Of some thirty settings the fastest on NAO's plans: a small population that mutates one to four
    keys, most of them anew, and begins again soon. DEAP's own polynomial mutation takes thrice as
    long.
    """
    base, tools, algorithms = (
        importlib.import_module(f"deap.{part}") for part in ("base", "tools", "algorithms")
    )

    class Fitness(base.Fitness):
        weights = (-1.0,)

    class Individual(list[float]):
        def __init__(self, keys: Any) -> None:
            super().__init__(keys)
            self.fitness = Fitness()

        def __deepcopy__(self, memo: Any) -> Individual:
            other = Individual(self)
            other.fitness.values = self.fitness.values
            return other

    def mutate(individual: Individual) -> tuple[Individual]:
        for _ in range(random.randint(1, 4)):
            at = random.randrange(len(individual))
            key = random.random()
            if random.random() > 0.7:
                key = individual[at] + random.gauss(0.0, 1.0) * 10.0 ** random.uniform(-3.0, -0.5)
            individual[at] = min(1.0, max(0.0, key))
        return (individual,)

    def run(watch: Watch, size: int, seed: int) -> None:
        box = base.Toolbox()
        box.register("evaluate", lambda individual: (watch(list(individual)),))
        box.register("mate", tools.cxUniform, indpb=0.5)
        box.register("mutate", mutate)
        box.register("select", tools.selBest)
        people = [Individual(random.random() for _ in range(size)) for _ in range(10)]
        algorithms.eaMuPlusLambda(people, box, 10, 20, 0.3, 0.7, _FOREVER, verbose=False)

    with _seeded(seed):
        return _watched(run, problem, budget_seconds, target, seed, patience=1000)


def _pymoo(
    algorithm: Callable[[int], Any], problem: Problem, budget: float, target: float, seed: int
) -> Trail:
    minimize = importlib.import_module("pymoo.optimize").minimize
    base = importlib.import_module("pymoo.core.problem").Problem
    termination = importlib.import_module("pymoo.core.termination").NoTermination

    def run(watch: Watch, size: int, seed: int) -> None:
        class Keys(base):
            def _evaluate(self, x: Any, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
                out["F"] = np.array([[watch(keys)] for keys in x])

        keys = Keys(n_var=size, n_obj=1, xl=0.0, xu=1.0)
        minimize(keys, algorithm(size), termination(), seed=seed, copy_algorithm=False)

    return _watched(run, problem, budget, target, seed, patience=2000)


def _pymoo_ga(size: int) -> Any:
    part = partial(importlib.import_module, package="pymoo.operators")
    return importlib.import_module("pymoo.algorithms.soo.nonconvex.ga").GA(
        pop_size=100,
        crossover=part(".crossover.ux").UniformCrossover(),
        mutation=part(".mutation.pm").PM(prob_var=2.0 / size, eta=10),
        eliminate_duplicates=False,
    )


def _pymoo_de(size: int) -> Any:
    module = importlib.import_module("pymoo.algorithms.soo.nonconvex.de")
    return module.DE(pop_size=70, variant="DE/best/1/bin", CR=0.9)


pymoo_ga = partial(_pymoo, _pymoo_ga)
pymoo_de = partial(_pymoo, _pymoo_de)


def _nevergrad(
    name: str, patience: int, problem: Problem, budget: float, target: float, seed: int
) -> Trail:
    nevergrad = importlib.import_module("nevergrad")

    def run(watch: Watch, size: int, seed: int) -> None:
        keys = nevergrad.p.Array(init=np.full(size, 0.5), lower=0.0, upper=1.0)
        keys.random_state.seed(seed % 2**32)
        # The budget steers NGOpt's choice of an algorithm: what 20 s allow at its pace.
        search = nevergrad.optimizers.registry[name](parametrization=keys, budget=20_000)
        while True:
            asked = search.ask()
            search.tell(asked, watch(asked.value))

    with _seeded(seed):
        return _watched(run, problem, budget, target, seed, patience=patience)


nevergrad_ngopt = partial(_nevergrad, "NGOpt", 3000)
nevergrad_de = partial(_nevergrad, "TwoPointsDE", 2000)
nevergrad_oneplusone = partial(_nevergrad, "OnePlusOne", 500)
nevergrad_portfolio = partial(_nevergrad, "PortfolioDiscreteOnePlusOne", 1000)


def pygad(problem: Problem, budget_seconds: float, target: float, seed: int) -> Trail:
    """PyGAD's genetic algorithm."""
    library = importlib.import_module("pygad")
    people = 50

    def run(watch: Watch, size: int, seed: int) -> None:
        def fitness(search: Any, keys: Any, index: Any) -> list[float]:
            return [-watch(one) for one in keys]

        library.GA(
            num_generations=_FOREVER,
            sol_per_pop=people,
            num_parents_mating=20,
            num_genes=size,
            fitness_func=fitness,
            fitness_batch_size=people,
            init_range_low=0.0,
            init_range_high=1.0,
            gene_space={"low": 0.0, "high": 1.0},
            parent_selection_type="sss",
            crossover_type="uniform",
            mutation_probability=2.0 / size,
            keep_elitism=2,
            random_seed=seed,
            suppress_warnings=True,
        ).run()

    with _seeded(seed):
        return _watched(run, problem, budget_seconds, target, seed, patience=2000)


def cma(problem: Problem, budget_seconds: float, target: float, seed: int) -> Trail:
    """CMA-ES in the box of the keys, begun again where it stalls: BIPOP's restarts find less."""
    library = importlib.import_module("cma")

    def run(watch: Watch, size: int, seed: int) -> None:
        options = {"bounds": [0.0, 1.0], "popsize": 30, "seed": seed + 1, "verbose": -9}
        library.fmin2(watch, np.random.default_rng(seed).random(size), 0.2, options)

    with _seeded(seed):
        return _watched(run, problem, budget_seconds, target, seed, patience=2000)


def scipy_de(problem: Problem, budget_seconds: float, target: float, seed: int) -> Trail:
    """SciPy's differential evolution: as many people as keys, begun again when they agree."""
    evolution = importlib.import_module("scipy.optimize").differential_evolution

    def run(watch: Watch, size: int, seed: int) -> None:
        evolution(
            watch,
            [(0.0, 1.0)] * size,
            strategy="best1bin",
            popsize=1,
            mutation=(0.3, 0.8),
            recombination=0.8,
            maxiter=100_000,
            tol=1e-2,
            polish=False,
            rng=np.random.default_rng(seed),
        )

    return _watched(run, problem, budget_seconds, target, seed)
