"""The monitor: spends a mission's time frame by frame, and says why."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
