"""The document of a reproduction, `results.md`, from its JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.reproduction.rows import (
    BEYOND,
    COMMANDS,
    PAPERS,
    PART,
    READ,
    RIVALS,
    SIGNS,
    bench_command,
    beside,
    bounds,
    cell,
    rows_of,
    shown,
    summary,
)

_HOW = """\
*Paper* is what is printed, *its way* our figure in the paper's own way with its bounds, *ours* that
of our best. Of a behaviour the figure is the share of the draws that show it.
[reproduction.md](reproduction.md) says how a claim is judged, what does not hold and why, and what
was chosen where a paper says nothing."""


def results(told: Mapping[str, Any]) -> str:
    """The document as Markdown. told: what `anytime reproduce --json` prints."""
    settings = told["settings"]
    machine = f"Python {told['machine']['python']}, {told['machine']['system']}"
    lines = ["# Both papers' claims beside ours", "", f"{summary(told)} {machine}.", ""]
    lines += [*(f"- {cut}" for cut in settings["cut"]), "", _HOW]
    for paper, (short, full) in PAPERS.items():
        rows = rows_of(told, paper)
        if not rows:
            continue
        lines += ["", f"## {short}", "", full, "", "```sh", COMMANDS[paper], "```", ""]
        head = ("claim", "what is claimed", "paper", "its way", "low to high", "ours", "")
        lines += _table(
            head,
            [(r.name, r.text, r.paper, r.ours, r.bounds, r.best, _strong(r.sign)) for r in rows],
        )
        for picture in settings["pictures"]:
            if PART[picture["part"]] == paper:
                lines += ["", f"![{picture['caption']}]({picture['file']})", "", picture["caption"]]
        moving = [each for each in settings["animations"] if PART[each["part"]] == paper]
        if moving:
            lines += ["", "In motion on the page:", ""]
            lines += [f"- {each['caption']}" for each in moving]
        if paper == "zr":
            for sweep in settings["sweeps"]:
                lines += ["", f"### {sweep['title']}", ""]
                printed = ("printed", *map(shown, sweep["paper"]))
                cells = [(name, *map(cell, row)) for name, row in sweep["rows"].items()]
                lines += _table(("", *sweep["columns"]), [printed, *cells])
    if settings["comparisons"]:
        lines += ["", f"## {BEYOND}", "", READ, "", "```sh", COMMANDS[RIVALS], "```", ""]
        lines += _rivals(told)
    return "\n".join(lines) + "\n"


def _rivals(told: Mapping[str, Any]) -> list[str]:
    """The table; the first row of a benchmark says what measures it."""
    lines: list[tuple[str, ...]] = []
    for benchmark, rows in beside(told).items():
        lines.append((f"**{benchmark}** `{bench_command(told, benchmark)}`", *[""] * 4))
        lines += [
            (r["ours"], r["rival"], shown(r["times"]), bounds(r), SIGNS[r["verdict"]]) for r in rows
        ]
    return _table(("ours", "the rival", "times as good", "low to high", ""), lines)


def _strong(sign: str) -> str:
    return sign if sign == "holds" else f"**{sign}**"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(line) + " |" for line in lines]
