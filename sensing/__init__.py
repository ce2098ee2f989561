"""What a robot senses: maps, their files and quad-tree, random floors, anytime vision, belief."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
