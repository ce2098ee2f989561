"""Optimisation queries over probabilistic programs, by a genetic algorithm. [PRP16] §2, §4."""

from planners.query.choices import Address, Choices, Solution
from planners.query.errors import ModelError, NativeError
from planners.query.models import Model, model
from planners.query.modules import module
from planners.query.operators import SWITCHES, Operators
from planners.query.plain import Rng
from planners.query.querying import Query
from planners.query.worlds import World, plain

__all__ = [
    "SWITCHES",
    "Address",
    "Choices",
    "Model",
    "ModelError",
    "NativeError",
    "Operators",
    "Query",
    "Rng",
    "Solution",
    "World",
    "model",
    "module",
    "plain",
]
