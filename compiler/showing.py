"""A compiled program as text and as a picture for notebooks: who gets how much of which budget."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anytime.pictures import duration, line_chart, number
from compiler import baselines
from compiler.allocations import Allocation
from compiler.explaining import certificate
from compiler.tables import Table


def text_of(
    title: str, rows: Sequence[tuple[Allocation, tuple[float, float]]], regret: float
) -> str:
    """Shares and promises with their 95 % intervals, a row a budget, in at most 100 columns."""
    labels = list(rows[0][0].shares)
    width = max(12, *(len(label) + 2 for label in labels))
    header = "".join(f"{label:>{width}}" for label in labels)
    lines = [title, f"{'budget':>10}{header}   promised  95 %"]
    for allocation, (low, high) in rows:
        shares = "".join(f"{duration(s):>{width}}" for s in allocation.shares.values())
        lines.append(
            f"{duration(allocation.seconds):>10}{shares}   {number(allocation.promised):>8}"
            f"  [{number(low)}, {number(high)}]"
        )
    lines.append(certificate(regret))
    return "\n".join(line[:100] for line in lines)


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
