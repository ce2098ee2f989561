"""A compiled program as plain tables, for those who have no Python on the robot.

Budgets are whole milliseconds, because timers are; shares are whole microseconds, because many a
share is less than a millisecond.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.files import Stored, write_record
from compiler.compiled import CompiledProgram

SCHEMA = "anytime.exported/1"
LONGEST = 2**31 - 1  # milliseconds: 24 days


@dataclass(frozen=True)
class Exported:
    """The divisions of a program by whole milliseconds.

    calls: labels, in order. from_ms: [R] the least budget of each row, increasing. share_us:
    [R, n − 1] microseconds of each call but the last, which has the rest. quality: [R] expected.
    """

    name: str
    text: str
    machine: str
    calls: tuple[str, ...]
    from_ms: NDArray[np.int64]
    share_us: NDArray[np.int64]
    quality: NDArray[np.float64]


def exported(compiled: CompiledProgram) -> Exported:
    """The tables of a compiled program: the answers of `allocate` at every whole millisecond.

    Raises AnytimeError for a program whose budgets do not fit into 32 bits of milliseconds, and
    for one whose shares depend on more than the budget.
    """
    frontier = compiled.frontier
    if len(compiled.program.nodes) > len(compiled.labels) or compiled.program.parallels:
        raise AnytimeError(
            f"{compiled.name!r} has branches, alternatives, parallels or several results; a table "
            "of shares by budget holds programs that call one module after the other"
        )
    if compiled.policy is not None or not compiled.objective.timeless:
        raise AnytimeError(
            f"{compiled.name!r} decides its shares as it runs or ends early; compile it without "
            "adaptive=True and without a utility of time"
        )
    if not frontier.budgets[-1] < LONGEST / 1000:
        raise AnytimeError(
            f"budgets of {compiled.name!r} reach {frontier.budgets[-1]:.3g} s; a header holds "
            f"milliseconds in 32 bits, at most {LONGEST / 1000:.3g} s"
        )
    near = np.floor(1000 * frontier.budgets).astype(np.int64)
    # The least whole millisecond with which `allocate` itself takes this division or a later one.
    candidates = near[:, None] + np.arange(-1, 3)
    taken = np.array([[frontier.index(ms / 1000) for ms in row] for row in candidates.tolist()])
    rows = np.arange(len(near))
    from_ms = candidates[rows, (taken >= rows[:, None]).argmax(axis=1)]
    last = np.append(np.diff(from_ms) > 0, True)  # others lie between two milliseconds
    return Exported(
        name=compiled.name,
        text=repr(compiled.program),
        machine=compiled.machine,
        calls=compiled.labels,
        from_ms=from_ms[last],
        share_us=np.rint(1e6 * frontier.shares[last, :-1]).astype(np.int64),
        quality=frontier.promised[last],
    )


class _Tables(Stored):
    program: str
    text: str
    machine: str
    calls: list[str]
    from_ms: list[int]
    share_us: list[list[int]]
    quality: list[float]


def write_json(tables: Exported, path: Path) -> None:
    """Write the tables as strict JSON, one row a line."""
    record = _Tables(
        program=tables.name,
        text=tables.text,
        machine=tables.machine,
        calls=list(tables.calls),
        from_ms=tables.from_ms.tolist(),
        share_us=tables.share_us.tolist(),
        quality=tables.quality.tolist(),
    )
    write_record(path, SCHEMA, record)
