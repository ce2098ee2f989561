"""The compiler: from a program of anytime modules to the best division of any amount of time."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
