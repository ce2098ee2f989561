"""Optimisation queries over probabilistic programs, by a genetic algorithm. [PRP16] §2, §4."""

from .choices import Address, Choices, Solution
from .errors import ModelError, NativeError
from .models import Model, model
from .modules import module
from .operators import SWITCHES, Operators
from .querying import Query
from .sources import Rng
from .worlds import World, plain

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
