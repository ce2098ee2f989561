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
RIVALS = "rivals"
COMMANDS = {
    "zr": "anytime reproduce zr",
    "prp": "anytime reproduce nao",
    RIVALS: "anytime reproduce rivals",
}
PART = {"zr": "zr", "nao": "prp"}
BEYOND = "Beyond the papers: every benchmark beside its rivals"
READ = (
    "Times as good: the rival's time, work or error over ours, or our quality or value over "
    "theirs; above 1 ours is better. ▲ better and ▼ worse: the whole 95 % interval is; "
    "= equal: no difference is shown. Hindsight, an empty loop and “always” cannot be beaten."
)
SIGNS = {"better": "▲ better", "equal": "= equal", "worse": "▼ worse"}


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


def beside(told: Mapping[str, Any]) -> dict[str, list[Mapping[str, Any]]]:
    """The comparisons with rivals by benchmark, in their order."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for row in told["settings"]["comparisons"]:
        found.setdefault(row["benchmark"], []).append(row)
    return found


def bench_command(told: Mapping[str, Any], benchmark: str) -> str:
    """What measures the figures of a benchmark again, all of them."""
    return f"anytime bench {benchmark} --seed {told['seed']}"


def shown(value: float | None) -> str:
    """A figure in three digits, more if it is above a thousand."""
    if value is None:
        return "—"
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"


def cell(found: list[float | None]) -> str:
    """A cell of a sweep: ours, low to high."""
    ours, low, high = found
    return f"{shown(ours)} ({shown(low)} to {shown(high)})"


def bounds(row: Mapping[str, Any]) -> str:
    """The interval of a comparison."""
    return f"{shown(row['low'])} to {shown(row['high'])}"


def summary(told: Mapping[str, Any]) -> str:
    """How many claims hold, in how many draws, and in how many comparisons we are better."""
    claims, settings = told["figures"]["claims"], told["settings"]
    sentences: list[str] = []
    if claims["total"]:
        sentences.append(
            f"{claims['held']} of {claims['total']} claims hold in the papers' own way; "
            f"{settings['draws']} draws each, the first with seed {told['seed']}."
        )
    verdicts = [row["verdict"] for row in settings["comparisons"]]
    if verdicts:
        sentences.append(
            f"Of {len(verdicts)} comparisons with rivals ours is better in "
            f"{verdicts.count('better')}, worse in {verdicts.count('worse')}, and no difference is "
            f"shown in {verdicts.count('equal')}."
        )
    return " ".join(sentences)
