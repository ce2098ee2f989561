"""The performance profile of a compiled program, by the budget that it is given. [ZR93] §4."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anytime.profiles import Profile
from anytime.recordings import Recording
from compiler.division import Floats, Frontier, moments_within, output_chances
from compiler.tables import Table

QUANTILES = 20  # that stand for the distribution of the result


def profile_of(name: str, tables: Sequence[Table], frontier: Frontier, machine: str) -> Profile:
    """The profile of a program divided along its frontier; its mean is what is promised."""
    rows: list[Floats] = []
    for shares in frontier.shares:
        chances = output_chances(tables, moments_within(tables, shares))
        rows.append(_quantiles(chances, tables[-1].levels))
    table = np.array(rows)  # [budgets, quantiles], NaN = no result
    recordings: list[Recording] = []
    end = float(frontier.budgets[-1])
    means = np.nan_to_num(table).mean(axis=1)
    lived = frontier.promised / np.maximum(means, 1e-9)
    table = np.clip(table * lived[:, None], 0.0, 1.0)  # so that its mean is the promise
    for column in range(QUANTILES):
        there = ~np.isnan(table[:, column])
        budgets = frontier.budgets[there]
        recordings.append(
            Recording(
                problem=f"quantile {column}",
                call=name,
                inputs={},
                features={},
                seconds=budgets,
                work=budgets,
                raw=table[there, column],
                estimates=np.full(len(budgets), np.nan),
                end=(end, end),
                complete=True,
            )
        )
    return Profile(name, (), tuple(recordings), machine=machine)


def _quantiles(chances: Floats, levels: Floats) -> Floats:
    """Means of equal slices of a distribution over levels, [QUANTILES]; NaN = no result."""
    edges = np.concatenate([[0.0], np.cumsum(chances)])
    edges = edges / edges[-1]
    slices = np.linspace(0, 1, QUANTILES + 1)
    overlap = np.clip(
        np.minimum(edges[1:, None], slices[None, 1:]) - np.maximum(edges[:-1, None], slices[:-1]),
        0,
        None,
    )
    mean = QUANTILES * (levels @ overlap)
    return np.where(QUANTILES * overlap[0] > 0.5, np.nan, np.clip(mean, 0.0, 1.0))
