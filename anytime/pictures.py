"""Pictures of the objects: sparklines for a terminal, inline SVG for a notebook."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from itertools import groupby

BARS = "▁▂▃▄▅▆▇█"
# Okabe & Ito's colours, told apart by colour-blind eyes; every series is labelled as well.
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9", "#f0e442", "#000000")
COLUMNS = 100  # of what is printed, at most
_LONG = 1e6  # from which on a number is a power of ten: its digits would take a line


def sparkline(values: Sequence[float], low: float = 0.0, high: float = 1.0) -> str:
    """One character a value; a blank where there is none (NaN)."""
    span = (high - low) or 1.0
    marks: list[str] = []
    for value in values:
        if math.isnan(value):
            marks.append(" ")
            continue
        share = min(max((value - low) / span, 0.0), 1.0)
        marks.append(BARS[min(int(share * len(BARS)), len(BARS) - 1)])
    return "".join(marks)


def thinned(values: Sequence[float], most: int) -> Sequence[float]:
    """All of the values, or as many as `most`, spread evenly over them."""
    if len(values) <= most:
        return values
    return [values[place * len(values) // most] for place in range(most)]


def number(value: float) -> str:
    """A quality or share in few characters: .81, 1.00, 12.3, 4.5e+08."""
    if math.isnan(value):
        return "—"
    if abs(value) < 1:
        text = f"{value:.2f}"
        return text if text == "1.00" else text.replace("0.", ".", 1)
    if abs(value) < _LONG:
        return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
    return f"{value:.3g}"


def clipped(line: str) -> str:
    """A line of at most `COLUMNS`, with a mark where it was cut."""
    return line if len(line) <= COLUMNS else line[: COLUMNS - 1] + "…"


def elided(name: str, width: int) -> str:
    """A name in at most so many characters, without its middle: settings of a knob end it."""
    if len(name) <= width:
        return name
    end = width // 2
    return f"{name[: width - end - 1]}…{name[-end:]}"


def duration(seconds: float) -> str:
    """A time in few characters: 79.6 ms, 1.20 s."""
    if math.isnan(seconds):
        return "—"
    if math.isinf(seconds):
        return "∞" if seconds > 0 else "-∞"
    # The bounds are where rounding would show 1000 of the smaller unit.
    if 0 < abs(seconds) < 0.9995e-6:
        return f"{1e9 * seconds:.2g} ns"
    if abs(seconds) < 0.9995e-3:
        return f"{1e6 * seconds:.0f} µs" if seconds else "0 ms"
    if abs(seconds) < 0.99995:
        return f"{1e3 * seconds:.1f} ms"
    return f"{seconds:.2f} s" if abs(seconds) < _LONG else f"{seconds:.3g} s"


def line_chart(
    series: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    *,
    x_label: str,
    y_label: str,
    bands: Mapping[str, tuple[Sequence[float], Sequence[float], Sequence[float]]] | None = None,
    dashed: Sequence[str] = (),
    title: str = "",
    width: int = 560,
    height: int = 260,
    y_range: tuple[float, float] = (0.0, 1.0),
) -> str:
    """A chart as inline SVG. series: label -> (x [n], y [n]), a gap where y is NaN; bands: label ->
    (x, low, high)."""
    bands = bands or {}
    xs = [x for line in series.values() for x in line[0]] or [0.0, 1.0]
    x_low, x_high = min(xs), max(xs)
    x_high = x_high if x_high > x_low else x_low + 1
    # The legend stands beside the lines, which it would otherwise hide.
    left, right = 48, width - (16 if len(series) < 2 else 128)
    top, bottom = 22 if title else 10, height - 34
    y_low, y_high = y_range
    y_high = y_high if y_high > y_low else y_low + 1

    def place(x: float, y: float) -> str:
        across = left + (right - left) * (x - x_low) / (x_high - x_low)
        up = bottom - (bottom - top) * (min(max(y, y_low), y_high) - y_low) / (y_high - y_low)
        return f"{across:.1f},{up:.1f}"

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" font-family="sans-serif" font-size="11">',
        f"<title>{html.escape(title or y_label)}</title>",
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for y in _ticks(y_low, y_high):
        _, up = place(x_low, y).split(",")
        parts.append(f'<path d="M{left},{up}H{right}" stroke="#ddd"/>')
        parts.append(f'<text x="{left - 5}" y="{up}" text-anchor="end" dy="4">{y:.4g}</text>')
    for x in _ticks(x_low, x_high):
        across, _ = place(x, y_low).split(",")
        parts.append(f'<path d="M{across},{bottom}v4" stroke="#999"/>')
        parts.append(f'<text x="{across}" y="{bottom + 14}" text-anchor="middle">{x:.4g}</text>')
    for index, (label, (bx, low, high)) in enumerate(bands.items()):
        edge = [place(x, y) for x, y in zip(bx, low, strict=True)]
        edge += [place(x, y) for x, y in zip(reversed(bx), reversed(high), strict=True)]
        colour = COLOURS[list(series).index(label) if label in series else index % len(COLOURS)]
        parts.append(f'<polygon points="{" ".join(edge)}" fill="{colour}" opacity="0.18"/>')
    for index, (label, (x, y)) in enumerate(series.items()):
        colour = COLOURS[index % len(COLOURS)]
        dash = ' stroke-dasharray="5 4"' if label in dashed else ""
        pieces = groupby(zip(x, y, strict=True), lambda point: not math.isnan(point[1]))
        drawn = [[place(*at) for at in piece] for known, piece in pieces if known]
        # A point alone is drawn as a line to itself, with round ends.
        line = "".join("M" + "L".join(piece * 2 if len(piece) < 2 else piece) for piece in drawn)
        parts.append(
            f'<path class="line" d="{line}" fill="none" stroke="{colour}" '
            f'stroke-width="1.8" stroke-linecap="round"{dash}/>'
        )
        if len(series) > 1:
            legend = top + 14 + 14 * index
            parts.append(
                f'<path d="M{right + 8},{legend - 4}h18" stroke="{colour}" stroke-width="2"{dash}/>'
                f'<text x="{right + 30}" y="{legend}">{html.escape(elided(label, 16))}</text>'
            )
    middle = (left + right) / 2
    parts.append(
        f'<text x="{middle}" y="{height - 6}" text-anchor="middle">{html.escape(x_label)}</text>'
    )
    parts.append(
        f'<text transform="translate(12 {(top + bottom) / 2}) rotate(-90)" '
        f'text-anchor="middle">{html.escape(y_label)}</text>'
    )
    if title:
        parts.append(f'<text x="{middle}" y="14" text-anchor="middle">{html.escape(title)}</text>')
    return "".join([*parts, "</svg>"])


def _ticks(low: float, high: float) -> list[float]:
    """Three to seven round numbers between low and high."""
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * n for n in (1, 2, 2.5, 5, 10) if power * n >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [step * n for n in range(first, math.floor(high / step + 1e-9) + 1)]


def figure(svg: str, text: str) -> str:
    """A picture with its text form below, which is also what a screen reader reads."""
    return f'<div>{svg}<pre style="font-size:11px">{html.escape(text)}</pre></div>'
