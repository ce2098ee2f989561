"""From logs to one HTML file that needs no network."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from anytime.errors import AnytimeError
from anytime.files import write_atomically
from anytime.pictures import duration, number
from monitor.log_lines import FrameLine, Log, MomentLine
from monitor.logs import plain
from monitor.page import answers, motion, regretted
from monitor.page.losses import Loss, costliest, waterfall

_SCRIPTS = ("drawing.js", "map.js", "motion.js", "charts.js", "replay.js")


def render(log: Log) -> str:
    """The page of one mission."""
    return render_all([log])


def render_all(
    logs: Sequence[Log],
    *,
    names: Sequence[str] = (),
    summary: str = "",
    title: str = "",
    live: bool = False,
) -> str:
    """One page of several missions, a tab each.

    names: of the tabs, instead of the policies. summary: trusted HTML shown above, for instance a
    table. live: the page listens to `events`.
    """
    data = page_data(logs, names)
    name = title or (f"{logs[0].mission.name}, seed {logs[0].mission.seed}" if logs else "replay")
    parts = {
        "title": html.escape(name),
        "style": _part("replay.css"),
        "summary": f'<section id="summary">{summary}</section>' if summary else "",
        "live": "true" if live else "false",
        # In a script element `<` alone can end or nest it; the separators are JavaScript's.
        "data": _safe(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        "code": "".join(map(_part, _SCRIPTS)),
    }
    page = _part("template.html")
    for key, text in parts.items():
        head, mark, tail = page.partition("{{" + key + "}}")
        assert mark, key
        page = head + text + tail
    return page


def write_page(
    logs: Sequence[Log],
    path: Path | str,
    *,
    names: Sequence[str] = (),
    summary: str = "",
    title: str = "",
) -> Path:
    """Write the page of these missions; the file is whole or absent."""
    path = Path(path)
    write_atomically(path, render_all(logs, names=names, summary=summary, title=title).encode())
    return path


def page_data(logs: Sequence[Log], names: Sequence[str] = ()) -> dict[str, Any]:
    """What the page draws, as plain data: numbers, and the sentences made of them."""
    if names and len(names) != len(logs):
        raise AnytimeError(f"{len(names)} names for {len(logs)} missions; give each a name")
    runs = [_run(log, _fixed(log, logs)) for log in logs]
    for run, name in zip(runs, names or _names(logs), strict=True):
        run["name"] = name
    return plain({"band": answers.BAND, "runs": runs})


def _names(logs: Sequence[Log]) -> list[str]:
    """What tells missions apart: their policies, else with seeds, else with missions as well."""
    lines = [log.mission for log in logs]
    for named in (
        [line.policy for line in lines],
        [f"{line.policy}, seed {line.seed}" for line in lines],
        [f"{line.name}, {line.policy}, seed {line.seed}" for line in lines],
    ):
        if len(set(named)) == len(named):
            return named
    return [f"{name} ({count})" for count, name in enumerate(named, 1)]


def _run(log: Log, division: Mapping[str, Any] | None) -> dict[str, Any]:
    mission, end = log.mission, log.end
    steps = waterfall(log)
    ranked = costliest(log)
    place = {loss.index: (loss, rank) for rank, loss in enumerate(ranked, 1)}
    return {
        "policy": mission.policy,
        "mission": mission.name,
        "seed": mission.seed,
        "machine": mission.machine,
        "state": _state(log),
        "ending": end.ending if end else None,
        "net": log.net,
        "promised": log.promised,
        "seconds": end.seconds if end else (log.frames[-1].ended if log.frames else 0.0),
        "labels": mission.labels,
        "unit": answers.speed_unit(log),
        "scene": _scene(log),
        "fixed": sum(division["shares"].values()) if division else None,
        "frames": [_frame(log, frame, *place[frame.index], division) for frame in log.frames],
        "worst": [loss.index for loss in ranked],
        "waterfall": [
            {"name": step.name, "before": step.before, "after": step.after, "sum": step.sum}
            for step in steps
        ],
        "losses": answers.losses(log, ranked),
        "profile": answers.profile(log),
        "compared": answers.compared(log),
        "job": end.job if end else 0.0,
        "regretted": regretted.sentence(log),
        "opens": motion.opening(log),
        "switching": motion.switching(log),
    }


def _state(log: Log) -> str:
    if log.end is None:
        return f"under way, {len(log.frames)} frames so far"
    text = f"{log.end.ending.replace('_', ' ')} after {duration(log.end.seconds)}"
    promised = "" if log.promised is None else f" (promised {number(log.promised)})"
    fault = f" — {log.end.fault}" if log.end.fault else ""
    return f"{text}, net value {number(log.end.net)}{promised}{fault}"


def _scene(log: Log) -> dict[str, Any] | None:
    scene = log.mission.scene
    if scene is None:
        return None
    return {
        "rows": scene.rows,
        "columns": scene.columns,
        "step": scene.step,
        "resolution": scene.resolution,
        "start": scene.start,
        "goals": [scene.goal, *scene.also],
        "radius": scene.radius,
        "density": scene.density,
        "truth": scene.truth,
    }


def _frame(
    log: Log, frame: FrameLine, loss: Loss, rank: int, division: Mapping[str, Any] | None
) -> dict[str, Any]:
    box = frame.belief
    return {
        "index": frame.index,
        "started": frame.started,
        "ended": frame.ended,
        "standing": frame.standing,
        "interrupted": frame.interrupted,
        "driven": frame.driven,
        "so_far": frame.so_far,
        "lost": [loss.drive, loss.wait, loss.energy],
        "fell": None if loss.before is None else loss.total,
        "here_lost": answers.here_lost(frame, loss, rank, len(log.frames)),
        "here_seen": answers.here_seen(frame),
        "path": frame.path,
        "plan": frame.plan,
        "belief": [box.row, box.column, box.rows, box.columns, box.levels] if box else None,
        "motion": motion.drawn(frame),
        "forks": regretted.forks(log, frame),
        "here_regretted": regretted.here(log, frame),
        "calls": [
            {
                "label": call.label,
                "started": call.started,
                "elapsed": call.elapsed,
                "share": call.share,
                "overrun": call.overrun,
                "status": call.status,
                "text": answers.call_text(call),
            }
            for call in frame.calls
        ],
        "moments": [_moment(log, frame, moment, division) for moment in frame.moments],
    }


def _moment(
    log: Log, frame: FrameLine, moment: MomentLine, division: Mapping[str, Any] | None
) -> dict[str, Any]:
    prices = answers.prices_of(frame, moment)
    return {
        "time": moment.time,
        "kind": moment.moment,
        "shares": moment.shares,
        "contract": moment.contract,
        "speed": moment.speed,
        "net": moment.net,
        "curve": moment.curve,
        "chosen": answers.worth_at(moment, moment.contract),
        "worth": answers.worth_of(moment),
        "prices": prices,
        "headline": motion.headline(frame) or answers.headline(log, frame, moment),
        "why": answers.why(log, frame, moment),
        "fixed": answers.fixed(log, frame, moment, division),
        "price": answers.price(frame, moment, prices),
    }


def _fixed(log: Log, logs: Sequence[Log]) -> Mapping[str, Any] | None:
    """The fixed division to compare with: that of the mission beside it, or the log's own."""
    for other in logs:
        same = (other.mission.name, other.mission.seed) == (log.mission.name, log.mission.seed)
        if other is not log and same and other.mission.policy == "fixed" and other.frames:
            decision = other.frames[0].moments[0]
            return {"shares": decision.shares, "speed": decision.speed, "net": other.net}
    return log.mission.fixed


def _part(name: str) -> str:
    return (files("monitor.page") / name).read_text(encoding="utf-8")


def _safe(text: str) -> str:
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
