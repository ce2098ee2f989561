"""What a worker process and its caller tell each other: kinds of letters, and what they hold."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

READY, JOB, BEGUN, POST, LAST, STOP, GO, DONE, LEAVE = (bytes([code]) for code in b"RJBPLSGDA")
BEGINS = struct.Struct("<d")
"""Of a beginning: its time on `time.perf_counter`, as the caller may read of it late."""
POSTED = struct.Struct("<d?dI")
"""Of a check-point: time, whether there is a value, its estimate or NaN, the number of charges."""
GRACE = 0.1
"""Seconds after its deadline in which a module may come to its next check-point."""


@dataclass(frozen=True)
class Job:
    """What a worker is to run, and until when on `time.perf_counter`.

    told: the time on the caller's clock, which the worker is told again after each check-point;
    None in real time.
    """

    module: tuple[str, str, str]
    inputs: tuple[Any, ...]
    filled: dict[str, Any]
    memory: int
    ends: float
    told: float | None = None
