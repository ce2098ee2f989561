"""The table of all benchmarks beside their rivals, as HTML: each interval is drawn on one axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from experiments.reproduction.rows import SIGNS, bench_command, beside, bounds, shown

STYLE = """
.rivals th.benchmark { text-align: left; padding-top: 1rem; border-bottom: 2px solid #999; }
.rivals th code { font-weight: 400; margin-left: 1rem; }
.rivals td.better, .rivals td.equal, .rivals td.worse { text-align: left; }
.rivals td.better { color: #00543a; font-weight: 600; }
.rivals td.worse { color: #8c3300; font-weight: 600; }
.rivals .axis { padding: 0 .6rem; } .rivals svg { display: block; overflow: visible; }
@media (max-width: 40rem) {
  .rivals .axis { display: none; } .rivals th.benchmark { border: 0; padding: 1rem 0 0; }
  .rivals th code { display: block; margin: 0; }
}
"""
_WIDTH, _HEIGHT = 180, 24  # pixels of a drawn interval
_LEAST, _MOST = 0.5, 100.0  # times that the axis shows at least
_COLUMNS = 6


def rival_table(told: Mapping[str, Any]) -> str:
    """The rows by benchmark, each with the command that measures it. told: the whole JSON."""
    groups = beside(told)
    axis = _Axis([row for rows in groups.values() for row in rows])
    body = [
        '<tr class="head"><th class="text">ours<th class="text">the rival<th>times as good'
        f'<th class="axis">{axis.ticks()}<th>low to high<th>'
    ]
    for benchmark, rows in groups.items():
        command = f"<code>{escape(bench_command(told, benchmark))}</code>"
        title = f"{escape(benchmark)} {command}"
        body.append(f'<tr><th class="benchmark" colspan="{_COLUMNS}">{title}')
        body += [_row(row, axis) for row in rows]
    return f'<div class="wide"><table class="rows rivals">{"".join(body)}</table></div>'


def _row(row: Mapping[str, Any], axis: _Axis) -> str:
    verdict = row["verdict"]
    return (
        f'<tr id="{row["benchmark"]}.{row["key"]}"><td class="text">{escape(row["ours"])}'
        f'<td class="text" data-is="beside">{escape(row["rival"])}'
        f'<td data-is="times as good">{shown(row["times"])}<td class="axis">{axis.drawn(row)}'
        f'<td data-is="from">{bounds(row)}<td class="{verdict}">{SIGNS[verdict]}'
    )


class _Axis:
    """Times as good, on a logarithmic axis that all rows share."""

    def __init__(self, rows: Sequence[Mapping[str, Any]]) -> None:
        ends = [row[end] for row in rows for end in ("low", "times", "high") if row[end]]
        self._low = math.log(min([_LEAST, *ends])) - 0.2
        self._high = math.log(max([_MOST, *ends])) + 0.2

    def ticks(self) -> str:
        """The powers of ten, as far as there is room for them."""
        most = math.floor(self._high / math.log(10.0))
        tens = range(0, most + 1, 1 + most // 4)
        texts = [f'<text x="{self._at(10.0**ten):.1f}" y="16">{10**ten:,}</text>' for ten in tens]
        return (
            f'<svg width="{_WIDTH}" height="{_HEIGHT}" font-size="11" text-anchor="middle" '
            f'role="img" aria-label="times as good, logarithmic">{"".join(texts)}</svg>'
        )

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
