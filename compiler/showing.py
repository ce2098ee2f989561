"""A compiled program as text and as a picture for notebooks: who gets how much of which budget."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anytime.pictures import duration, figure, line_chart, number
from compiler import baselines
from compiler.explaining import certificate

if TYPE_CHECKING:
    from compiler.compiled import CompiledProgram


def text_of(compiled: CompiledProgram, budgets: Sequence[float]) -> str:
    """Shares and promises for budgets in seconds, in at most 100 columns."""
    width = max(12, *(len(label) + 2 for label in compiled.labels))
    header = "".join(f"{label:>{width}}" for label in compiled.labels)
    lines = [
        f"{compiled.program!r} on machine {compiled.machine}",
        f"{'budget':>10}{header}   promised  95 %",
    ]
    for seconds in budgets:
        allocation = compiled.allocate(seconds)
        shares = "".join(f"{duration(s):>{width}}" for s in allocation.shares.values())
        low, high = compiled.interval(seconds)
        lines.append(
            f"{duration(seconds):>10}{shares}   {number(allocation.promised):>8}"
            f"  [{number(low)}, {number(high)}]"
        )
    lines.append(certificate(compiled.regret))
    return "\n".join(line[:100] for line in lines)


def picture_of(compiled: CompiledProgram, first: float, last: float) -> str:
    """The compiled profile above MIN and MAX, and the shares, over budgets in seconds; HTML."""
    times = np.geomspace(first, last, 80)
    x = times.tolist()
    series = {
        "compiled": (x, [compiled.promise(t) for t in x]),
        "MIN": (x, baselines.minimal(compiled.tables, times).tolist()),
        "MAX": (x, baselines.maximal(compiled.tables, times).tolist()),
    }
    above = line_chart(
        series,
        x_label="budget [s]",
        y_label="expected quality",
        dashed=("MIN", "MAX"),
        title=compiled.name,
    )
    shares = {
        label: (x, [compiled.allocate(t).shares[label] / t for t in x]) for label in compiled.labels
    }
    below = line_chart(shares, x_label="budget [s]", y_label="share of the budget")
    return figure(above + below, repr(compiled))
