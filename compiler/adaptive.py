"""Adaptive schedules: at each call, its share by what the calls before it achieved.

Where a static schedule fixes all shares in advance, a policy decides each when its call begins,
from the time that is left and the qualities that are seen then (the estimates of modules, and the
answers of tests). Dynamic programming over the calls in order, with the levels of results that
are still needed as the state [Hansen & Zilberstein 2001, of contracts that follow each other].
"""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.joins import Branch, Until
from anytime.profiles import Profile
from anytime.programs import Join, Program
from anytime.structure import only_for
from compiler.division import Frontier, nothing
from compiler.objectives import Objective
from compiler.policies import TICKS, Choice, Plan, Policy, Seen, label_of
from compiler.tables import Table, levels_of

Floats = NDArray[np.float64]
MOMENT = "a moment"  # the name of an axis; no node has it
BUDGETS = 24  # for which a policy is made
KNOTS = 64  # of what an estimate stands for
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
    no mean, for parallels, and where too many results are needed at once.
    """
    _check(program, objective)
    visible = [_as_seen(program, table) for table in tables]
    budgets = np.geomspace(frontier.budgets[0], frontier.budgets[-1], BUDGETS)
    plans = tuple(plan_for(program, visible, float(budget), objective) for budget in budgets)
    needed = {name for plan in plans for choice in plan.choices for name in choice.state}
    levels = {table.label: table.levels for table in visible if table.label in needed}
    return Policy(plans, levels, {name: seen[name] for name in seen if name in needed})


def calibrations(program: Program, profiles: Mapping[str, Profile]) -> dict[str, Seen]:
    """What quality the estimates of a program's calls stand for, by label."""
    return {
        call.label: _calibrated(profiles[call.module.name])
        for call in program.calls
        if call.module.estimate is not None
    }


def _check(program: Program, objective: Objective) -> None:
    if not objective.additive:
        raise AnytimeError(
            f"{objective!r} is no mean, and a policy maximises means; adaptive=True takes "
            "compiler.expected(…) or compiler.at_least(…)"
        )
    if program.parallels:
        raise AnytimeError(
            "adaptive=True decides between calls that follow each other; leave parallel out"
        )
    tests = _tests(program)
    for call in program.calls:
        if call is not program.output and call.label not in tests and call.module.estimate is None:
            raise AnytimeError(
                f"adaptive=True looks at what {call.label} achieved; give {call.module.name} an "
                "estimate=…"
            )


def _tests(program: Program) -> set[str]:
    """Labels of calls that are only asked by branches."""
    asked, passed = set[str](), set[str]()
    for node in program.nodes:
        asks = isinstance(node, Join) and isinstance(node.rule, Branch)
        tests = node.rule.tests if asks else ()
        for place, argument in enumerate(node.arguments):
            (asked if place in tests else passed).add(label_of(argument))
    return asked - passed


def _as_seen(program: Program, table: Table) -> Table:
    """A test's table as the run sees it: not whether it is right, only how often it is."""
    if table.label not in _tests(program):
        return table
    there = table.chances[..., 1:].sum(axis=-1)
    right = np.where(there > 0, table.expected / np.maximum(there, 1e-12), np.nan)
    levels, bins = levels_of(right, 32)
    chances = np.zeros((*right.shape, len(levels)))
    chances[..., 0] = 1 - there
    np.put_along_axis(chances, bins[..., None], np.where(bins == 0, 1.0, there)[..., None], axis=-1)
    return Table(
        table.label,
        table.module,
        table.feeds,
        levels,
        table.times,
        chances,
        table.first,
        table.path,
    )


def _calibrated(profile: Profile) -> Seen:
    """The mean quality of results of about each estimate, made to increase."""
    from scipy.optimize import isotonic_regression

    estimates = np.concatenate([run.estimates for run in profile.recordings])
    quality = np.concatenate(list(profile.qualities))
    there = ~np.isnan(estimates)
    if not there.any():
        return np.array([0.0, 1.0]), np.array([0.0, 1.0])
    order = np.argsort(estimates[there], kind="stable")
    smooth = isotonic_regression(quality[there][order]).x
    at, first = np.unique(estimates[there][order], return_index=True)
    means = np.add.reduceat(smooth, first) / np.diff([*first, len(smooth)])
    kept = np.unique(np.linspace(0, len(at) - 1, min(KNOTS, len(at))).round().astype(int))
    return at[kept], means[kept]


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
    *,
    floor: bool = False,
) -> Plan:
    """The best plan for one budget, by dynamic programming from the last node to the first.

    floor: round the times of calls down to ticks instead of up, for a bound from above.
    """
    tick = budget / TICKS
    output = tables[-1]
    elapsed = np.asarray(budget - tick * np.arange(TICKS + 1), dtype=float)
    state: tuple[str, ...] = (output.label,)
    value = np.ascontiguousarray(objective.worth(output.levels, elapsed).T)  # [level, ticks left]
    skips = _skips(program)
    asked = _asked(program)
    choices: list[Choice] = []
    for place in range(len(tables) - 1, -1, -1):
        table, node = tables[place], program.nodes[place]
        for join in asked.get(table.label, ()):
            state, value = _answered(join, tables, state, value)
        if table.rule is not None:
            state, value = _joined(node, table, tables, state, value)
            continue
        after, later = state, value
        size = math.prod(_sizes(tables, _before(after, table.label, table.feeds)))
        if size * len(table.times) * TICKS > STATES:
            raise _TooWideError(
                f"adaptive=True would have to remember {len(after)} results at once for "
                f"{table.label}; join some in a module"
            )
        state, value, moments = _call(table, after, later, tick, floor)
        for mask_label, idle in skips.get(table.label, ()):
            state, value, moments = _passed_over(
                table, tables, mask_label, idle, state, value, moments, after, later
            )
        choices.append(Choice(table.label, state, moments, table.times))
    for join in asked.get("", ()):
        state, value = _answered(join, tables, state, value)
    worth = float(value[..., TICKS])
    return Plan(budget, max(worth, nothing(tables, objective)), tuple(reversed(choices)))


def _call(
    table: Table, after: tuple[str, ...], later: Floats, tick: float, floor: bool
) -> tuple[tuple[str, ...], Floats, NDArray[np.int16]]:
    """The value before a call, and the moment to end it at, for each state and ticks left."""
    before = _before(after, table.label, table.feeds)
    names = (*table.feeds, MOMENT, table.label)
    reached = _mean(table.chances, names, later, after, (*before, MOMENT))
    rounded = np.floor if floor else np.ceil
    ticks = table.times / tick if tick > 0 else np.zeros(1)
    units = rounded(ticks + (1e-9 if floor else -1e-9)).astype(int)
    left = np.arange(TICKS + 1) - units[:, None]  # [M, ticks]
    shifted = np.take_along_axis(
        reached, np.broadcast_to(np.maximum(left, 0), reached.shape), axis=-1
    )
    shifted = np.where(left >= 0, shifted, -np.inf)
    best = shifted.argmax(axis=-2)
    value = np.take_along_axis(shifted, best[..., None, :], axis=-2)[..., 0, :]
    return before, value, best.astype(np.int16)


def _joined(
    node: object, table: Table, tables: Sequence[Table], after: tuple[str, ...], later: Floats
) -> tuple[tuple[str, ...], Floats]:
    """The value before a join, which takes no time. A branch's is split by what its tests say."""
    assert isinstance(node, Join)
    feeds, chances = table.feeds, table.chances[..., 0, :]
    if isinstance(node.rule, Branch):
        feeds, chances = _split(node, table, tables)
    before = _before(after, table.label, feeds)
    return before, _mean(chances, (*feeds, table.label), later, after, before)


def _split(join: Join, table: Table, tables: Sequence[Table]) -> tuple[tuple[str, ...], Floats]:
    """Of a branch, the distribution of its result given what its tests answer: axes of its
    answer, of its feeds, of its levels."""
    rule = join.rule
    assert isinstance(rule, Branch)
    by_label = {t.label: t for t in tables}
    feeds = tuple(dict.fromkeys(f for f in map(label_of, join.arguments) if f in by_label))
    chances = np.zeros((2, *(len(by_label[f].levels) for f in feeds), len(table.levels)))
    for cell in np.ndindex(*chances.shape[1:-1]):
        level = dict(zip(feeds, cell, strict=True))
        known = [_quality(by_label, level, argument) for argument in join.arguments]
        for answer in (True, False):
            found = rule.answered(known, answer)
            total = sum(chance for chance, _ in found)
            if total <= 0:
                chances[(int(not answer), *cell, 0)] = 1.0
            for chance, quality in found:
                if chance > 0:
                    at = (
                        0
                        if quality is None
                        else 1 + int(np.abs(table.levels[1:] - quality).argmin())
                    )
                    chances[(int(not answer), *cell, at)] += chance / total
    return (f"{join.label}?", *feeds), chances


def _answered(
    join: Join, tables: Sequence[Table], after: tuple[str, ...], later: Floats
) -> tuple[tuple[str, ...], Floats]:
    """The value before a branch's tests have answered: the mean over their answers."""
    name = f"{join.label}?"
    if name not in after:
        return after, later
    rule = join.rule
    assert isinstance(rule, Branch)
    by_label = {t.label: t for t in tables}
    tests = [join.arguments[place] for place in rule.tests]
    feeds = tuple(dict.fromkeys(f for f in map(label_of, tests) if f in by_label))
    odds = np.zeros((*(len(by_label[f].levels) for f in feeds), 2))
    for cell in np.ndindex(*odds.shape[:-1]):
        level = dict(zip(feeds, cell, strict=True))
        known = [*(_quality(by_label, level, test) for test in tests), 1.0, 1.0]
        odds[(*cell, 0)] = sum(chance for chance, _ in rule.answered(known, True))
        odds[(*cell, 1)] = 1 - odds[(*cell, 0)]
    before = _before(after, name, feeds)
    return before, _mean(odds, (*feeds, name), later, after, before)


def _passed_over(
    table: Table,
    tables: Sequence[Table],
    by: str,
    idle: float,
    state: tuple[str, ...],
    value: Floats,
    moments: NDArray[np.int16],
    after: tuple[str, ...],
    later: Floats,
) -> tuple[tuple[str, ...], Floats, NDArray[np.int16]]:
    """In states in which a call is not run, the value is that after it, without its result."""
    without = np.take(later, 0, axis=after.index(table.label))
    names = tuple(name for name in after if name != table.label)
    if by not in state:
        size = 2 if by.endswith("?") else next(len(t.levels) for t in tables if t.label == by)
        state = (by, *state)
        value = np.broadcast_to(value, (size, *value.shape)).copy()
        moments = np.broadcast_to(moments, (size, *moments.shape)).copy()
    axis = state.index(by)
    size = value.shape[axis]
    if by.endswith("?"):
        mask = np.arange(size) == idle
    else:
        levels = next(t.levels for t in tables if t.label == by)
        mask = (levels >= idle) & (np.arange(size) > 0)
    order = [name for name in state if name in names]
    view = without.transpose([*(names.index(name) for name in order), len(names)])
    view = np.expand_dims(view, tuple(i for i, name in enumerate(state) if name not in names))
    where = mask.reshape([-1 if i == axis else 1 for i in range(value.ndim)])
    return (
        state,
        np.where(where, np.broadcast_to(view, value.shape), value),
        np.where(where, np.int16(0), moments),
    )


def _sizes(tables: Sequence[Table], state: Sequence[str]) -> list[int]:
    levels = {table.label: len(table.levels) for table in tables}
    return [levels.get(name, 2) for name in state]


def _before(after: tuple[str, ...], made: str, feeds: Sequence[str]) -> tuple[str, ...]:
    """The state before something is made, from that after it and what it is made from."""
    return tuple(dict.fromkeys([name for name in after if name != made] + list(feeds)))


def _mean(
    chances: Floats,
    names: Sequence[str],
    later: Floats,
    after: Sequence[str],
    before: Sequence[str],
) -> Floats:
    """The values `later` [after, ticks] in the mean over `chances` [names], [before, ticks]."""
    letter = dict(zip(dict.fromkeys((*names, *after, *before)), string.ascii_letters, strict=False))
    one, other, made = ("".join(letter[n] for n in axes) for axes in (names, after, before))
    tick = string.ascii_letters[len(letter)]
    return np.asarray(
        np.einsum(f"{one},{other}{tick}->{made}{tick}", chances, later, optimize=True)
    )


def _skips(program: Program) -> dict[str, list[tuple[str, float]]]:
    """For each call that is not always run: what decides it, and in which of its states it is
    not: the answer's place of a branch, or a quality of an `until` from which on."""
    found: dict[str, list[tuple[str, float]]] = {}
    for node in program.nodes:
        if not isinstance(node, Join):
            continue
        private = only_for(program, node)
        if isinstance(node.rule, Branch):
            for arm, labels in enumerate(private[len(node.rule.tests) :]):
                for label in labels:
                    found.setdefault(label, []).append((f"{node.label}?", 1 - arm))
        elif isinstance(node.rule, Until):
            for label in private[1]:
                found.setdefault(label, []).append((label_of(node.arguments[0]), node.rule.quality))
    return found


def _asked(program: Program) -> dict[str, list[Join]]:
    """The branches whose last test is each node; under "" those whose tests are inputs."""
    places = {node.label: place for place, node in enumerate(program.nodes)}
    found: dict[str, list[Join]] = {}
    for node in program.nodes:
        if isinstance(node, Join) and isinstance(node.rule, Branch):
            tests = [label_of(node.arguments[place]) for place in node.rule.tests]
            known = [test for test in tests if test in places]
            last = max(known, key=places.__getitem__, default="")
            found.setdefault(last, []).append(node)
    return found


def _nearest(levels: Floats, quality: float | None) -> int:
    return 0 if quality is None else 1 + int(np.abs(levels[1:] - quality).argmin())


def _quality(by_label: Mapping[str, Table], level: Mapping[str, int], node: object) -> float | None:
    label = label_of(node)
    if label not in by_label:
        return 1.0  # an input: it is there and right
    return float(by_label[label].levels[level[label]]) if level[label] else None
