"""In which order variables are eliminated, and what that costs."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import prod
from typing import NamedTuple

import numpy as np

EASY = 1e6  # cells of the largest table up to which a better order is not looked for
TRIES = 40  # random orders, beyond that
ALONG = 20  # tables that machine code goes through at one call, at most

Scope = tuple[str, ...]


class Bucket(NamedTuple):
    """One variable to be eliminated, with the factors that speak of it.

    members: numbers of those factors; bucket i of an order leaves factor `factors + i` behind.
    scope: the other variables that they speak of, which are those of the factor left behind.
    shape: levels of the variable, then of the scope.
    blocks: levels before, of and after the variable in the second of two members, where the first
    speaks of the variable alone; None elsewhere. So it is with every result that is used once.
    """

    variable: str
    members: tuple[int, ...]
    scope: Scope
    shape: tuple[int, ...]
    blocks: tuple[int, int, int] | None


class Stage(NamedTuple):
    """Buckets that are eliminated at once: one, or several along a chain.

    Along a chain the first bucket joins the factor `start` with a table of two axes, every further
    one what the last left behind with another. tables: numbers of those, `ALONG` of them, the last
    repeated; parts: where each bucket's factor lies in the row of all. Both are empty for one.
    """

    buckets: tuple[Bucket, ...]
    start: int
    tables: tuple[int, ...]
    parts: tuple[slice, ...]


@dataclass(frozen=True)
class Order:
    """Buckets in the order of elimination, and the same in stages.

    keep: variables that are kept, in that order. parts: where in the row of its stage a factor
    lies that only the next bucket there asks for, by number. scopes: of all factors, those that
    buckets leave behind included. left: numbers of the factors that are left at the end. cells: of
    the largest joined table; all_cells: of all of them, to which the time is in proportion. [Dec99]
    """

    keep: Scope
    buckets: tuple[Bucket, ...]
    stages: tuple[Stage, ...]
    parts: Mapping[int, slice]
    scopes: tuple[Scope, ...]
    left: tuple[int, ...]
    cells: float
    all_cells: float


@lru_cache(maxsize=256)
def elimination_order(
    scopes: tuple[Scope, ...], shapes: tuple[tuple[int, ...], ...], keep: Scope
) -> Order:
    """A cheap order in which every variable but `keep` is eliminated.

    scopes: variables of each factor; shapes: their levels. What is used once is eliminated first,
    which makes no table larger; then the variable with the least joined table. Where a table grows
    large, least fill-in and random orders are tried as well.
    """
    levels: dict[str, int] = {}
    for scope, shape in zip(scopes, shapes, strict=True):
        levels.update(zip(scope, shape, strict=True))
    draft = _peeled(scopes, levels, keep)

    def table(members: Sequence[Scope]) -> float:
        return prod([levels[name] for name in frozenset[str]().union(*members)])

    best = _greedy(draft, levels, keep, table)
    if best.cells <= EASY:
        return best

    def fill(members: Sequence[Scope]) -> float:
        """Pairs of variables that would be joined for the first time."""
        around = frozenset[str]().union(*members)
        there = {(a, b) for scope in members for a in scope for b in scope if a < b}
        return sum((a, b) not in there for a in around for b in around if a < b)

    rng = np.random.default_rng(0)

    def drawn(members: Sequence[Scope]) -> float:
        return table(members) ** float(rng.uniform(0.7, 1.3))

    others = [_greedy(draft, levels, keep, cost) for cost in (fill, *[drawn] * TRIES)]
    return min([best, *others], key=lambda order: (order.cells, order.all_cells))


@dataclass(frozen=True)
class _Draft:
    """An order begun: scopes of all factors so far, buckets, and which factors are used up."""

    scopes: tuple[Scope, ...]
    buckets: tuple[Bucket, ...]
    used: frozenset[int]


def _peeled(scopes: Sequence[Scope], levels: Mapping[str, int], keep: Scope) -> _Draft:
    """Eliminates what one factor and a factor of its own speak of: all of a tree whose factors
    come in the order of its calls."""
    uses: dict[str, int] = dict.fromkeys(levels, 0)
    for scope in scopes:
        for name in scope:
            uses[name] += 1
    every, buckets, used = list(scopes), list[Bucket](), list[int]()
    alone: dict[str, int] = {}
    for number, scope in enumerate(scopes):
        for name in scope:
            if uses[name] != 2 or name not in alone or name in keep:
                continue
            bucket = _bucket(name, (alone[name], number), (scope,), levels)
            buckets.append(bucket)
            scope = bucket.scope
            used += (alone[name], number)
            number = len(every)
            every.append(scope)
        if len(scope) == 1:
            alone[scope[0]] = number
    return _Draft(tuple(every), tuple(buckets), frozenset(used))


def _greedy(
    draft: _Draft,
    levels: Mapping[str, int],
    keep: Scope,
    cost: Callable[[Sequence[Scope]], float],
) -> Order:
    """The draft continued: always the variable that costs least now."""
    scopes, buckets, used = list(draft.scopes), list(draft.buckets), set(draft.used)
    members: dict[str, list[int]] = {}
    for number, scope in enumerate(scopes):
        if number not in used:
            for name in scope:
                members.setdefault(name, []).append(number)
    costs = {
        name: cost([scopes[n] for n in numbers])
        for name, numbers in members.items()
        if name not in keep
    }
    waiting = [(price, name) for name, price in costs.items()]
    heapq.heapify(waiting)
    while waiting:
        price, variable = heapq.heappop(waiting)
        if costs.get(variable) != price:
            continue  # its neighbourhood has changed since, and it waits at another price
        del costs[variable]
        gone = sorted(members.pop(variable), key=lambda number: len(scopes[number]))
        bucket = _bucket(variable, tuple(gone), [scopes[number] for number in gone], levels)
        buckets.append(bucket)
        used.update(gone)
        scopes.append(bucket.scope)
        for name in bucket.scope:
            members[name] = [number for number in members[name] if number not in used]
            members[name].append(len(scopes) - 1)
            if name in costs:
                costs[name] = cost([scopes[n] for n in members[name]])
                heapq.heappush(waiting, (costs[name], name))
    left = tuple([number for number in range(len(scopes)) if number not in used])
    cells = [prod(bucket.shape) for bucket in buckets]
    stages = _stages(buckets, scopes)
    parts = _parts(stages, len(scopes) - len(buckets))
    most, every = max(cells, default=1), sum(cells)
    return Order(keep, tuple(buckets), stages, parts, tuple(scopes), left, most, every)


def _stages(buckets: Sequence[Bucket], scopes: Sequence[Scope]) -> tuple[Stage, ...]:
    rows: list[list[Bucket]] = []
    left = len(scopes) - len(buckets)  # number of the factor that a bucket leaves behind
    for number, bucket in enumerate(buckets, left):
        goes_on = rows and len(rows[-1]) < ALONG and bucket.members[0] == number - 1
        if goes_on and _along(rows[-1][-1], scopes) and _along(bucket, scopes):
            rows[-1].append(bucket)
        else:
            rows.append([bucket])
    return tuple([_stage(row) for row in rows])


def _along(bucket: Bucket, scopes: Sequence[Scope]) -> bool:
    """Whether it joins a factor of its variable alone with one of that and another, in that
    order."""
    around = (bucket.variable, *bucket.scope)
    return bucket.blocks is not None and len(around) == 2 and scopes[bucket.members[1]] == around


def _stage(row: Sequence[Bucket]) -> Stage:
    if len(row) == 1:
        return Stage(tuple(row), row[0].members[0], (), ())
    tables = [bucket.members[1] for bucket in row]
    ends = [0, *itertools.accumulate(bucket.shape[1] for bucket in row)]
    parts = tuple([slice(*pair) for pair in itertools.pairwise(ends)])
    padded = (*tables, *tables[-1:] * (ALONG - len(tables)))
    return Stage(tuple(row), row[0].members[0], padded, parts)


def _parts(stages: Sequence[Stage], number: int) -> dict[int, slice]:
    """number: of the factor that the first bucket leaves behind."""
    parts: dict[int, slice] = {}
    for stage in stages:
        parts |= dict(enumerate(stage.parts[:-1], number))
        number += len(stage.buckets)
    return parts


def _bucket(
    variable: str, members: tuple[int, ...], scopes: Sequence[Scope], levels: Mapping[str, int]
) -> Bucket:
    """scopes: of the members, the least first; one that speaks of the variable alone may miss."""
    union = dict.fromkeys([name for scope in scopes for name in scope])
    del union[variable]
    scope = tuple(union)
    sizes = [levels[name] for name in scope]
    blocks = None
    if len(members) == 2 and len(scopes[0]) == 1 + len(scope) * (len(scopes) == 1):
        axis = scopes[-1].index(variable)
        blocks = prod(sizes[:axis]), levels[variable], prod(sizes[axis:])
    return Bucket(variable, members, scope, (levels[variable], *sizes), blocks)
