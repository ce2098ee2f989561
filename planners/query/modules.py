"""An optimisation query as an anytime module."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

import anytime
from anytime.modules import Module, Score
from planners.query.choices import Solution
from planners.query.models import Model
from planners.query.operators import Operators
from planners.query.querying import Query


def module(
    model: Model,
    world: Callable[..., Mapping[str, Any]],
    *,
    quality: Score | None = None,
    cost: Score | None = None,
    estimate: Score | None = None,
    problems: Callable[..., Any] | None = None,
    name: str | None = None,
    population: int = 60,
    operators: Operators | None = None,
) -> Module:
    """Make an anytime module that searches for a model's best choices and registers each better
    `Solution`; an evaluation of the model is a unit of its work.

    world: makes the model's world from the module's inputs, whose names are its parameters.
    quality, cost, estimate, problems, name: as for `anytime.module`.
    """

    def search(*inputs: Any, rng: np.random.Generator) -> Iterator[Solution | None]:
        seed = int(rng.integers(2**63))
        query = Query(model, world(*inputs), population=population, seed=seed, operators=operators)
        best = float("inf")
        while True:
            query.step()
            anytime.charge(query.size)
            found = query.value
            yield query.best if found < best else None
            best = min(best, found)

    parameters = list(inspect.signature(world).parameters.values())
    generator = inspect.Parameter("rng", inspect.Parameter.KEYWORD_ONLY)
    search.__signature__ = inspect.Signature([*parameters, generator])  # type: ignore[attr-defined]
    return anytime.module(
        quality=quality,
        cost=cost,
        estimate=estimate,
        problems=problems,
        name=name or f"find_{model.name}",
    )(search)
