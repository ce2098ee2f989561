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
from compiler.division import Frontier

Integers = NDArray[np.int64]

SCHEMA = "anytime.exported/1"
LONGEST = 2**31 - 1  # milliseconds: 24 days


@dataclass(frozen=True)
class Exported:
    """The divisions of a program by whole milliseconds.

    calls: labels, in order. from_ms: [R] the least budget of each row, increasing. share_us: [R, n]
    microseconds of each call. rest: [R, n] whether the budget is added to that; the share is then
    what the others leave, and `share_us` says with a minus what those have. promised: [R] what the
    result is expected to be worth.
    """

    name: str
    text: str
    machine: str
    calls: tuple[str, ...]
    from_ms: Integers
    share_us: Integers
    rest: NDArray[np.bool_]
    promised: NDArray[np.float64]


def exported(compiled: CompiledProgram) -> Exported:
    """The tables of a compiled program: the answers of `allocate` at every whole millisecond.

    Raises AnytimeError for a program that decides while it runs, and for budgets that do not fit
    into 32 bits of milliseconds.
    """
    frontier = compiled.frontier
    if compiled.policy is not None:
        raise AnytimeError(
            f"{compiled.name!r} decides while it runs, by what is achieved, which no table of "
            "budgets holds; compile it without adaptive=True to export it"
        )
    if not frontier.budgets[-1] < LONGEST / 1000:
        raise AnytimeError(
            f"budgets of {compiled.name!r} reach {frontier.budgets[-1]:.3g} s; a header holds "
            f"milliseconds in 32 bits, at most {LONGEST / 1000:.3g} s"
        )
    from_ms = _from_ms(frontier)
    last = np.append(np.diff(from_ms) > 0, True)  # others lie between two milliseconds
    budgets, shares = frontier.budgets[last], frontier.shares[last]
    given = np.array([_shares(compiled, *row) for row in zip(shares, budgets, strict=True)])
    more = np.array([_shares(compiled, *row) for row in zip(shares, budgets + 1, strict=True)])
    rest = more - given > 0.5  # seconds of one more that the call has
    return Exported(
        name=compiled.name,
        text=repr(compiled.program),
        machine=compiled.machine,
        calls=compiled.labels,
        from_ms=from_ms[last],
        share_us=np.rint(1e6 * (given - rest * budgets[:, None])).astype(np.int64),
        rest=rest,
        promised=frontier.promised[last],
    )


def _from_ms(frontier: Frontier) -> Integers:
    """The least whole millisecond with which `allocate` takes each division, or a later one."""
    near = np.floor(1000 * frontier.budgets).astype(np.int64)
    candidates = near[:, None] + np.arange(-1, 3)
    taken = np.array([[frontier.index(ms / 1000) for ms in row] for row in candidates.tolist()])
    rows = np.arange(len(near))
    return candidates[rows, (taken >= rows[:, None]).argmax(axis=1)]


def _shares(compiled: CompiledProgram, shares: NDArray[np.float64], seconds: float) -> list[float]:
    """What each call gets of a budget by this division."""
    return list(compiled.divided(shares.tolist(), seconds).values())


class _Tables(Stored):
    program: str
    text: str
    machine: str
    calls: list[str]
    from_ms: list[int]
    share_us: list[list[int]]
    rest: list[list[int]]
    promised: list[float]


def write_json(tables: Exported, path: Path) -> None:
    """Write the tables as strict JSON, one row a line."""
    record = _Tables(
        program=tables.name,
        text=tables.text,
        machine=tables.machine,
        calls=list(tables.calls),
        from_ms=tables.from_ms.tolist(),
        share_us=tables.share_us.tolist(),
        rest=tables.rest.astype(int).tolist(),
        promised=tables.promised.tolist(),
    )
    write_record(path, SCHEMA, record)
