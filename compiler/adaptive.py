"""Adaptive schedules: each call's share by what the calls before it achieved, and its end by
what it shows itself.

Where a static schedule fixes all shares in advance, a policy decides when a call begins, from the
time that is left and the qualities that are seen then (the estimates of modules, and the answers of
tests); and whether it goes on, after each of its results, where its module has an estimate. Dynamic
programming over the calls in order, with the levels of results that are still needed as the state,
and within each call over its moments [Hansen & Zilberstein 2001]. A parallel is decided as a whole,
when it begins.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.programs import Program
from anytime.structure import apart
from compiler.blocks import DIVISION, Block, alone, blocks
from compiler.branching import answered, asked, before, joined, mean, passed_over, skips
from compiler.division import Frontier, nothing
from compiler.objectives import Objective
from compiler.policies import TICKS, Choice, Plan, Policy, Seen, Within
from compiler.seeing import as_seen, check, watched
from compiler.stopping import stop, transitions
from compiler.tables import Table

Floats = NDArray[np.float64]
BUDGETS = 24  # for which a policy is made
STATES = 40_000_000  # numbers that the choice of one call is made from, at most


def adapt(
    program: Program,
    tables: Sequence[Table],
    seen: Mapping[str, Seen],
    frontier: Frontier,
    objective: Objective,
) -> Policy:
    """A policy for a program, by dynamic programming for each of `BUDGETS` budgets.

    seen: of the modules that have estimates, by label, what quality one stands for.
    Raises AnytimeError where a module that feeds another has no estimate, for an objective that is
    no mean, and where too many results are needed at once.
    """
    check(program, seen, objective)
    visible = as_seen(program, tables)
    steps = {
        table.label: transitions(table)
        for table in watched(program, visible, seen)
        if table.chances.size * TICKS <= STATES
    }
    budgets = np.geomspace(frontier.budgets[0], frontier.budgets[-1], BUDGETS)
    decided = alone(visible) | blocks(program, visible, frontier)
    plans = tuple(plan_for(program, visible, float(b), objective, steps, decided) for b in budgets)
    needed = {name for plan in plans for choice in plan.choices for name in choice.state}
    levels = {table.label: table.levels for table in visible if table.label in {*needed, *steps}}
    return Policy(plans, levels, seen, frozenset(steps))


def ceiling(
    program: Program, tables: Sequence[Table], budget: float, objective: Objective
) -> float | None:
    """What no division of a budget can be worth more than: a policy that sees every level and
    whose times are rounded in its favour. None where that would take too long, for an objective
    that is no mean, and for parallels."""
    if not objective.additive or program.parallels:
        return None
    try:
        return plan_for(program, tables, budget, objective, floor=True).value
    except _TooWideError:
        return None


class _TooWideError(AnytimeError):
    """The state of a policy has too many results in it."""


def plan_for(
    program: Program,
    tables: Sequence[Table],
    budget: float,
    objective: Objective,
    steps: Mapping[str, Floats] | None = None,
    decided: Mapping[str, Block] | None = None,
    *,
    floor: bool = False,
) -> Plan:
    """The best plan for one budget, by dynamic programming from the last node to the first.

    steps: of calls that are watched while they run, the transitions of their levels, by label.
    decided: what is decided at once, by label of its nodes; by default every call for itself.
    floor: round the times of calls down to ticks instead of up, for a bound from above.
    """
    tick = budget / TICKS
    output = tables[-1]
    elapsed = np.asarray(budget - tick * np.arange(TICKS + 1), dtype=float)
    state: tuple[str, ...] = (output.label,)
    value = np.ascontiguousarray(objective.worth(output.levels, elapsed).T)  # [level, ticks left]
    idle, questions = skips(program), asked(program)
    decided = alone(tables) if decided is None else decided
    choices: list[Choice] = []
    following: list[Table] = []
    for table, node in zip(reversed(tables), reversed(program.nodes), strict=True):
        for join in questions.get(table.label, ()):
            state, value = answered(join, tables, state, value)
        block = decided.get(table.label)
        if block is None:
            state, value = joined(node, table, tables, state, value)
            continue
        if block.tables[0].label != table.label:
            continue  # with the first of its parallel
        after, later = state, value
        block = _small(block, tables, after, later)
        own, within = None, None
        if steps is not None and _cells(block, tables, after) * len(table.levels) <= STATES:
            own = steps.get(table.label)  # else it is decided when it begins alone
        if own is not None:
            last = all(apart(table.path, other.path) for other in following)
            patient = last and objective.timeless
            state, value, chosen, within = _watch(table, own, after, later, tick, patient)
        else:
            state, value, chosen = _begin(block, after, later, tick, floor)
        every = [set(idle.get(call, ())) for call in block.calls]
        for by, which in sorted(set[tuple[str, float]].intersection(*every)):
            state, value, chosen = passed_over(
                block.labels, tables, by, which, state, value, chosen, after, later
            )
        choices.append(Choice(block.calls, state, chosen, block.shares, within))
        following += [each for each in block.tables if each.rule is None]
    for join in questions.get("", ()):
        state, value = answered(join, tables, state, value)
    worth = float(value[..., TICKS])
    return Plan(budget, max(worth, nothing(tables, objective)), tuple(reversed(choices)))


def _begin(
    block: Block, after: tuple[str, ...], later: Floats, tick: float, floor: bool
) -> tuple[tuple[str, ...], Floats, NDArray[np.int16]]:
    """The value before a block, and its division, for each state and ticks left."""
    known = before(after, block.labels, block.feeds)
    names = (*block.feeds, DIVISION, *block.outside)
    reached = mean(block.chances, names, later, after, (*known, DIVISION))
    left = np.arange(TICKS + 1) - _units(block.seconds, tick, floor)[:, None]  # [D, ticks]
    shifted = np.take_along_axis(
        reached, np.broadcast_to(np.maximum(left, 0), reached.shape), axis=-1
    )
    shifted = np.where(left >= 0, shifted, -np.inf)
    best = shifted.argmax(axis=-2)
    value = np.take_along_axis(shifted, best[..., None, :], axis=-2)[..., 0, :]
    return known, value, best.astype(np.int16)


def _small(block: Block, tables: Sequence[Table], after: tuple[str, ...], later: Floats) -> Block:
    """A block whose values fit in memory: a parallel with fewer divisions, if need be.

    Raises AnytimeError where even that is too much.
    """
    if len(block.tables) > 1:
        block = block.thinned(max(2, STATES // max(later.size, _cells(block, tables, after, 1))))
    if _cells(block, tables, after) > STATES:
        raise _TooWideError(
            f"adaptive=True would have to remember {len(after)} results at once for "
            f"{block.labels[0]}; join some in a module"
        )
    return block


def _cells(
    block: Block, tables: Sequence[Table], after: tuple[str, ...], divisions: int | None = None
) -> int:
    """Of how many numbers a block is decided: states by divisions by ticks."""
    levels = {table.label: len(table.levels) for table in tables}
    state = before(after, block.labels, block.feeds)
    size = math.prod(levels.get(name, 2) for name in state)
    return size * (divisions or len(block.moments)) * TICKS


def _watch(
    table: Table,
    steps: Floats,
    after: tuple[str, ...],
    later: Floats,
    tick: float,
    patient: bool,
) -> tuple[tuple[str, ...], Floats, NDArray[np.int16], Within]:
    """The same of a call that is watched, with when to end it after each of its results."""
    others = tuple(name for name in after if name != table.label and name not in table.feeds)
    state = (*others, *table.feeds)
    order = [after.index(name) for name in (*state, table.label) if name in after]
    worth = later.transpose([*order, len(after)])
    new = tuple(place for place, name in enumerate(state) if name not in after)
    worth = np.expand_dims(worth, new)
    shape = (*worth.shape[: len(others)], *table.chances.shape[:-2], *worth.shape[-2:])
    units = _units(table.times, tick)
    found = stop(table.chances, steps, units, np.broadcast_to(worth, shape), patient)
    return state, found.value, found.latest, Within(state, found.ends)


def _units(seconds: Floats, tick: float, floor: bool = False) -> NDArray[np.intp]:
    """Ticks until each of these times is over."""
    ticks = seconds / tick if tick > 0 else np.zeros(len(seconds))
    rounded = np.floor(ticks + 1e-9) if floor else np.ceil(ticks - 1e-9)
    return rounded.astype(np.intp)
