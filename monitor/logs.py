"""The log of a mission: a line a frame, append-only, the same bytes for the same seed.

Nothing of the machine's wall is in it (host, versions, time of day): that lies beside, in
`wall.json`.
"""

from __future__ import annotations

import base64
import binascii
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

import msgspec
import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.files import LARGEST, write_atomically
from monitor.endings import Ending
from monitor.missions import Energy, Mission, Value
from monitor.reports import Frame, Report

SCHEMA = "anytime.log/1"
LEVELS = 15  # of belief: 0 = surely free … 15 = surely blocked, so that two cells fill a byte
DRAWN = 2**18  # cells that are logged of a map at most; a larger one is thinned out
Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Floor:
    """Where a mission takes place, for the log and its page.

    free: bool [rows, columns], the truth. start, goal: (row, column). radius: of sensing, in cells.
    resolution: metres a cell. density: prior probability that a cell is blocked.
    """

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    radius: float
    resolution: float = 1.0
    density: float = 0.2

    @property
    def step(self) -> int:
        """Cells of the map along one cell of the log."""
        return max(1, math.ceil(math.sqrt(self.free.size / DRAWN)))


class _Line(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """A line of a log; unknown fields are refused."""


class SceneFacts(_Line, frozen=True):
    """The floor as logged: `rows` x `columns` cells of `step` x `step` cells of the map each.

    truth: base64 of the packed bits of the free cells. Places are in cells of the map.
    """

    rows: int
    columns: int
    step: int
    resolution: float
    start: Cell
    goal: Cell
    radius: float
    density: float
    truth: str


class Box(_Line, frozen=True):
    """The part of the belief that changed: base64 of levels 0 … 15, two a byte, high one first."""

    row: int
    column: int
    rows: int
    columns: int
    levels: str


class MomentLine(_Line, frozen=True):
    """A decision, and the numbers behind it: see `monitor.states.Why`."""

    time: float
    moment: str
    shares: dict[str, float]
    speed: float
    value: float | None
    cost: float | None
    seconds: float | None
    curve: tuple[tuple[float, float | None], ...]
    case: str

    @property
    def contract(self) -> float:
        """The contract time t_c of the frame."""
        return sum(self.shares.values())

    @property
    def net(self) -> float | None:
        """The net value foreseen; None when the decision was made without foresight."""
        if self.value is None or self.cost is None or self.seconds is None:
            return None
        return self.value - self.cost if self.curve else None


class CallLine(_Line, frozen=True):
    """One call of the program in a frame: see `monitor.reports.CallRecord`."""

    label: str
    started: float
    elapsed: float
    share: float
    overrun: float
    status: str
    advertised: float | None
    estimate: float | None
    fault: str | None


class MissionLine(_Line, frozen=True, tag_field="kind", tag="mission"):
    """The first line. fixed: {"shares", "speed", "net"} of a fixed division on the same seed."""

    schema: str
    name: str
    policy: str
    seed: int
    machine: str
    labels: tuple[str, ...]
    value: dict[str, float | str]
    energy: dict[str, float]
    speeds: tuple[float, float]
    job: float
    gain: float
    scene: SceneFacts | None = None
    fixed: dict[str, Any] | None = None

    def worth(self, seconds: float) -> float:
        """The value of completing after so many seconds."""
        kind, worth, scale = (self.value[name] for name in ("kind", "worth", "seconds"))
        return float(Value(kind, float(worth), float(scale))(seconds))  # type: ignore[arg-type]


class FrameLine(_Line, frozen=True, tag_field="kind", tag="frame"):
    """A frame. so_far: value of completing at its end − price × energy used until then.

    path: cells walked. plan: (level, row, column) of the plan executed. prices: net value of one
    more second for each call.
    """

    index: int
    started: float
    ended: float
    standing: bool
    moments: tuple[MomentLine, ...]
    calls: tuple[CallLine, ...]
    driven: float
    waited: float
    energy: float
    interrupted: bool
    so_far: float
    path: tuple[Cell, ...] = ()
    plan: tuple[tuple[int, int, int], ...] = ()
    belief: Box | None = None
    prices: dict[str, float | None] | None = None
    story: dict[str, Any] = {}


class EndLine(_Line, frozen=True, tag_field="kind", tag="end"):
    """The last line: see `monitor.reports.Report`."""

    ending: str
    promised: float | None
    net: float
    earned: float
    seconds: float
    energy: float
    job: float
    ledger: dict[str, float]
    fault: str = ""


@dataclass(frozen=True)
class Log:
    """A mission as it was logged; `end` is None while it goes on or when it was cut off."""

    mission: MissionLine
    frames: tuple[FrameLine, ...] = ()
    end: EndLine | None = None

    @property
    def promised(self) -> float | None:
        """The net value foreseen when the task was presented."""
        return self.frames[0].moments[0].net if self.frames else None

    @property
    def net(self) -> float | None:
        """What the mission was really worth, or would be if it ended now."""
        if self.end is not None:
            return self.end.net
        return self.frames[-1].so_far if self.frames else None


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
        self._write(line)

    def frame(self, frame: Frame, prices: Mapping[str, float] | None = None) -> None:
        """Write a frame. Of its story are drawn: `path`, `plan`, and `belief`, an array of
        probabilities of being blocked or an object with `probabilities()`."""
        if self._mission is None:
            raise AnytimeError(f"{self.path}: write the mission before its frames")
        self._energy += frame.energy
        value, price = self._mission.value(frame.ended), self._mission.energy.price
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
        if prices:
            line["prices"] = dict(prices)
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
    """Write the log of a mission that is over: the bytes that a `LogWriter` wrote during it."""
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


def read_log(path: Path | str) -> Log:
    """Read a log; a torn last line, as a crash leaves it, is dropped.

    Raises AnytimeError with file and line for whatever else is wrong.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST:
            raise AnytimeError(f"{path}: {path.stat().st_size} bytes; at most {LARGEST} are read")
        content = path.read_bytes()
    except FileNotFoundError:
        raise AnytimeError(f"{path}: no such file; `anytime run … --log` writes one") from None
    except OSError as error:
        raise AnytimeError(f"{path}: {error.strerror or error}") from None
    # What follows the last line feed is torn or still being written.
    lines = content.split(b"\n")[:-1]
    mission: MissionLine | None = None
    frames: list[FrameLine] = []
    end: EndLine | None = None
    for number, text in enumerate(lines, 1):
        line = _parsed(text, f"{path}:{number}")
        if isinstance(line, MissionLine) and mission is None:
            mission = line
        elif mission is None or end is not None or isinstance(line, MissionLine):
            raise AnytimeError(f"{path}:{number}: a log is one mission, its frames and one end")
        elif isinstance(line, EndLine):
            end = line
        else:
            if line.index != len(frames):
                raise AnytimeError(
                    f"{path}:{number}: frame {line.index} follows {len(frames)} frames; a log "
                    "holds every frame in order"
                )
            _check_frame(line, mission, f"{path}:{number}")
            frames.append(line)
    if mission is None:
        raise AnytimeError(f"{path}: not a log: its first line must be the mission")
    return Log(mission, tuple(frames), end)


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
    }


def _thinned(grid: NDArray[Any], step: int) -> NDArray[Any]:
    return grid[::step, ::step]


def _text(content: NDArray[np.uint8]) -> str:
    return base64.b64encode(content.tobytes()).decode()


def _parsed(text: bytes, where: str) -> MissionLine | FrameLine | EndLine:
    try:
        content = json.loads(text, object_pairs_hook=_unique, parse_constant=_refused)
        line = msgspec.convert(content, MissionLine | FrameLine | EndLine)
    except msgspec.ValidationError as error:
        raise AnytimeError(f"{where}: {error}") from None
    except json.JSONDecodeError as error:
        raise AnytimeError(f"{where}: not JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise AnytimeError(f"{where}: {error}") from None
    if isinstance(line, MissionLine):
        _check_mission(line, where)
    if isinstance(line, EndLine) and line.ending not in {ending.value for ending in Ending}:
        raise AnytimeError(f"{where}: {line.ending!r} is not one of the endings")
    return line


def _check_mission(line: MissionLine, where: str) -> None:
    if line.schema != SCHEMA:
        raise AnytimeError(f"{where}: has schema {line.schema!r}, needed is {SCHEMA!r}")
    try:
        Value(**line.value)  # type: ignore[arg-type]
        Energy(**line.energy)
    except (TypeError, ValueError) as error:
        raise AnytimeError(f"{where}: {error}") from None
    scene = line.scene
    if scene is not None:
        cells = scene.rows * scene.columns
        if min(scene.rows, scene.columns, scene.step) < 1 or cells > 4 * DRAWN:
            raise AnytimeError(f"{where}: a scene of {scene.rows} x {scene.columns} cells")
        _check_bytes(scene.truth, (cells + 7) // 8, f"{where}: scene.truth")


def _check_frame(line: FrameLine, mission: MissionLine, where: str) -> None:
    if not line.moments:
        raise AnytimeError(f"{where}: a frame has at least one moment, its decision")
    box = line.belief
    if box is None:
        return
    scene = mission.scene
    fits = (
        scene is not None
        and min(box.row, box.column) >= 0
        and min(box.rows, box.columns) >= 1
        and box.row + box.rows <= scene.rows
        and box.column + box.columns <= scene.columns
    )
    if not fits:
        raise AnytimeError(f"{where}: the belief's box is not within the scene")
    _check_bytes(box.levels, (box.rows * box.columns + 1) // 2, f"{where}: belief.levels")


def _check_bytes(text: str, count: int, where: str) -> None:
    try:
        found = len(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        raise AnytimeError(f"{where} is not base64") from None
    if found != count:
        raise AnytimeError(f"{where} has {found} bytes; needed are {count}")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return content


def _refused(name: str) -> Any:
    raise ValueError(f"{name} is not a number that a log may hold")
