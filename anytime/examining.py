"""How fast and how quiet this machine is: what may be measured on it in real time."""

from __future__ import annotations

import os
import platform
import time
from dataclasses import dataclass

import numpy as np

from anytime import plugins
from anytime.pictures import duration

CONTRACT = 0.01  # seconds of an empty loop to a deadline
LOOPS = 20_000  # turns of the loop whose speed is taken
UNSTEADY = 1.5  # times its median that the loop takes at the 95th percentile
BUSY = 0.75  # processes a core above which others take a share, however steadily
LATE = 0.005  # seconds past its deadline at the 99th percentile, above which the machine is noisy


@dataclass(frozen=True)
class Examination:
    """What was found.

    turns: of an empty loop of Python a second, at the median. unsteady: its 95th percentile /
    median. late_p50, late_p99, late_max: seconds by which an empty loop misses a deadline.
    load: processes that want a core, a core; None where it is not told. broken: a line for each
    package whose modules or commands cannot be loaded.
    """

    cores: int
    load: float | None
    turns: float
    unsteady: float
    late_p50: float
    late_p99: float
    late_max: float
    broken: tuple[str, ...]

    @property
    def quiet(self) -> bool:
        """Whether profiles may be measured here in real time."""
        free = self.load is None or self.load <= BUSY
        return free and self.late_p99 <= LATE and self.unsteady <= UNSTEADY

    def __repr__(self) -> str:
        load = "" if self.load is None else f", {self.load:.1f} processes want each"
        late = ", ".join(map(duration, (self.late_p50, self.late_p99, self.late_max)))
        lines = [
            f"Python {platform.python_version()} on {platform.system()} {platform.machine()}",
            f"cores    {self.cores}{load}",
            f"speed    {self.turns / 1e6:.1f} million turns of an empty loop a second",
            f"noise    the loop takes {self.unsteady:.2f} times its median at the 95th percentile",
            f"deadline missed by {late} by an empty loop (half, 99 %, all of the time)",
            "quiet enough to measure in real time"
            if self.quiet
            else "too noisy to measure in real time: free the machine, or measure on a WorkClock",
        ]
        return "\n".join([*lines, *(f"broken: {line}" for line in self.broken)])


def examine(seconds: float = 2.0) -> Examination:
    """Measure speed and noise of this machine for about so many seconds."""
    loops: list[float] = []
    late: list[float] = []
    until = time.perf_counter() + seconds
    while time.perf_counter() < until or len(late) < 20:
        began = time.perf_counter()
        for _ in range(LOOPS):
            pass
        loops.append(time.perf_counter() - began)
        ends = time.perf_counter() + CONTRACT
        while (now := time.perf_counter()) < ends:
            pass
        late.append(now - ends)
    median = float(np.median(loops))
    p50, p99 = (float(value) for value in np.quantile(late, [0.5, 0.99]))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    cores = cores or 1
    return Examination(
        cores=cores,
        load=os.getloadavg()[0] / (os.cpu_count() or 1) if hasattr(os, "getloadavg") else None,
        turns=LOOPS / median,
        unsteady=float(np.quantile(loops, 0.95)) / median,
        late_p50=p50,
        late_p99=p99,
        late_max=max(late),
        broken=tuple(plugins.broken()),
    )
