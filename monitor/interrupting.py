"""Ctrl-C and its kind during a mission: the first stops the robot, a second ends the program."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """Whether the mission was told to end, and by which signal; hears: whether it can be."""

    def __init__(self) -> None:
        self.signal: int | None = None
        self.hears = False

    def __bool__(self) -> bool:
        return self.signal is not None

    def hear(self, number: int, frame: FrameType | None) -> None:
        self.signal = self.signal or number
        # A module may catch this, so the mission asks the object as well.
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Generator[Interruption]:
    """Hear the signals that end a mission until this is left; elsewhere than in the main thread
    they cannot be heard, and go where they went before."""
    heard = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return
    heard.hears = True
    before = {number: signal.signal(number, heard.hear) for number in SIGNALS}
    try:
        yield heard
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
