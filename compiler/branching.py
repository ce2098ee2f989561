"""The value of a policy before a join, given that after it; what joins let a policy pass over."""

from __future__ import annotations

import string
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.joins import Branch, Until
from anytime.programs import Join, Program
from anytime.structure import only_for
from compiler.policies import label_of
from compiler.tables import Table

Floats = NDArray[np.float64]


def joined(
    node: object, table: Table, tables: Sequence[Table], after: tuple[str, ...], later: Floats
) -> tuple[tuple[str, ...], Floats]:
    """The value before a join, which takes no time. A branch's is split by what its tests say."""
    assert isinstance(node, Join)
    feeds, chances = table.feeds, table.chances[..., 0, :]
    if isinstance(node.rule, Branch):
        feeds, chances = _split(node, table, tables)
    known = before(after, [table.label], feeds)
    return known, mean(chances, (*feeds, table.label), later, after, known)


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


def answered(
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
    known = before(after, [name], feeds)
    return known, mean(odds, (*feeds, name), later, after, known)


def passed_over(
    labels: Sequence[str],
    tables: Sequence[Table],
    by: str,
    idle: float,
    state: tuple[str, ...],
    value: Floats,
    chosen: NDArray[np.int16],
    after: tuple[str, ...],
    later: Floats,
) -> tuple[tuple[str, ...], Floats, NDArray[np.int16]]:
    """In states in which nodes are not run, the value is that after them, without their results."""
    none = tuple(0 if name in labels else slice(None) for name in after)
    without = later[none]
    names = tuple(name for name in after if name not in labels)
    if by not in state:
        size = 2 if by.endswith("?") else next(len(t.levels) for t in tables if t.label == by)
        state = (by, *state)
        value = np.broadcast_to(value, (size, *value.shape)).copy()
        chosen = np.broadcast_to(chosen, (size, *chosen.shape)).copy()
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
        np.where(where, np.int16(0), chosen),
    )


def skips(program: Program) -> dict[str, list[tuple[str, float]]]:
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


def asked(program: Program) -> dict[str, list[Join]]:
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


def _quality(by_label: Mapping[str, Table], level: Mapping[str, int], node: object) -> float | None:
    label = label_of(node)
    if label not in by_label:
        return 1.0  # an input: it is there and right
    return float(by_label[label].levels[level[label]]) if level[label] else None


def mean(
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


def before(after: tuple[str, ...], made: Sequence[str], feeds: Sequence[str]) -> tuple[str, ...]:
    """The state before nodes are made, from that after them and what they are made from."""
    return tuple(dict.fromkeys([name for name in after if name not in made] + list(feeds)))
