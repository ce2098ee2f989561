"""The log of a mission: a line a frame, append-only, the same bytes for the same seed.

Nothing of the machine's wall is in it (host, versions, time of day): that lies beside, in
`wall.json`.
"""

from __future__ import annotations

import base64
import json
import math
import platform
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.files import write_atomically
from monitor.log_lines import DRAWN, LEVELS, SCHEMA, Cell, Log
from monitor.log_reading import read_log
from monitor.missions import Mission
from monitor.reports import Frame, Report

__all__ = ["Floor", "Log", "LogWriter", "plain", "read_log", "write_log", "write_wall"]


@dataclass(frozen=True, eq=False)
class Floor:
    """Where a mission takes place, for the log and its page.

    free: bool [rows, columns], the truth. start, goal: (row, column). radius: of sensing, in cells.
    resolution: metres a cell. density: prior probability that a cell is blocked. also: further
    goals.
    """

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    radius: float
    resolution: float = 1.0
    density: float = 0.2
    also: tuple[Cell, ...] = ()

    @property
    def step(self) -> int:
        """Cells of the map along one cell of the log."""
        return max(1, math.ceil(math.sqrt(self.free.size / DRAWN)))


class LogWriter:
    """Writes a log line by line; each frame is on the disk's side before the next begins.

    Use it as a context manager and pass `writer.frame` to `Monitor.run(listen=…)`.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._file: BinaryIO | None = None
        self._mission: Mission | None = None
        self._step = 1
        self._levels: NDArray[np.uint8] | None = None
        self._energy = 0.0

    def __enter__(self) -> LogWriter:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_wall(self.path.parent)
        self._file = self.path.open("wb", buffering=0)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def mission(
        self,
        mission: Mission,
        *,
        policy: str,
        seed: int,
        labels: tuple[str, ...],
        machine: str = "",
        floor: Floor | None = None,
        fixed: Mapping[str, Any] | None = None,
    ) -> None:
        """Write the first line."""
        self._mission = mission
        self._step = floor.step if floor else 1
        self._levels, self._energy = None, 0.0
        line: dict[str, Any] = {
            "kind": "mission",
            "schema": SCHEMA,
            "name": mission.name,
            "policy": policy,
            "seed": seed,
            "machine": machine,
            "labels": labels,
            "value": asdict(mission.value),
            "energy": asdict(mission.energy),
            "speeds": mission.speeds,
            "job": mission.job,
            "gain": mission.gain,
            "scene": _scene(floor) if floor else None,
        }
        fixed = fixed or _division(mission.fixed)
        if fixed:
            line["fixed"] = dict(fixed)
        if mission.news is not None:
            line["news"] = {"at": mission.news.at, **asdict(mission.news.value)}
        self._write(line)

    def frame(self, frame: Frame) -> None:
        """Write a frame. Of its story are drawn: `path`, `plan`, `motion`, and `belief`, an array
        of probabilities of being blocked or an object with `probabilities()`."""
        if self._mission is None:
            raise AnytimeError(f"{self.path}: write the mission before its frames")
        self._energy += frame.energy
        known = self._mission.known(frame.ended)
        value, price = known.value(frame.ended), known.energy.price
        story = dict(frame.story)
        belief = story.pop("belief", None)
        line: dict[str, Any] = {
            "kind": "frame",
            "index": frame.index,
            "started": frame.started,
            "ended": frame.ended,
            "standing": frame.standing,
            "moments": [
                {
                    "time": moment.time,
                    "moment": moment.moment,
                    "shares": dict(moment.decision.shares),
                    "speed": moment.decision.speed,
                    "value": moment.decision.why.value,
                    "cost": moment.decision.why.cost,
                    "seconds": moment.decision.why.seconds,
                    "curve": moment.decision.why.curve,
                    "case": moment.decision.why.case,
                }
                for moment in frame.moments
            ],
            "calls": [asdict(call) for call in frame.calls],
            "driven": frame.driven,
            "waited": frame.waited,
            "energy": frame.energy,
            "interrupted": frame.interrupted,
            "so_far": float(value) - price * self._energy,
            "path": story.pop("path", ()),
            "plan": story.pop("plan", ()),
            "belief": self._changed(belief),
            "story": story,
        }
        if "motion" in story:
            line["motion"] = story.pop("motion")
        if frame.decision.why.prices:
            line["prices"] = dict(frame.decision.why.prices)
        self._write(line)

    def end(self, report: Report) -> None:
        """Write the last line."""
        self._write(
            {
                "kind": "end",
                "ending": report.ending.value,
                "promised": report.promised,
                "net": report.net,
                "earned": report.earned,
                "seconds": report.seconds,
                "energy": report.energy,
                "job": report.job,
                "ledger": report.ledger,
                "fault": report.fault,
            }
        )

    def _changed(self, belief: Any) -> dict[str, Any] | None:
        """The box of the belief that differs from the frame before; the whole for the first."""
        if belief is None:
            return None
        sure = belief.probabilities() if hasattr(belief, "probabilities") else belief
        levels = _thinned(np.rint(np.asarray(sure, float) * LEVELS), self._step).astype(np.uint8)
        before, self._levels = self._levels, levels
        if before is None or before.shape != levels.shape:
            different = np.ones(levels.shape, bool)
        else:
            different = before != levels
        rows, columns = np.flatnonzero(different.any(1)), np.flatnonzero(different.any(0))
        if not len(rows):
            return None
        top, left = int(rows[0]), int(columns[0])
        box = levels[top : rows[-1] + 1, left : columns[-1] + 1]
        flat = np.append(box.ravel(), np.zeros(box.size % 2, np.uint8))
        return {
            "row": top,
            "column": left,
            "rows": box.shape[0],
            "columns": box.shape[1],
            "levels": _text(flat[::2] * np.uint8(16) + flat[1::2]),
        }

    def _write(self, line: Mapping[str, Any]) -> None:
        if self._file is None:
            raise AnytimeError(f"{self.path}: the log is not open; use `with LogWriter(path) as …`")
        text = json.dumps(plain(line), separators=(",", ":"), allow_nan=False)
        self._file.write(text.encode() + b"\n")


def write_log(
    path: Path | str,
    mission: Mission,
    floor: Floor | None,
    report: Report,
    *,
    labels: tuple[str, ...] | None = None,
    fixed: Mapping[str, Any] | None = None,
) -> Path:
    """Write the log of a mission that is over: the bytes of a `LogWriter` given the same frames.

    What a robot shows only to those who listen (its belief) is not in a report's frames.
    """
    if labels is None:
        shares = (frame.decision.shares for frame in report.frames)
        labels = tuple(next(shares, {}))
    with LogWriter(path) as writer:
        writer.mission(
            mission,
            policy=report.policy,
            seed=report.seed,
            labels=labels,
            machine=report.machine,
            floor=floor,
            fixed=fixed,
        )
        for frame in report.frames:
            writer.frame(frame)
        writer.end(report)
    return writer.path


def write_wall(folder: Path) -> None:
    """Write what a log must not hold, beside it: host, versions, time of day."""
    versions: dict[str, str] = {"python": platform.python_version()}
    for package in ("anytime-robots", "numpy", "numba", "scipy"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    facts = {
        "host": platform.node(),
        "system": platform.platform(),
        "machine": platform.machine(),
        "byteorder": sys.byteorder,
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": versions,
    }
    write_atomically(folder / "wall.json", (json.dumps(facts, indent=1) + "\n").encode())


def plain(value: Any) -> Any:
    """Plain data for JSON: arrays as lists, floats of 9 significant digits, null for NaN and ∞."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.9g}") if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if value is None or isinstance(value, int | str):
        return value
    raise AnytimeError(
        f"a {type(value).__name__} cannot be logged; a story is numbers, texts, lists and arrays"
    )


def _division(tuned: Mapping[str, float]) -> dict[str, Any]:
    """A mission's fixed division, {call: seconds, "speed": …}, as a log has it."""
    shares = {name: seconds for name, seconds in tuned.items() if name != "speed"}
    return {"shares": shares, "speed": tuned["speed"]} if shares and "speed" in tuned else {}


def _scene(floor: Floor) -> dict[str, Any]:
    thin = _thinned(floor.free, floor.step)
    return {
        "rows": thin.shape[0],
        "columns": thin.shape[1],
        "step": floor.step,
        "resolution": floor.resolution,
        "start": floor.start,
        "goal": floor.goal,
        "radius": floor.radius,
        "density": floor.density,
        "truth": _text(np.packbits(thin)),
    } | ({"also": floor.also} if floor.also else {})


def _thinned(grid: NDArray[Any], step: int) -> NDArray[Any]:
    return grid[::step, ::step]


def _text(content: NDArray[np.uint8]) -> str:
    return base64.b64encode(content.tobytes()).decode()
