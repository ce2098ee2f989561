"""Anytime computation: modules that improve while they are given time, and their profiles."""

import lazy_loader as _lazy

from anytime import neighbours as _neighbours

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)

_neighbours.check()
