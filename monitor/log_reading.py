"""Reading the log of a mission, a torn or hostile one too."""

from __future__ import annotations

import base64
import binascii
import json
import math
from pathlib import Path
from typing import Any

import msgspec

from anytime.errors import AnytimeError
from anytime.files import LARGEST
from monitor.endings import Ending
from monitor.log_lines import DRAWN, SCHEMA, EndLine, FrameLine, Log, MissionLine, RegretLine
from monitor.missions import Energy, News, Value


class _Fixed(msgspec.Struct):
    shares: dict[str, float]
    speed: float
    net: float | None = None


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
    regrets: list[RegretLine] = []
    for number, text in enumerate(lines, 1):
        line = _parsed(text, f"{path}:{number}")
        if isinstance(line, MissionLine) and mission is None:
            mission = line
        elif isinstance(line, RegretLine):
            if end is None or line.frame != len(regrets) or line.frame >= len(frames):
                raise AnytimeError(
                    f"{path}:{number}: the regret of frame {line.frame}; they follow the end, "
                    "one for each frame in order"
                )
            if not line.forks:
                raise AnytimeError(f"{path}:{number}: a regret is made of one fork or more")
            decided = frames[line.frame].moments[0].shares
            if any(shares.keys() - decided for shares, _, _ in line.forks):
                raise AnytimeError(
                    f"{path}:{number}: a fork gives time to a call that its frame does not have"
                )
            regrets.append(line)
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
            before = frames[-1].started if frames else 0.0
            if not before <= line.started <= line.ended < math.inf:
                raise AnytimeError(
                    f"{path}:{number}: frame {line.index} from {line.started} to {line.ended} s; "
                    f"it must begin at {before} s or later, and end"
                )
            _check_frame(line, mission, f"{path}:{number}")
            frames.append(line)
    if mission is None:
        raise AnytimeError(f"{path}: not a log: its first line must be the mission")
    return Log(mission, tuple(frames), end, tuple(regrets))


def _parsed(text: bytes, where: str) -> MissionLine | FrameLine | EndLine | RegretLine:
    try:
        content = json.loads(text, object_pairs_hook=_unique, parse_constant=_refused)
        line = msgspec.convert(content, MissionLine | FrameLine | EndLine | RegretLine)
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
        if line.news is not None:
            told = dict(line.news)
            News(told.pop("at", math.nan), Value(**told))  # type: ignore[arg-type]
        Energy(**line.energy)
    except (TypeError, ValueError) as error:
        raise AnytimeError(f"{where}: {error}") from None
    if line.fixed is not None:
        try:
            msgspec.convert(line.fixed, _Fixed)
        except msgspec.ValidationError as error:
            raise AnytimeError(f"{where}: fixed: {error}") from None
    scene = line.scene
    if scene is not None:
        cells = scene.rows * scene.columns
        if min(scene.rows, scene.columns, scene.step) < 1 or cells > 4 * DRAWN:
            raise AnytimeError(f"{where}: a scene of {scene.rows} x {scene.columns} cells")
        _check_bytes(scene.truth, (cells + 7) // 8, f"{where}: scene.truth")


def _check_frame(line: FrameLine, mission: MissionLine, where: str) -> None:
    if not line.moments:
        raise AnytimeError(f"{where}: a frame has at least one moment, its decision")
    if line.motion is not None and not line.motion.track:
        raise AnytimeError(f"{where}: a motion has at least one place in its track")
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
