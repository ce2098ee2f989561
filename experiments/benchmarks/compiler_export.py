"""Exported divisions of time against Python's, and what a look-up costs in C."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.programs import Call, Input, Program
from compiler import CompiledProgram
from compiler.calibrating import AS_IT_IS
from compiler.division import Frontier, divide
from compiler.exporting import Exported, exported
from compiler.headers import header, identifier, identifiers
from compiler.tables import Table
from experiments.benchmarks.compiler_constructs import KINDS, random_tables, read, sketch

Budgets = NDArray[np.int32]
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror")
AS_CPP = ("-x", "c++", "-std=c++11", "-pedantic", "-Wall", "-Wextra", "-Werror")
LOOKUPS = 2_000_000
REPEATS = 11


def measure(
    compiled: CompiledProgram, *, programs: int, seed: int
) -> tuple[dict[str, float | int | None], dict[str, str]]:
    """Figures `export.*`, and the reasons of those that are None.

    compiled: a program from measured profiles. programs: how many with random divisions, and how
    many with random tables.
    """
    if shutil.which("gcc") is None:
        return {"export.mismatches": None, "export.ns": None}, {
            "export.mismatches": "there is no gcc",
            "export.ns": "there is no gcc",
        }
    rng = np.random.default_rng([seed, 6])
    every = [
        compiled,
        *(from_divisions(random_frontier(rng), f"f{number}") for number in range(programs)),
        *(constructed(KINDS[n % len(KINDS)], rng, f"c{n}") for n in range(programs)),
    ]
    tables = [exported(each) for each in every]
    asked = [budgets_for(each, rng) for each in tables]
    wrong = sum(
        mismatches(each, budgets, answers)
        for each, budgets, answers in zip(every, asked, look_up(tables, asked), strict=True)
    )
    largest = max(tables, key=lambda each: len(each.from_ms))
    return {
        "export.mismatches": wrong,
        "export.programs": len(every),
        "export.budgets": sum(len(budgets) for budgets in asked),
        "export.ns": nanoseconds(largest),
        "export.ns_rows": len(largest.from_ms),
        "export.ns_measured": nanoseconds(tables[0]),
        "export.ns_measured_rows": len(tables[0].from_ms),
    }, {}


def mismatches(compiled: CompiledProgram, budgets: Budgets, answers: NDArray[np.float64]) -> int:
    """Budgets at which an exported answer, [n, calls + 1], is not that of `allocate`."""
    wrong = 0
    for ms, answer in zip(budgets.tolist(), answers.tolist(), strict=True):
        *shares, promised = answer
        try:
            allocation = compiled.allocate(ms / 1000)
        except AnytimeError:
            wrong += any(answer)
            continue
        expected = [1e6 * share for share in allocation.shares.values()]
        near = [abs(one - other) <= 0.5 + 1e-6 for one, other in zip(shares, expected, strict=True)]
        wrong += not all(near) or promised != allocation.promised
    return wrong


def budgets_for(tables: Exported, rng: np.random.Generator) -> Budgets:
    """Every millisecond of the range and some beyond, or around every change; and extremes."""
    end = int(tables.from_ms[-1])
    if end <= 3000:
        every = np.arange(-20, end + 200)
    else:
        near = (tables.from_ms[:, None] + np.arange(-2, 3)).ravel()
        every = np.concatenate([near, rng.integers(0, 2 * end, size=1000)])
    extremes = [-(2**31), -(2**31) + 1, -1, 0, 1, 2**31 - 2, 2**31 - 1]
    return np.unique(np.clip([*every.tolist(), *extremes], -(2**31), 2**31 - 1)).astype(np.int32)


def look_up(
    tables: Sequence[Exported], budgets: Sequence[Budgets], flags: Sequence[str] = STRICT
) -> list[NDArray[np.float64]]:
    """The answers of the headers, all included in one C program: [n, calls + 1] for each."""
    parts, calls = [], []
    for index, each in enumerate(tables):
        name = identifier(each.name)
        fields = [f"{field}_us" for field in identifiers(each.calls)]
        values = ", ".join(f"(double)found.{field}" for field in fields)
        parts.append(
            f"static void ask_{index}(FILE *in, FILE *out, long count)\n{{\n"
            "    int32_t budget;\n"
            "    while (count-- > 0 && fread(&budget, sizeof budget, 1, in) == 1) {\n"
            f"        const {name}_division found = {name}_divide(budget);\n"
            f"        const double row[] = {{{values}, found.promised}};\n"
            "        fwrite(row, sizeof row[0], sizeof row / sizeof row[0], out);\n    }\n}\n"
        )
        calls.append(f"    ask_{index}(in, out, {len(budgets[index])}L);")
    body = "\n".join(calls)
    source = (
        "#include <stdio.h>\n"
        + "".join(f'#include "{index}.h"\n' for index in range(len(tables)))
        + "\n".join(parts)
        + "int main(int argc, char **argv)\n{\n    FILE *in, *out;\n"
        '    if (argc != 3 || !(in = fopen(argv[1], "rb")) || !(out = fopen(argv[2], "wb"))) {\n'
        f"        return 1;\n    }}\n{body}\n    fclose(in);\n    return fclose(out);\n}}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "in").write_bytes(np.concatenate(budgets).astype(np.int32).tobytes())
        built = build(place, source, tables, flags)
        subprocess.run([str(built), str(place / "in"), str(place / "out")], check=True)
        flat = np.fromfile(place / "out", dtype=np.float64)
    sizes = [len(asked) * (len(t.calls) + 1) for asked, t in zip(budgets, tables, strict=True)]
    pieces = np.split(flat, np.cumsum(sizes)[:-1])
    return [piece.reshape(-1, len(t.calls) + 1) for piece, t in zip(pieces, tables, strict=True)]


def build(
    folder: Path, source: str, tables: Sequence[Exported], flags: Sequence[str] = STRICT
) -> Path:
    """A program compiled with gcc from a source that includes `0.h`, `1.h`, … in its folder."""
    for index, each in enumerate(tables):
        (folder / f"{index}.h").write_text(header(each), encoding="utf-8")
    (folder / "main.c").write_text(source, encoding="utf-8")
    command = ["gcc", *flags, "-O2", "-o", str(folder / "main"), str(folder / "main.c")]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode:
        raise AssertionError(f"the header does not compile: {ran.stderr[:2000]}")
    return folder / "main"


_TIMED = """\
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>
#include "0.h"

static double now(void)
{{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}}

int main(void)
{{
    /* The next budget depends on the last answer, so neither guessing nor overlapping helps. */
    uint32_t state = 1;
    for (int repeat = 0; repeat < {repeats}; repeat++) {{
        const double began = now();
        for (int32_t i = 0; i < {lookups}; i++) {{
            const int32_t budget = (int32_t)(((uint64_t)state * {range}u) >> 32);
            const {name}_division found = {name}_divide(budget);
            state = state * 1664525u + 1013904223u + (uint32_t)found.{field};
        }}
        printf("%.9g\\n", 1e9 * (now() - began) / {lookups});
    }}
    return state == 0;
}}
"""


def nanoseconds(tables: Exported) -> float:
    """CPU nanoseconds of a look-up at unpredictable budgets, one after the other; the median."""
    source = _TIMED.format(
        repeats=REPEATS,
        lookups=LOOKUPS,
        range=int(1.2 * tables.from_ms[-1]) + 1,
        name=identifier(tables.name),
        field=f"{identifiers(tables.calls)[-1]}_us",
    )
    with tempfile.TemporaryDirectory() as folder:
        built = build(Path(folder), source, [tables])
        ran = subprocess.run([str(built)], capture_output=True, text=True, check=False)
    return float(np.median([float(line) for line in ran.stdout.split()]))


def constructed(kind: str, rng: np.random.Generator, name: str) -> CompiledProgram:
    """A program with a construct (a branch, a loop, arms at once, …) and random tables."""
    while True:
        program = replace(read(sketch(kind, rng)), name=name)
        unit = float(rng.uniform(0.001, 0.1))
        tables = tuple(
            replace(table, times=unit * table.times, first=unit * table.first)
            for table in random_tables(program, rng)
        )
        frontier = divide(tables)
        if len(frontier.budgets):
            return CompiledProgram(program, tables, frontier, AS_IT_IS, {}, "random", 0.0)


def from_divisions(frontier: Frontier, name: str) -> CompiledProgram:
    """Calls one after the other whose divisions are these, whatever their tables say."""
    certain = np.array([[1.0, 0.0], [0.0, 1.0]])
    ends, step = np.array([0.0, 1.0]), Module("step", _nothing, ("value",))
    source: Input | Call = Input("x")
    tables: list[Table] = []
    calls: list[Call] = []
    for place in range(frontier.shares.shape[1]):
        label = f"call {place}"
        fed = (tables[-1].label,) if tables else ()
        chances = np.stack([certain, certain]) if tables else certain
        tables.append(Table(label, "step", fed, ends, ends, chances, 1.0))
        source = Call(step, (source,), label)
        calls.append(source)
    program = Program(name, ("x",), tuple(calls), calls[-1])
    return CompiledProgram(program, tuple(tables), frontier, AS_IT_IS, {}, "random", 0.0)


def random_frontier(rng: np.random.Generator) -> Frontier:
    """Up to 2,000 divisions among 1 to 6 calls; many budgets lie on a millisecond or beside it."""
    count, calls = int(rng.integers(1, 2000)), int(rng.integers(1, 7))
    end = 10.0 ** rng.uniform(-2, 4)
    budgets = rng.uniform(0, end, size=count)
    whole = rng.random(count) < 0.5
    beside = rng.choice([0.0, 1e-13, -1e-13, 1e-11, -1e-11, 1e-9, -1e-9], size=count)
    budgets = np.unique(np.abs(np.where(whole, budgets.round(3) + beside, budgets)))
    budgets = budgets[np.append(True, np.diff(budgets) > 0)]
    shares = rng.dirichlet(np.ones(calls), size=len(budgets)) * budgets[:, None]
    return Frontier(budgets, shares, np.sort(rng.random(len(budgets))))


def _nothing(*inputs: object) -> None:
    raise AnytimeError("a random program cannot run")
