"""Keeping the garbage collector out of contracts: a full collection takes tens of milliseconds."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager

from anytime.clocks import Deadline, WallClock

LONGEST = 1.0  # seconds for which garbage may be left lying


@contextmanager
def undisturbed(deadline: Deadline) -> Generator[None]:
    """No collection until this is left, if the time is real and short; else as it was.

    What has piled up is collected by and by after it, outside of the contract.
    """
    short = isinstance(deadline.clock, WallClock) and deadline.remaining() <= LONGEST
    if not short or not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@contextmanager
def settled(real: bool) -> Generator[None]:
    """What exists now is not looked at by any collection until this is left; `real`: else nothing.

    For the length of a mission: a collection between frames then costs what the mission itself has
    made, not what was loaded before.
    """
    if not real:
        yield
        return
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
