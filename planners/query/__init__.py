"""Optimisation queries over probabilistic programs, by a genetic algorithm. [PRP16] §2, §4."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
