"""Isolated modules that do what a module must not, after a first good result."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import anytime
from anytime.modules import Limits

GOOD = "good"
_libc = ctypes.CDLL(None)


def _bad(function: Callable[..., Any]) -> anytime.Module:
    """A module that runs where it can do no harm."""
    return anytime.module(isolated=Limits(memory=2**28))(function)


@_bad
def well_behaved() -> Iterator[str]:
    """For comparison: short steps, as long as there is time."""
    while True:
        until = time.perf_counter() + 1e-3
        while time.perf_counter() < until:
            pass
        yield GOOD


@_bad
def loops() -> Iterator[str]:
    """Never comes back to a check-point."""
    yield GOOD
    while True:
        pass


@_bad
def loops_in_c() -> Iterator[str]:
    """Holds the interpreter in one call for a minute."""
    yield GOOD
    sum(range(3_000_000_000))


@_bad
def sleeps_in_c() -> Iterator[str]:
    """Sleeps in a library with the interpreter in its hands."""
    yield GOOD
    ctypes.PyDLL(None).usleep(60_000_000)


@_bad
def masks_signals() -> Iterator[str]:
    """Blocks every signal that can be blocked, and loops."""
    yield GOOD
    signal.pthread_sigmask(signal.SIG_BLOCK, range(1, 32))
    while True:
        with contextlib.suppress(BaseException):
            time.sleep(60)


@_bad
def swallows() -> str:
    """A bare except around what ends a run."""
    while True:
        with contextlib.suppress(BaseException):
            anytime.register(GOOD)


@_bad
def exits() -> Iterator[str]:
    """Leaves without a word."""
    yield GOOD
    os._exit(3)


@_bad
def crashes() -> Iterator[str]:
    """Writes where nothing is."""
    yield GOOD
    ctypes.memset(0, 1, 1)


@_bad
def stops_itself() -> Iterator[str]:
    """Is alive and does nothing, as under a debugger."""
    yield GOOD
    os.kill(os.getpid(), signal.SIGSTOP)


@_bad
def leaks() -> Iterator[str]:
    """Takes memory until there is none."""
    kept: list[Any] = []
    while True:
        kept.append(np.ones(2**22))
        yield GOOD


@_bad
def floods() -> Iterator[str]:
    """As many results as it can."""
    while True:
        yield GOOD


@_bad
def floods_heavily() -> Iterator[Any]:
    """Large results, one after the other."""
    while True:
        yield GOOD, np.zeros(2**19)


@_bad
def prints() -> Iterator[str]:
    """A megabyte a step on both streams."""
    while True:
        os.write(1, b"x" * 2**20)
        print("y" * 2**20, file=sys.stderr)
        yield GOOD


@anytime.module(isolated=True, estimate=lambda value: 0.5 if value == GOOD else float("nan"))
def tells_nan() -> Iterator[str]:
    """A quality that is no number."""
    yield GOOD
    yield "bad"


@anytime.module(isolated=True, estimate=lambda value: 1.0)
def lies() -> Iterator[str]:
    """All that it has is perfect, it says."""
    while True:
        time.sleep(1e-3)
        yield GOOD


@_bad
def unsendable() -> Iterator[Any]:
    """A result that no other process can be told."""
    yield GOOD
    yield lambda: None


@_bad
def too_large() -> Iterator[Any]:
    """A result of half a gigabyte, virtually."""
    yield GOOD
    yield bytes(300 * 2**20)


@_bad
def raises() -> Iterator[str]:
    """An exception."""
    yield GOOD
    raise RuntimeError("as it was told to")


@_bad
def interrupts() -> Iterator[str]:
    """An exception that is the user's."""
    yield GOOD
    raise KeyboardInterrupt


@_bad
def starts_others() -> Iterator[str]:
    """Leaves a thread and a process behind."""
    threading.Thread(target=time.sleep, args=(30,), daemon=True).start()
    subprocess.Popen(["sleep", "30"])
    while True:
        time.sleep(1e-3)
        yield GOOD


@_bad
def hangs_up() -> Iterator[str]:
    """Closes every file, the line to its caller among them."""
    yield GOOD
    os.closerange(3, 256)
    while True:
        time.sleep(1e-3)
        yield "unheard"


@_bad
def talks_nonsense() -> Iterator[str]:
    """Writes into every file that is open."""
    yield GOOD
    for file in range(3, 64):
        with contextlib.suppress(OSError):
            os.write(file, b"\xff" * 100)
    while True:
        time.sleep(1e-3)
        yield "unheard"


MISBEHAVING: dict[str, anytime.Module] = {
    each.name: each
    for each in (
        *(loops, loops_in_c, sleeps_in_c, masks_signals, swallows, exits, crashes, stops_itself),
        *(leaks, floods, floods_heavily, prints, tells_nan, lies, unsendable, too_large, raises),
        *(interrupts, starts_others, hangs_up, talks_nonsense),
    )
}
"""All of them, by name."""
