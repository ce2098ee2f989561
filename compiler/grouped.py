"""(min, +) elimination of programs in which some calls run at once, or one instead of another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compiler.costs import joined
from compiler.elimination import MIN_PLUS, Factor, Step, eliminate, order_of
from compiler.solving import Solution, cheapest
from compiler.tables import Table


def cheapest_in_groups(
    tables: Sequence[Table], factors: Sequence[Factor], output: str
) -> tuple[Solution, tuple[Step, ...]]:
    """Least seconds for each level of the output, and the steps that led to the arms' tables.

    factors: least seconds of each table's levels. What only one arm of a group needs is summed
    out within that arm; the arms' tables then join as their times do, by the longer of a branch
    and the busiest processor of a parallel, which a minimum may be drawn into.
    """
    by_label = dict(zip((table.label for table in tables), factors, strict=True))
    pending, steps = _reduced(tables, by_label, 0)
    return cheapest(pending, output), steps


def _reduced(
    tables: Sequence[Table], by_label: dict[str, Factor], depth: int
) -> tuple[list[Factor], tuple[Step, ...]]:
    """One factor for each table outside deeper groups, and one for each group."""
    plain: list[Factor] = []
    members: dict[str, dict[int, list[Table]]] = {}
    processors: dict[str, int] = {}
    for table in tables:
        if len(table.path) <= depth:
            plain.append(by_label[table.label])
            continue
        arm = table.path[depth]
        members.setdefault(arm.group, {}).setdefault(arm.index, []).append(table)
        processors[arm.group] = arm.processors
    steps: tuple[Step, ...] = ()
    for group, arms in members.items():
        inside = {t.label for arm in arms.values() for t in arm}
        wanted = {
            name
            for label, factor in by_label.items()
            if label not in inside
            for name in factor.scope
        }
        sides: list[Factor] = []
        for arm in arms.values():
            found, deeper = _reduced(arm, by_label, depth + 1)
            own = {table.label for table in arm}
            scope = sorted({name for factor in found for name in factor.scope})
            keep = tuple(name for name in scope if name not in own or name in wanted)
            side, last = eliminate(found, order_of(found, keep), MIN_PLUS)
            sides.append(side)
            steps += (*deeper, *last)
        plain.append(_beside(sides, processors[group]))
    return plain, steps


def _beside(sides: Sequence[Factor], processors: int) -> Factor:
    scope = tuple(dict.fromkeys(name for side in sides for name in side.scope))
    views = []
    for side in sides:
        order = [side.scope.index(name) for name in scope if name in side.scope]
        missing = tuple(place for place, name in enumerate(scope) if name not in side.scope)
        views.append(np.expand_dims(side.table.transpose(order), missing))
    return Factor(scope, joined(views, processors))
