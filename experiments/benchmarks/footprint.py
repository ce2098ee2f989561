"""What the library costs those who only import it: CPU of an import, of the help, disk space."""

from __future__ import annotations

import re
import resource
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from experiments.benchmarks.figures import Figures

OURS = "anytime-robots"
APART = frozenset({"numpy", "scipy", "opencv-python-headless", "matplotlib", "numba"})
"""Which a robot has anyway: neither they nor what only they need is counted."""
_TURNS = 9


def footprint() -> Figures:
    """CPU-seconds, the least of nine turns, and MB of what is installed."""
    python = [sys.executable]
    return {
        "import.cpu_s": cpu_seconds([*python, "-c", "import anytime"]),
        "help.cpu_s": cpu_seconds([*python, "-m", "anytime", "--help"]),
        "installed.mb": sum(map(_bytes, installed(OURS, APART))) / 1e6,
    }


def cpu_seconds(command: Sequence[str]) -> float:
    """What a command takes of the processor, seconds: the least, for the rest is the machine's."""
    return min(_once(command) for _ in range(_TURNS))


def _once(command: Sequence[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def installed(name: str, apart: frozenset[str]) -> set[str]:
    """A package and what it cannot do without, by distribution, without some and what they need."""
    found: set[str] = set()
    left = [name]
    while left:
        package = left.pop()
        if package in found or package in apart:
            continue
        try:
            needs = distribution(package).requires or []
        except PackageNotFoundError:  # of another platform, or another version of Python
            continue
        found.add(package)
        left += [re.split(r"[^\w.-]", need)[0].lower() for need in needs if "extra ==" not in need]
    return found


def _bytes(package: str) -> int:
    files = distribution(package).files or []
    if package == OURS and not any(file.parts[0] == "anytime" for file in files):
        home = Path(__file__).resolve().parents[2]  # installed to be edited: the wheel's packages
        folders = ("anytime", "compiler", "monitor", "planners", "sensing", "experiments")
        return sum(
            path.stat().st_size
            for folder in folders
            for path in (home / folder).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        )
    paths = (Path(str(file.locate())) for file in files)
    return sum(path.stat().st_size for path in paths if path.is_file())
