"""What a division of time takes in all: calls one after the other, branches, parallels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.structure import Arm
from compiler.tables import Table

Floats = NDArray[np.float64]
EXACT = 7  # arms up to which the best assignment to processors is found by trying all


def total(tables: Sequence[Table], times: Sequence[Floats]) -> Floats:
    """Seconds in all when each table's call takes its time, elementwise over arrays of times.

    Of a branch the longer arm counts, because a budget must do for either; of a parallel the
    processor that is busy longest.
    """
    placed = [
        (table.path, np.asarray(t, dtype=float)) for table, t in zip(tables, times, strict=True)
    ]
    return _in_sequence(placed, 0)


def assignment(costs: Sequence[float], processors: int) -> tuple[tuple[int, ...], ...]:
    """Which arms each processor runs, one after the other, so that the last ends earliest."""
    best = min(
        _assignments(len(costs), processors),
        key=lambda blocks: max(sum(costs[arm] for arm in block) for block in blocks),
    )
    return tuple(best)


def joined(costs: Sequence[Floats], processors: int) -> Floats:
    """Seconds of a group from those of its arms, elementwise; processors 0: of a branch."""
    if processors == 0 or processors >= len(costs):
        return np.asarray(np.maximum.reduce(np.broadcast_arrays(*costs)))
    if processors == 1:
        return np.asarray(sum(costs[1:], start=costs[0]))
    ends = [
        np.maximum.reduce(
            np.broadcast_arrays(
                *(sum((costs[arm] for arm in block[1:]), start=costs[block[0]]) for block in blocks)
            )
        )
        for blocks in _assignments(len(costs), processors)
    ]
    return np.asarray(np.minimum.reduce(ends))


def stretched(
    tables: Sequence[Table], shares: Sequence[float], seconds: float
) -> Mapping[str, float]:
    """The shares by call, with what is left of `seconds` given to the last call that has any.

    Where a program ends in a branch, or in a parallel with a processor for each arm, the last
    call of each arm has what that arm leaves.
    """
    found = {t.label: float(s) for t, s in zip(tables, shares, strict=True) if t.rule is None}
    calls = [table for table in tables if table.rule is None]
    running = [table for table in calls if not idle(table, found[table.label])]
    _stretch(running or calls, found, seconds, 0)
    return found


def idle(table: Table, share: float) -> bool:
    """Whether a call with this share is not run: it has no time, and without time no result."""
    return share <= 1e-12 and bool((table.chances[..., 0, 0] > 1 - 1e-9).all())


def _in_sequence(placed: Sequence[tuple[tuple[Arm, ...], Floats]], depth: int) -> Floats:
    seconds: Floats = np.zeros(())
    groups: dict[str, dict[int, list[tuple[tuple[Arm, ...], Floats]]]] = {}
    processors: dict[str, int] = {}
    for path, time in placed:
        if len(path) == depth:
            seconds = seconds + time
            continue
        arm = path[depth]
        groups.setdefault(arm.group, {}).setdefault(arm.index, []).append((path, time))
        processors[arm.group] = arm.processors
    for group, arms in groups.items():
        costs = [_in_sequence(members, depth + 1) for members in arms.values()]
        seconds = seconds + joined(costs, processors[group])
    return seconds


def _assignments(arms: int, processors: int) -> list[list[tuple[int, ...]]]:
    """Every way to share arms among processors, up to their names; for many arms one: in turn."""
    if arms > EXACT:
        return [[tuple(range(start, arms, processors)) for start in range(min(arms, processors))]]
    found: list[list[tuple[int, ...]]] = []
    for labels in itertools.product(range(processors), repeat=arms):
        first = list(dict.fromkeys(labels))
        if first == sorted(first) and first == list(range(len(first))):
            found.append([tuple(a for a in range(arms) if labels[a] == p) for p in first])
    return found


def _stretch(tables: Sequence[Table], shares: dict[str, float], seconds: float, depth: int) -> None:
    last = tables[-1]
    if len(last.path) == depth:
        placed = [(t.path, np.asarray(shares[t.label])) for t in tables]
        shares[last.label] += seconds - float(_in_sequence(placed, depth))
        return
    group = last.path[depth]
    arms: dict[int, list[Table]] = {}
    outside: list[Table] = []
    for table in tables:
        inside = len(table.path) > depth and table.path[depth].group == group.group
        if inside:
            arms.setdefault(table.path[depth].index, []).append(table)
        else:
            outside.append(table)
    if 0 < group.processors < len(arms):
        return  # the arms of one processor follow each other; the last end is as early as can be
    before = _in_sequence([(t.path, np.asarray(shares[t.label])) for t in outside], depth)
    for arm in arms.values():
        _stretch(arm, shares, seconds - float(before), depth + 1)
