"""The genetic algorithm of our queries as a C++ program, on the same choices: what a query costs
in the language of [PRP16], built where a compiler is."""

from __future__ import annotations

import shutil
import statistics
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from planners.nao_plan import plan
from planners.query import Operators, Query

SOURCES = Path(__file__).parent / "cpp"
VARIANTS = {"slots": "Slots", "tags": "Tags"}
"""How the program knows a choice's source: by a number in its code, or by the string tag that is
looked up at every choice, as [PRP16] §2 has it."""

FLAGS = (
    *("-std=c++17", "-O3", "-march=native"),
    # sqrt and floor as single instructions: nobody reads errno or the floating-point flags
    *("-fno-math-errno", "-fno-trapping-math"),
    # a multiplication and an addition fused into one round once instead of twice: other bits than
    # numba's and CPython's, so other choices. The second switch is for g++ 12, which fuses them
    # (vfmaddsub) in this pass although the first forbids it; here the pass gains nothing.
    *("-ffp-contract=off", "-fno-tree-slp-vectorize"),
)

WARM_UP = 100
"""Generations before the clock starts."""


@dataclass(frozen=True)
class Timing:
    """What some generations took, and where they led.

    seconds: CPU-seconds of the thread. value: of the best. hash: FNV-1a over the best's choices in
    the order of the calls, so that two equal ones went the same way.
    """

    evaluations: int
    seconds: float
    value: float
    hash: int

    @property
    def rate(self) -> float:
        """Evaluations a CPU-second."""
        return self.evaluations / self.seconds


@dataclass(frozen=True)
class Comparison:
    """Ours beside the C++ program.

    ratios: evaluations a second, ours over theirs, a pair each. same: the share of the pairs whose
    best values and choices were equal, bit for bit.
    """

    ratios: tuple[float, ...]
    same: float
    ours: float
    theirs: float

    @property
    def ratio(self) -> float:
        """The median of the pairs."""
        return statistics.median(self.ratios)


def compiler() -> str | None:
    """The C++ compiler of this machine, if it has one."""
    return shutil.which("g++")


def build(folder: Path, variant: str = "slots") -> Path:
    """Build the program for this machine. Raises AnytimeError where that is not possible."""
    if variant not in VARIANTS:
        raise AnytimeError(f"variant {variant!r}; choose {' or '.join(VARIANTS)}")
    command = compiler()
    if command is None:
        raise AnytimeError("g++ is not installed; install it to compare with the C++ program")
    binary = folder / variant
    names = f"-DNAMES={VARIANTS[variant]}"
    ran = subprocess.run(
        [command, *FLAGS, names, str(SOURCES / "main.cpp"), "-o", str(binary)],
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode != 0:
        said = next((line for line in ran.stderr.splitlines() if "error" in line), ran.stderr)
        raise AnytimeError(f"g++ refused the C++ program: {said.strip()}")
    return binary


def run(
    binary: Path,
    world: Mapping[str, Any],
    operators: Operators | None = None,
    population: int = 60,
    seed: int = 0,
    generations: int = 2000,
    warm_up: int = WARM_UP,
) -> Timing:
    """Optimise plans with the C++ program. The seed is at most 2^53, the parameters are `Query`'s.

    Raises AnytimeError if the program fails.
    """
    settings = {
        **world,
        **asdict(operators or Operators()),
        "population": population,
        "seed": seed,
        "generations": generations,
        "warm_up": warm_up,
    }
    settings["smallest_step"], settings["largest_step"] = settings.pop("steps")
    lines = [
        " ".join([name, *(float(number).hex() for number in np.ravel(value))])
        for name, value in settings.items()
    ]
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("\n".join(lines) + "\n")
        file.flush()
        ran = subprocess.run([str(binary), file.name], capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise AnytimeError(f"the C++ program failed: {ran.stderr.strip() or ran.returncode}")
    evaluations, seconds, value, digest = ran.stdout.split()
    return Timing(int(evaluations), float(seconds), float.fromhex(value), int(digest, 16))


def ours(
    world: Mapping[str, Any],
    operators: Operators | None = None,
    population: int = 60,
    seed: int = 0,
    generations: int = 2000,
    warm_up: int = WARM_UP,
) -> Timing:
    """Optimise the same plans with our query, native, in this process and thread."""
    query = Query(plan, world, population=population, seed=seed, operators=operators)
    query.step(warm_up)
    before = query.evaluations
    begun = time.thread_time()
    query.step(generations)
    seconds = time.thread_time() - begun
    return Timing(query.evaluations - before, seconds, query.value, _hash(query))


def compare(
    world: Mapping[str, Any],
    variant: str = "slots",
    *,
    pairs: int = 7,
    operators: Operators | None = None,
    population: int = 60,
    seed: int = 0,
    generations: int = 2000,
    progress: Callable[[str], None] = lambda line: None,
) -> Comparison:
    """Run ours and the C++ program in turn, on the same seeds: one seed a pair.

    Raises AnytimeError where the program cannot be built.
    """
    found: list[tuple[Timing, Timing]] = []
    with tempfile.TemporaryDirectory() as folder:
        binary = build(Path(folder), variant)
        for pair in range(pairs):
            inputs = (world, operators, population, seed + pair, generations)
            found.append((ours(*inputs), run(binary, *inputs)))
            one, other = found[-1]
            progress(f"{variant} {pair}: {one.rate:.3g}/s, C++ {other.rate:.3g}/s")
    return Comparison(
        tuple(one.rate / other.rate for one, other in found),
        statistics.mean((a.value, a.hash) == (b.value, b.hash) for a, b in found),
        statistics.median(one.rate for one, _ in found),
        statistics.median(other.rate for _, other in found),
    )


def _hash(query: Query) -> int:
    """FNV-1a over (number of the source, index, value) of the best's choices."""
    numbers = {name: number for number, name in enumerate(query.model.text.names)}
    digest = 0xCBF29CE484222325
    for (source, index), value in query.best.choices.items():
        for byte in struct.pack("=iid", numbers[source], index, float(value)):
            digest = (digest ^ byte) * 0x100000001B3 % 2**64
    return digest
