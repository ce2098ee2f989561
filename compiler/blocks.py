"""What a policy decides at once: how long a call runs, or each call of a parallel when it begins.

The arms of a parallel do not wait for each other, so none can be decided by what another has
achieved: the whole parallel has one of the divisions that are the best for some budget.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anytime.programs import Program
from anytime.structure import outermost, outlets, within
from compiler import costs
from compiler.division import Frontier
from compiler.elimination import SUM_PRODUCT, Factor, eliminate, order_of
from compiler.tables import Table

Floats = NDArray[np.float64]
DIVISION = "a division"  # the name of an axis; no node has it
DIVISIONS = 64  # of a parallel that a policy chooses from, at most


@dataclass(frozen=True)
class Block:
    """A call, or the calls of a parallel with the joins between them, and the ways to divide time
    among them.

    tables: [n] of the nodes, in their order. moments: [D, n] of each, for every division. outside:
    labels of those that others look at.
    """

    tables: tuple[Table, ...]
    moments: NDArray[np.intp]
    outside: tuple[str, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(table.label for table in self.tables)

    @property
    def calls(self) -> tuple[str, ...]:
        return tuple(table.label for table in self.tables if table.rule is None)

    @property
    def shares(self) -> Floats:
        """Seconds of each call, for every division, [D, calls]."""
        times = [t.times[m] for t, m in zip(self.tables, self.moments.T, strict=True) if not t.rule]
        return np.stack(times, axis=1)

    @property
    def seconds(self) -> Floats:
        """Seconds in all, for every division, [D]."""
        calls = [table for table in self.tables if table.rule is None]
        return np.broadcast_to(costs.total(calls, list(self.shares.T)), len(self.moments))

    @property
    def feeds(self) -> tuple[str, ...]:
        """Labels of what it is made from."""
        feeds = dict.fromkeys(feed for table in self.tables for feed in table.feeds)
        return tuple(feed for feed in feeds if feed not in self.labels)

    @cached_property
    def chances(self) -> Floats:
        """Probability of the levels of what others look at, [feeds, D, outside]."""
        factors: list[Factor] = []
        for table, moments in zip(self.tables, self.moments.T, strict=True):
            if table.rule is None:
                scope = (*table.feeds, DIVISION, table.label)
                factors.append(Factor(scope, table.chances[..., moments, :]))
            else:
                factors.append(Factor((*table.feeds, table.label), table.chances[..., 0, :]))
        kept = (*self.feeds, DIVISION, *self.outside)
        return eliminate(factors, order_of(factors, kept), SUM_PRODUCT)[0].table

    def thinned(self, count: int) -> Block:
        """With at most so many of its divisions, from the first to the last."""
        if len(self.moments) <= count:
            return self
        kept = np.linspace(0, len(self.moments) - 1, count).round().astype(int)
        return replace(self, moments=self.moments[kept])


def alone(tables: Sequence[Table]) -> dict[str, Block]:
    """Each call as a block of its own, with all of its moments, by label."""
    calls = [table for table in tables if table.rule is None]
    return {
        each.label: Block((each,), np.arange(len(each.times))[:, None], (each.label,))
        for each in calls
    }


def blocks(program: Program, tables: Sequence[Table], frontier: Frontier) -> dict[str, Block]:
    """The block of every node that is made within a parallel, by label.

    frontier: whose divisions of the parallels may be chosen.
    """
    found: dict[str, Block] = {}
    for group in outermost(program):
        inside = within(program, group)
        places = [place for place, node in enumerate(program.nodes) if node in inside]
        made = [tables[place] for place in places]
        outside = tuple(node.label for node in outlets(program, inside))
        block = _parallel(made, outside, frontier.shares[:, places])
        found |= dict.fromkeys(block.labels, block)
    return found


def _parallel(tables: Sequence[Table], outside: tuple[str, ...], shares: Floats) -> Block:
    """A parallel with the divisions that it has in a frontier's rows, [F, n] seconds, and that
    which gives it no time, for when none is left."""
    nothing = np.zeros((1, len(tables)))
    rows = np.unique(_moments(tables, np.concatenate([nothing, shares])), axis=0)
    block = Block(tuple(tables), rows, outside)
    order = np.argsort(block.seconds, kind="stable")
    block = replace(block, moments=rows[order]).thinned(DIVISIONS)
    stretched = np.zeros(block.moments.shape)
    columns = [place for place, table in enumerate(tables) if table.rule is None]
    for row, (given, seconds) in enumerate(zip(block.shares, block.seconds, strict=True)):
        every = np.zeros(len(tables))
        every[columns] = given
        stretched[row, columns] = [*costs.stretched(tables, every.tolist(), seconds).values()]
    return replace(block, moments=np.unique(_moments(tables, stretched), axis=0))


def _moments(tables: Sequence[Table], shares: Floats) -> NDArray[np.intp]:
    """The last moment of each call that its share of time reaches, [F, n]."""
    columns = [
        np.searchsorted(table.times, column + 1e-12, side="right") - 1
        for table, column in zip(tables, shares.T, strict=True)
    ]
    return np.maximum(np.stack(columns, axis=1), 0)
