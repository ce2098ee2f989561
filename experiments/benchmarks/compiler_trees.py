"""Random trees and DAGs of calls, compiled, against every division there is."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from compiler.division import divide
from compiler.tables import Table


def random_program(
    rng: np.random.Generator, shared: bool, calls: int | None = None
) -> tuple[Table, ...]:
    """Deterministic tables of a random program of 2 to 4 calls, or of so many; half of them are not
    monotone in their inputs. With `shared` a result may feed several calls."""
    count = int(rng.integers(2, 5)) if calls is None else calls
    monotone = bool(rng.random() < 0.5)
    feeds: list[list[int]] = [[] for _ in range(count)]
    for place in range(count - 1):
        users = rng.choice(np.arange(place + 1, count), size=1 + int(shared and rng.random() < 0.6))
        for user in {int(user) for user in users}:
            if len(feeds[user]) < 2:
                feeds[user].append(place)
        if not any(place in fed for fed in feeds):
            feeds[count - 1].append(place)
    tables: list[Table] = []
    for place in range(count):
        levels = int(rng.integers(3, 6))
        times = np.concatenate([[0.0], np.cumsum(rng.integers(1, 4, size=int(rng.integers(2, 5))))])
        shape = [len(tables[fed].levels) for fed in feeds[place]]
        reached = rng.integers(0, levels, size=(*shape, len(times)))
        reached[..., 0] = 0
        if monotone:
            for axis in range(reached.ndim):
                reached = np.maximum.accumulate(reached, axis=axis)
        for axis in range(len(shape)):
            reached[(slice(None),) * axis + (0,)] = 0  # no input, no result
        chances = (reached[..., None] == np.arange(levels)).astype(float)
        qualities = np.concatenate([[0.0], np.sort(rng.random(levels - 1)).round(6)])
        labels = tuple(f"call {fed}" for fed in feeds[place])
        tables.append(
            Table(
                f"call {place}", f"call {place}", labels, qualities, times, chances, float(times[1])
            )
        )
    return tuple(tables)


def mismatch(tables: Sequence[Table]) -> bool:
    """Whether the compiled promise differs from the best of all divisions at any budget."""
    best: dict[float, float] = {}
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        level: dict[str, int] = {}
        for table, moment in zip(tables, moments, strict=True):
            fed = tuple(level[name] for name in table.feeds)
            level[table.label] = int(table.chances[(*fed, moment)].argmax())
        total = float(sum(t.times[m] for t, m in zip(tables, moments, strict=True)))
        quality = float(tables[-1].levels[level[tables[-1].label]])
        best[total] = max(best.get(total, 0.0), quality)
    frontier = divide(tables)
    reached = 0.0
    for budget in sorted(best):
        reached = max(reached, best[budget])
        promised = frontier.promise(budget) if len(frontier.budgets) else 0.0
        if abs(promised - reached) > 1e-9:
            return True
    return False
