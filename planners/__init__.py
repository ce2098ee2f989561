"""How a robot finds its way: path finding, abstract plans, and avoidance of what is in the way."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
