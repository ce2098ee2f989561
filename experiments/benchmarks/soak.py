"""Mission after mission in one process, for minutes or hours: what of its memory is not given back.

Faulty missions with their logs, written and read, and isolated modules that misbehave. The same
missions come again and again: the warm-up has seen the largest, so what still grows is kept.
"""

from __future__ import annotations

import gc
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import linregress
from scipy.stats import t as student

import anytime
from anytime.workers import workers
from compiler import CompiledProgram
from experiments import crossings
from experiments.benchmarks import faulty_missions
from experiments.benchmarks.misbehaving import MISBEHAVING
from monitor.log_reading import read_log
from monitor.logs import Floor, write_log

Floats = NDArray[np.float64]

WARM = 1 / 3  # of the time, after which memory should stay as it is
FASTEST = 50  # missions a second
ROUND = 100  # missions, after which they come again
_BLOCKS = 24  # of the time after that; neighbouring samples hang together, blocks hardly
_EVERY = 20  # missions between two runs of an isolated module
_CONTRACT = 0.02  # seconds of that


@dataclass(frozen=True)
class Soaked:
    """What was seen of the process.

    rows: seconds, MB resident, file descriptors, children after each mission [missions, 4].
    """

    missions: int
    raised: int
    rows: Floats

    def settled(self) -> Floats:
        """The rows after the warm-up [samples, 4]."""
        return self.rows[self.rows[:, 0] >= WARM * self.rows[-1, 0]]

    def grown(self) -> tuple[int, int]:
        """File descriptors and children: how many more at the least in the second half than in the
        first. What is not given back is always there; a spare worker that is just being started
        comes and goes, and on a busy machine takes longer for it."""
        first, second = np.array_split(self.settled()[:, 2:], 2)
        more = second.min(axis=0) - first.min(axis=0)
        return int(more[0]), int(more[1])

    def mb_per_hour(self) -> tuple[float, float, float]:
        """Slope of memory after the warm-up, with its 95 % interval: least squares over blocks."""
        settled = self.settled()
        return slope(settled[:, 0] / 3600.0, settled[:, 1])


def slope(times: Floats, values: Floats) -> tuple[float, float, float]:
    """Least squares over the means of blocks, with the 95 % interval. times, values: [n >= 3]."""
    blocks = min(_BLOCKS, len(times))
    x, y = (
        np.array([part.mean() for part in np.array_split(series, blocks)])
        for series in (times, values)
    )
    fit: Any = linregress(x, y)  # its type knows no fields
    stray = float(np.nan_to_num(fit.stderr))  # NaN where nothing changes at all
    wide = float(student.ppf(0.975, blocks - 2)) * stray
    return float(fit.slope), float(fit.slope) - wide, float(fit.slope) + wide


def soaked(seconds: float, seed: int) -> Soaked:
    """Soak in a new process, which nothing has warmed."""
    words = [sys.executable, "-m", "experiments.benchmarks.soak", str(seconds), str(seed)]
    ran = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    found = json.loads(ran.stdout.splitlines()[-1])
    return Soaked(found["missions"], found["raised"], np.array(found["rows"]))


def soak(program: CompiledProgram, seconds: float, seed: int) -> Soaked:
    """Live missions for so many seconds, here."""
    # As much as it can come to, and touched: what is noted here must not look like a leak.
    rows = np.full((FASTEST * int(seconds) + 3, 4), math.nan)
    raised, number, began = 0, 0, time.perf_counter()
    misbehaving = list(MISBEHAVING.values())
    with TemporaryDirectory() as folder:
        while (now := time.perf_counter() - began) < seconds and number < len(rows):
            drawn = faulty_missions.drawn(program, number % ROUND, seed)
            raised += bool(_lived(program, drawn, Path(folder) / "log.jsonl"))
            if number % _EVERY == 0:
                module = misbehaving[number // _EVERY % len(misbehaving)]
                anytime.run(module, seconds=_CONTRACT)
            gc.collect()
            rows[number] = now, *_held()
            number += 1
    workers.close()
    return Soaked(number, raised, rows[:number])


def _lived(program: CompiledProgram, drawn: faulty_missions.FaultyMission, log: Path) -> str:
    """Live one, write its log and read it; what was raised."""
    lived = faulty_missions.live(program, drawn)
    if lived.report is not None:
        floor = drawn.crossing
        told = Floor(floor.free, floor.start, floor.goal, 0)
        write_log(log, faulty_missions.MISSION, told, lived.report)
        read_log(log)
    return lived.raised


def _held() -> tuple[float, int, int]:
    """MB resident, file descriptors, children of this process (Linux)."""
    process = Path("/proc/self")
    pages = int((process / "statm").read_text().split()[1])
    children = (process / "task" / str(os.getpid()) / "children").read_text().split()
    megabytes = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    return megabytes, len(os.listdir(process / "fd")), len(children)


def main(arguments: Sequence[str]) -> None:
    """Soak for so many seconds, from that seed; one line of JSON."""
    seconds, seed = arguments
    found = soak(crossings.compiled(), float(seconds), int(seed))
    print(json.dumps(vars(found) | {"rows": found.rows.tolist()}))


if __name__ == "__main__":
    main(sys.argv[1:])
