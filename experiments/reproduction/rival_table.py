"""The table of all benchmarks beside their rivals, as HTML: each interval is drawn on one axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from experiments.reproduction.rows import SIGNS, bench_command, beside, bounds, shown

STYLE = """
.rivals tbody th { text-align: left; padding-top: 1rem; border-bottom: 2px solid #999; }
.rivals th code { font-weight: 400; margin-left: 1rem; }
.rivals td.better, .rivals td.equal, .rivals td.worse { text-align: left; }
.rivals td.better { color: #00543a; font-weight: 600; }
.rivals td.worse { color: #8c3300; font-weight: 600; }
.rivals td.axis { padding: 0; } .rivals svg { display: block; }
"""
_WIDTH, _HEIGHT = 170, 24  # pixels of a drawn interval
_LEAST, _MOST = 0.5, 100.0  # times that the axis shows at least
_HEAD = ("ours", "the rival", "times as good", "", "low to high", "")


def rival_table(told: Mapping[str, Any]) -> str:
    """The rows by benchmark, each with the command that measures it. told: the whole JSON."""
    groups = beside(told)
    axis = _Axis([row for rows in groups.values() for row in rows])
    titles = "".join(
        f"<th{' class=text' if place < 2 else ''}>{title}" for place, title in enumerate(_HEAD)
    )
    body: list[str] = []
    for benchmark, rows in groups.items():
        command = f"<code>{escape(bench_command(told, benchmark))}</code>"
        body.append(f'<tr><th colspan="{len(_HEAD)}">{escape(benchmark)} {command}')
        body += [_row(row, axis) for row in rows]
    return (
        f'<div class="wide"><table class="rivals"><thead><tr>{titles}<tbody>{"".join(body)}'
        "</table></div>"
    )


def _row(row: Mapping[str, Any], axis: _Axis) -> str:
    verdict = row["verdict"]
    return (
        f'<tr id="{row["benchmark"]}.{row["key"]}"><td class="text">{escape(row["ours"])}'
        f'<td class="text">{escape(row["rival"])}<td>{shown(row["times"])}'
        f'<td class="axis">{axis.drawn(row)}<td>{bounds(row)}<td class="{verdict}">'
        f"{SIGNS[verdict]}"
    )


class _Axis:
    """Times as good, on a logarithmic axis that all rows share."""

    def __init__(self, rows: Sequence[Mapping[str, Any]]) -> None:
        ends = [row[end] for row in rows for end in ("low", "times", "high") if row[end]]
        self._low = math.log(min([_LEAST, *ends])) - 0.2
        self._high = math.log(max([_MOST, *ends])) + 0.2

    def drawn(self, row: Mapping[str, Any]) -> str:
        """A line from low to high, a dot at the figure, and where both are equal."""
        low, high = self._at(row["low"] or 0.0), self._at(row["high"] or math.inf)
        middle, equal, at = _HEIGHT / 2, self._at(1.0), self._at(row["times"] or math.inf)
        return (
            f'<svg width="{_WIDTH}" height="{_HEIGHT}" aria-hidden="true">'
            f'<path d="M{equal:.1f} 0V{_HEIGHT}" stroke="#999" stroke-dasharray="2 2"/>'
            f'<path d="M{low:.1f} {middle}H{max(high, low + 1):.1f}" stroke="#333" '
            f'stroke-width="2"/><circle cx="{at:.1f}" cy="{middle}" r="4" fill="#333"/></svg>'
        )

    def _at(self, times: float) -> float:
        if times <= 0.0:
            return 0.0
        if math.isinf(times):
            return float(_WIDTH)
        return _WIDTH * (math.log(times) - self._low) / (self._high - self._low)
