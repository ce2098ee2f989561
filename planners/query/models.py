"""Models: probabilistic programs, which are plain functions of `rng` and a world. [PRP16] §2."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import cached_property, update_wrapper
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from planners.query import native, reading, worlds
from planners.query.choices import Address
from planners.query.sources import Replay


class Model:
    """A probabilistic program: `function(rng)` or `function(rng, world)` returns what to minimise.

    Called, it runs plain: `model(Rng(7), world)`.
    """

    def __init__(self, function: Callable[..., float]) -> None:
        parameters = list(inspect.signature(function).parameters.values())
        needed = [p for p in parameters if p.default is p.empty and p.kind != p.VAR_KEYWORD]
        if not 1 <= len(needed) <= 2 or len(parameters) > 2:
            raise AnytimeError(
                f"{function.__name__} takes {len(parameters)} parameters; a model takes rng, or "
                "rng and a world"
            )
        self.function = function
        self.name = function.__name__
        self.takes_world = len(parameters) == 2
        self._native: dict[np.dtype, native.Native] = {}
        update_wrapper(self, function)

    def __call__(self, rng: Any, world: Any = None) -> float:
        return self.function(rng, _namespace(world)) if self.takes_world else self.function(rng)

    def replay(self, choices: Mapping[Address, Any], world: Any = None) -> float:
        """Run the model plain with these choices: for a debugger, prints, coverage.

        world: a mapping of names to values, or None. Raises ModelError if it asks for others.
        """
        return self(Replay(choices), world)

    @cached_property
    def text(self) -> reading.Text:
        """The model's text. Raises ModelError, and NativeError for what has no native form."""
        return reading.read(self.function)

    def native(self, world: worlds.World) -> native.Native:
        """The native form for worlds of this layout. Raises NativeError if there is none."""
        if world.layout not in self._native:
            self._native[world.layout] = native.make(self.text, world.layout, self.takes_world)
        return self._native[world.layout]

    def __repr__(self) -> str:
        return f"<model {self.function.__name__}>"


def model(function: Callable[..., float]) -> Model:
    """Make a probabilistic program of a function of `rng`, or of `rng` and a world.

    Each call like `rng.gaussian("walk", 0, 1)` is a choice, addressed by its source and by how
    many calls to the source came before. The function returns what a query minimises.
    Raises AnytimeError for a function with other parameters.
    """
    return Model(function)


def _namespace(world: Any) -> Any:
    return worlds.plain(world) if isinstance(world, Mapping) else world
