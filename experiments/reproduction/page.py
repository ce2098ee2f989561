"""The page of a reproduction: one file that needs no other, from its JSON and its pictures."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from experiments.reproduction.rival_table import STYLE, rival_table
from experiments.reproduction.rows import (
    BEYOND,
    COMMANDS,
    PAPERS,
    PART,
    READ,
    RIVALS,
    Row,
    cell,
    rows_of,
    shown,
    summary,
)

CLAIMED = "what is claimed"
_KIND = {CLAIMED: "text"}  # columns of words
_STYLE = """
:root { color-scheme: light; }
body { margin: 0 auto; max-width: 76rem; padding: 1rem; font: 1rem/1.5 system-ui, sans-serif; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .9rem; }
th, td { padding: .25rem .6rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, th.text, td:first-child, td.text { text-align: left; }
th, td { white-space: nowrap; }
td.text { white-space: normal; min-width: 14rem; }
td.holds { color: #006644; } td.no, td.only { color: #a33d00; font-weight: 600; }
figure { margin: 1.5rem 0; } figure svg { max-width: 100%; height: auto; }
.sweep { font-size: .85rem; } .sweep th, .sweep td { padding: .25rem .4rem; }
figure.broad svg { min-width: 38rem; }
figcaption { font-size: .9rem; color: #444; max-width: 50rem; }
.animations { display: grid; gap: 0 1.5rem;
  grid-template-columns: repeat(auto-fill, minmax(min(22rem, 100%), 1fr)); }
.animation h4 { margin: 0 0 .4rem; font-size: .95rem; }
.animation canvas { display: block; width: 100%; }
.controls { display: flex; gap: .6rem; align-items: center; margin: .4rem 0 0; }
.controls button { width: 2.4rem; font-size: .9rem; } .controls input { flex: 1; min-width: 4rem; }
.animation output { display: block; font-size: .85rem; min-height: 1.5em; }
.key { font-size: .85rem; color: #444; display: flex; flex-wrap: wrap; gap: 0 1rem; }
.key svg { vertical-align: middle; margin-right: .3rem; }
pre { background: #f4f4f4; padding: .5rem .8rem; overflow-x: auto; }
ul.cut { font-size: .9rem; color: #444; padding-left: 1.2rem; }
@media (max-width: 40rem) {
  .rows { display: block; } .rows tbody { display: block; } .rows tr.head { display: none; }
  .rows tr { display: flex; flex-wrap: wrap; gap: 0 1rem; padding: .4rem 0;
             border-bottom: 1px solid #ddd; }
  .rows td { border: 0; padding: 0; } .rows td.text { flex-basis: 100%; }
  .rows td[data-is]::before { content: attr(data-is) " "; color: #555; }
  .rows td.name { font-weight: 600; }
  .sweep td:first-child, .sweep th:first-child { position: sticky; left: 0; background: #fff;
    white-space: normal; min-width: 7rem; }
}
"""
_BROAD = 500  # points of width beyond which a picture is not shrunk to a narrow window


def page(told: Mapping[str, Any], folder: Path) -> str:
    """The page as HTML. told: what `anytime reproduce --json` prints; folder: where its pictures
    and animations lie, which become part of the page."""
    settings = told["settings"]
    machine = f"Python {told['machine']['python']}, {told['machine']['system']}"
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Both papers' claims beside ours</title><style>{_STYLE}{STYLE}</style>",
        f"<h1>Both papers' claims beside ours</h1><p>{escape(summary(told))} {escape(machine)}.",
        _cut(settings["cut"]),
        "<p>A figure of the paper's own way is judged; ours stands beside it. Of a behaviour it is "
        "the share of the draws that show it, and 95 % must; of a mean, the 95 % interval must "
        "contain what is printed or be better; of a single drawing, what is printed must lie "
        "between our 5th and 95th percentile, or our median be better.",
    ]
    for paper, (short, full) in PAPERS.items():
        rows = rows_of(told, paper)
        if not rows:
            continue
        parts.append(f"<h2>{escape(short)}</h2><p>{escape(full)}")
        parts.append(f"<pre>{_command(paper, told)}</pre>")
        parts.append(_claims(rows))
        for picture in settings["pictures"]:
            if PART[picture["part"]] == paper:
                parts.append(_figure(folder / picture["file"], picture["caption"]))
        parts.append(_animations(settings["animations"], paper, folder))
        if paper == "zr":
            parts += [_sweep(sweep) for sweep in settings["sweeps"]]
    if settings["animations"]:
        code = (files("experiments.reproduction") / "player.js").read_text(encoding="utf-8")
        parts.append(f"<script>{code}</script>")
    if settings["comparisons"]:
        parts.append(f"<h2>{escape(BEYOND)}</h2><p>{escape(READ)}")
        parts.append(f"<pre>{_command(RIVALS, told)}</pre>")
        parts.append(rival_table(told))
    return "\n".join(parts) + "\n"


def _cut(cut: Sequence[str]) -> str:
    lines = "".join(f"<li>{escape(line)}" for line in cut)
    return f'<ul class="cut">{lines}</ul>' if cut else ""


def _command(part: str, told: Mapping[str, Any]) -> str:
    quick = " --quick" if told["settings"]["quick"] else ""
    return escape(f"{COMMANDS[part]} --seed {told['seed']}{quick}")


def _claims(rows: Sequence[Row]) -> str:
    head = ("claim", CLAIMED, "paper", "its way", "low to high", "ours", "")
    body: list[str] = []
    for r in rows:
        figures = zip(head[2:6], (r.paper, r.ours, r.bounds, r.best), strict=True)
        cells = "".join(f'<td data-is="{name}">{figure}' for name, figure in figures)
        body.append(
            f'<tr><td class="name">{escape(r.name)}<td class="text">{escape(r.text)}{cells}'
            f'<td class="{r.sign.split()[0]}">{r.sign}'
        )
    return _table(head, body, "rows")


def _sweep(sweep: Mapping[str, Any]) -> str:
    printed = "<tr><td>printed" + "".join(f"<td>{shown(value)}" for value in sweep["paper"])
    body = [
        f"<tr><td>{escape(name)}" + "".join(f"<td>{cell(found)}" for found in row)
        for name, row in sweep["rows"].items()
    ]
    table = _table(("", *sweep["columns"]), [printed, *body], "sweep")
    return f"<h3>{escape(sweep['title'])}</h3>{table}"


def _table(head: Sequence[str], body: Sequence[str], kind: str) -> str:
    titles = "".join(f'<th class="{_KIND.get(title, "")}">{escape(title)}' for title in head)
    return (
        f'<div class="wide"><table class="{kind}"><tr class="head">{titles}{"".join(body)}'
        "</table></div>"
    )


def _figure(file: Path, caption: str) -> str:
    """A picture with its caption; its names are made its own, as all share one page."""
    svg = file.read_text(encoding="utf-8")
    svg = svg[svg.index("<svg") :]
    own = file.stem
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{own}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{own}-\1)", svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{own}-\1"', svg)
    label = f'<svg role="img" aria-label="{escape(caption)}"'
    svg = svg.replace("<svg", label, 1)
    widths = re.findall(r'\bwidth="([\d.]+)pt"', svg)  # of the whole, as matplotlib says it
    broad = ' class="broad"' if max(map(float, widths), default=0.0) > _BROAD else ""
    return (
        f'<figure{broad}><div class="wide">{svg}</div><figcaption>{escape(caption)}</figcaption>'
        "</figure>"
    )


def _animations(listed: Sequence[Mapping[str, Any]], paper: str, folder: Path) -> str:
    drawn = [
        _animation(folder / each["file"], each["caption"])
        for each in listed
        if PART[each["part"]] == paper
    ]
    return f'<div class="animations">{"".join(drawn)}</div>' if drawn else ""


def _animation(file: Path, caption: str) -> str:
    """A canvas with its data, which `player.js` plays."""
    # In a script element `<` alone can end or nest it.
    data = file.read_text(encoding="utf-8").replace("<", "\\u003c")
    told = json.loads(data)
    key = "".join(
        f'<span><svg width="26" height="8" aria-hidden="true"><path d="M0 4H26" '
        f'stroke="{line["colour"]}" stroke-width="2" '
        f'stroke-dasharray="{" ".join(map(str, line["dash"]))}"/></svg>'
        f"{escape(line['label'])}</span>"
        for line in told["lines"]
    )
    return (
        f'<figure class="animation"><script type="application/json">{data}</script>'
        f'<h4>{escape(told["title"])}</h4><canvas role="img"></canvas>'
        '<div class="controls"><button type="button" aria-label="play">▶</button>'
        '<input type="range" min="0" value="0" aria-label="moment"></div><output></output>'
        f'<div class="key">{key}</div><figcaption>{escape(caption)}</figcaption></figure>'
    )
