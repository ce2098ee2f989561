"""A compiled program as text and as a picture for notebooks: who gets how much of which budget."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anytime.pictures import COLUMNS, clipped, duration, elided, line_chart, number
from compiler import baselines
from compiler.allocations import Allocation
from compiler.explaining import certificate
from compiler.tables import Table

ROOM, MORE = COLUMNS - 38, 3  # columns for the shares; for the mark that there are more


def text_of(
    title: str, rows: Sequence[tuple[Allocation, tuple[float, float]]], regret: float
) -> str:
    """Shares and promises with their 95 % intervals, a row a budget, in at most 100 columns: of
    many calls the first ones."""
    labels = list(rows[0][0].shares)
    width = max(12, *(len(label) + 2 for label in labels))
    width = max(12, min(width, ROOM // len(labels)))
    shown = len(labels) if len(labels) * width <= ROOM else max(1, (ROOM - MORE) // width)
    more = "" if shown == len(labels) else f"{'…':>{MORE}}"
    header = "".join(f"{elided(label, width - 2):>{width}}" for label in labels[:shown])
    lines = [title, f"{'budget':>10}{header}{more}   promised  95 %"]
    for allocation, (low, high) in rows:
        seconds = [*allocation.shares.values()][:shown]
        shares = "".join(f"{duration(s):>{width}}" for s in seconds) + more
        lines.append(
            f"{duration(allocation.seconds):>10}{shares}   {number(allocation.promised):>8}"
            f"  [{number(low)}, {number(high)}]"
        )
    lines.append(certificate(regret))
    return "\n".join(clipped(line) for line in lines)


def picture_of(name: str, tables: Sequence[Table], allocations: Sequence[Allocation]) -> str:
    """The compiled profile above MIN and MAX, and the shares, over the budgets; inline SVG."""
    x = [allocation.seconds for allocation in allocations]
    times = np.array(x)
    series = {
        "compiled": (x, [allocation.promised for allocation in allocations]),
        "MIN": (x, baselines.minimal(tables, times).tolist()),
        "MAX": (x, baselines.maximal(tables, times).tolist()),
    }
    above = line_chart(
        series,
        x_label="budget [s]",
        y_label="expected quality",
        dashed=("MIN", "MAX"),
        title=name,
    )
    shares = {
        label: (x, [each.shares[label] / each.seconds for each in allocations])
        for label in allocations[0].shares
    }
    return above + line_chart(shares, x_label="budget [s]", y_label="share of the budget")
