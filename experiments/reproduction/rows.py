"""The claims of a reproduction as rows, read from its JSON: of the page and of the document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

PAPERS = {
    "zr": ("[ZR93]", "S. Zilberstein, S. J. Russell: Anytime Sensing, Planning and Action: A "
           "Practical Model for Robot Control. IJCAI 1993."),
    "prp": ("[PRP16]", "A. Potapov, S. Rodionov, V. Potapova: Real-Time GA-Based Probabilistic "
            "Programming in Application to Robot Control. AGI 2016."),
}  # fmt: skip
"""What a claim's name begins with, and the paper."""
COMMANDS = {"zr": "anytime reproduce zr", "prp": "anytime reproduce nao"}
PART = {"zr": "zr", "nao": "prp"}


@dataclass(frozen=True)
class Row:
    """A figure of a claim. text: the paper's words, "" of all but the claim's main figure.

    sign: whether the claim, or this figure of it, holds.
    """

    name: str
    paper: str
    ours: str
    bounds: str
    best: str
    sign: str
    text: str


def rows_of(told: Mapping[str, Any], paper: str) -> list[Row]:
    """The claims of one of `PAPERS`, in its order. told: what `anytime reproduce --json` prints."""
    rows: list[Row] = []
    for name, text in told["settings"]["claims"].items():
        prefix, _, claim = name.partition(".")
        if prefix != paper:
            continue
        found = told["figures"]["claim"][prefix][claim]
        rows.append(_row(claim, found, text))
        rows += [_row(f"· {key}", it, "") for key, it in found.items() if isinstance(it, dict)]
    return rows


def _row(name: str, found: Mapping[str, Any], text: str) -> Row:
    sign = "holds" if found["held"] else "only ours" if found["held_by_ours"] else "no"
    return Row(
        name,
        shown(found["paper"]),
        shown(found["ours"]),
        f"{shown(found['low'])} to {shown(found['high'])}",
        shown(found["ours_best"]),
        sign,
        text,
    )


def shown(value: float | None) -> str:
    """A figure in three digits."""
    return "—" if value is None else f"{value:.3g}"


def cell(found: list[float | None]) -> str:
    """A cell of a sweep: ours, low to high."""
    ours, low, high = found
    return f"{shown(ours)} ({shown(low)} to {shown(high)})"


def summary(told: Mapping[str, Any]) -> str:
    """One sentence: how many claims hold, and in how many draws."""
    claims, settings = told["figures"]["claims"], told["settings"]
    return (
        f"{claims['held']} of {claims['total']} claims hold in the papers' own way; "
        f"{settings['draws']} draws each, the first with seed {told['seed']}."
    )
