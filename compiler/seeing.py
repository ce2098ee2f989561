"""What a run shows of its results: of modules with estimates their quality, of tests the answer."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.joins import Branch
from anytime.profiles import Profile
from anytime.programs import Join, Program
from anytime.structure import outermost, outlets, within
from compiler.objectives import Objective
from compiler.policies import Seen, label_of
from compiler.tables import Table, levels_of

Floats = NDArray[np.float64]
KNOTS = 64  # of what an estimate stands for


def calibrations(program: Program, profiles: Mapping[str, Profile]) -> dict[str, Seen]:
    """What quality the estimates of a program's calls stand for, by label."""
    return {
        call.label: _calibrated(profiles[call.module.name])
        for call in program.calls
        if call.module.estimate is not None
    }


def check(program: Program, seen: Collection[str], objective: Objective) -> None:
    """Raise AnytimeError for what no policy can be made for.

    seen: labels of the calls whose results show their quality.
    """
    if not objective.additive:
        raise AnytimeError(
            f"{objective!r} is no mean, and a policy maximises means; adaptive=True takes "
            "compiler.expected(…) or compiler.at_least(…)"
        )
    unseen = {program.output.label} | only_asked(program) | _within(program)
    for call in program.calls:
        if call.label not in unseen and call.label not in seen:
            raise AnytimeError(
                f"adaptive=True looks at what {call.label} achieved; give {call.module.name} an "
                "estimate=…"
            )


def watched(program: Program, tables: Sequence[Table], seen: Collection[str]) -> list[Table]:
    """Tables of the calls that show their quality while they run: not of contract modules, whose
    time is fixed when they begin, and not in a parallel, which is decided as a whole."""
    fixed = {call.label for call in program.calls if call.module.contract}
    fixed |= {label for group in outermost(program) for label in group.calls}
    return [t for t in tables if t.courses and t.label in seen and t.label not in fixed]


def as_seen(program: Program, tables: Sequence[Table]) -> list[Table]:
    """The tables as a policy sees them: of a test not whether it is right, only how often it is;
    but one that is asked within a parallel is not seen at all."""
    tests = only_asked(program) - _within(program)
    return [_test(table) if table.label in tests else table for table in tables]


def _test(table: Table) -> Table:
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


def _within(program: Program) -> set[str]:
    """Labels of what only the parallels themselves look at: the policy does not."""
    hidden = set[str]()
    for group in outermost(program):
        inside = within(program, group)
        pending: list[object] = [*outlets(program, inside)]
        shown = set[object]()
        while pending:  # a join shows what it is made from, but not what its tests say
            node = pending.pop()
            shown.add(node)
            if isinstance(node, Join):
                tests = node.rule.tests if isinstance(node.rule, Branch) else ()
                given = (a for place, a in enumerate(node.arguments) if place not in tests)
                pending += [a for a in given if a in inside]
        hidden |= {node.label for node in inside if node not in shown}
    return hidden


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


def only_asked(program: Program) -> set[str]:
    """Labels of calls that are only asked by branches."""
    asked, passed = set[str](), set[str]()
    for node in program.nodes:
        asks = isinstance(node, Join) and isinstance(node.rule, Branch)
        tests = node.rule.tests if asks else ()
        for place, argument in enumerate(node.arguments):
            (asked if place in tests else passed).add(label_of(argument))
    return asked - passed
