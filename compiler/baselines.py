"""The divisions that a compiled one must beat, and it by the same tables. [ZR93] Fig. 8."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from compiler import costs
from compiler.division import Frontier, expected_quality, moments_within
from compiler.tables import Floats, Table


def minimal_shares(tables: Sequence[Table], seconds: float) -> list[float]:
    """MIN: every call but the last just until it has a result, the last the rest."""
    return _rest_to_last(tables, [table.first for table in tables], seconds)


def maximal_shares(tables: Sequence[Table], seconds: float) -> list[float]:
    """MAX: every call but the last until it no longer improves, the last the rest."""
    return _rest_to_last(tables, [table.saturation for table in tables], seconds)


def even_shares(tables: Sequence[Table], seconds: float) -> list[float]:
    """The same time for every call."""
    once = [float(table.rule is None) for table in tables]
    unit = seconds / float(costs.total(tables, [np.asarray(one) for one in once]))
    return [unit * one for one in once]


def minimal(tables: Sequence[Table], seconds: ArrayLike) -> Floats:
    """Expected quality of MIN for each budget, [T]."""
    return _promised(tables, seconds, minimal_shares)


def maximal(tables: Sequence[Table], seconds: ArrayLike) -> Floats:
    """Expected quality of MAX for each budget, [T]."""
    return _promised(tables, seconds, maximal_shares)


def equal_shares(tables: Sequence[Table], seconds: ArrayLike) -> Floats:
    """Expected quality of equal shares for each budget, [T]."""
    return _promised(tables, seconds, even_shares)


def divided(tables: Sequence[Table], frontier: Frontier, seconds: ArrayLike) -> Floats:
    """Expected quality of the compiled divisions for each budget, [T], by the tables as that of the
    others is; what is promised is calibrated on problems never seen."""

    def shares_of(tables: Sequence[Table], seconds: float) -> list[float]:
        index = frontier.index(seconds)
        return [-1.0] * len(tables) if index < 0 else frontier.shares[index].tolist()

    return _promised(tables, seconds, shares_of)


def _promised(
    tables: Sequence[Table],
    seconds: ArrayLike,
    shares_of: Callable[[Sequence[Table], float], list[float]],
) -> Floats:
    budgets = np.atleast_1d(np.asarray(seconds, dtype=float))
    promised = np.zeros(len(budgets))
    for index, budget in enumerate(budgets):
        shares = shares_of(tables, float(budget))
        if min(shares) < 0:
            continue  # the budget does not reach the last call
        promised[index] = expected_quality(tables, moments_within(tables, shares))
    return promised


def _rest_to_last(tables: Sequence[Table], shares: list[float], seconds: float) -> list[float]:
    named = costs.stretched(tables, shares, seconds)
    return [named.get(table.label, 0.0) for table in tables]
