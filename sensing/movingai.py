"""The files of the MovingAI grid benchmarks: `.map` and `.scen` [Sturtevant 2012, TCIAIG 4(2)]."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from anytime.errors import AnytimeError
from sensing.maps import LARGEST_MAP, Cell, GridMap

OPTIMUM_TOLERANCE = 0.006
"""How far a published optimum may lie from the true one: older files print six digits."""

_LONGEST_HEADER_LINE = 256
_LARGEST_SCENARIO_FILE = 256 * 1024 * 1024

_PASSABLE, _IMPASSABLE = b".GS", b"@OTW"
_GLYPHS = np.zeros(256, np.uint8)  # 0 = no glyph, 1 = free, 2 = blocked
_GLYPHS[list(_PASSABLE)] = 1
_GLYPHS[list(_IMPASSABLE)] = 2


@dataclass(frozen=True)
class Scenario:
    """One query of a `.scen` file: from start to goal, cells (row, column), on a map of that size.

    `optimal_length` is the octile length of the shortest path, in cells, diagonals only where both
    orthogonal neighbours are free; it is exact within OPTIMUM_TOLERANCE.
    """

    bucket: int
    map_name: str
    width: int
    height: int
    start: Cell
    goal: Cell
    optimal_length: float


def read_movingai(path: str | os.PathLike[str]) -> GridMap:
    """Read a MovingAI `.map` file.

    `.`, `G` and `S` are free; `@`, `O`, `T` and `W` are not. Lines end in LF or CRLF.
    Raises AnytimeError with file and line; sizes are refused from the header, before any memory is
    taken for the rows.
    """
    path = Path(path)
    if not path.is_file():
        raise AnytimeError(f"{path}: no such file, or no plain file")
    try:
        with path.open("rb") as file:
            height, width, line = _read_header(file, path)
            declared = height * width
            room = path.stat().st_size - file.tell()
            if room < declared:
                _refuse(
                    path,
                    line,
                    f"the header declares {height} rows of {width} cells, but only {room} bytes"
                    " follow; correct height and width, or complete the rows",
                )
            if room > height * (width + 2) + 4096:
                _refuse(
                    path,
                    line,
                    f"the header declares {height} rows of {width} cells, but {room} bytes follow;"
                    " correct height and width, or remove what follows the rows",
                )
            body = file.read()
    except OSError as error:
        raise AnytimeError(f"{path}: cannot be read ({error.strerror})") from None
    rows = [row.removesuffix(b"\r") for row in body.rstrip(b"\r\n ").split(b"\n")]
    for number, row in enumerate(rows[:height], line + 1):
        if len(row) != width:
            _refuse(path, number, f"the row has {len(row)} cells; the header says width {width}")
    if len(rows) != height:
        _refuse(
            path,
            line + min(len(rows), height + 1),
            f"the map has {len(rows)} rows; the header says height {height}",
        )
    kinds = _GLYPHS[np.frombuffer(b"".join(rows), np.uint8)].reshape(height, width)
    if not kinds.all():
        row, column = (int(at) for at in np.argwhere(kinds == 0)[0])
        glyph = rows[row][column : column + 1].decode("latin-1")
        _refuse(
            path,
            line + 1 + row,
            f"column {column + 1} holds {glyph!r}; free is one of . G S, blocked one of @ O T W",
        )
    free = kinds == 1
    free.flags.writeable = False
    return GridMap(free, name=path.stem)


def write_movingai(grid: GridMap, path: str | os.PathLike[str]) -> None:
    """Write a map as a MovingAI `.map` file; unknown cells become blocked."""
    rows, columns = grid.shape
    header = f"type octile\nheight {rows}\nwidth {columns}\nmap\n".encode()
    cells = np.full((rows, columns + 1), ord("\n"), np.uint8)
    cells[:, :-1] = np.where(grid.free, ord("."), ord("@"))
    Path(path).write_bytes(header + cells.tobytes())


def read_scenarios(
    path: str | os.PathLike[str], grid: GridMap | None = None
) -> tuple[Scenario, ...]:
    """Read the queries of a MovingAI `.scen` file, in the order of the file.

    With `grid` given, every query must be one on that very map: same size, start and goal free. A
    file made for another size is refused rather than scaled, because its optima would not hold.
    Raises AnytimeError with file and line.
    """
    path = Path(path)
    if not path.is_file():
        raise AnytimeError(f"{path}: no such file, or no plain file")
    if path.stat().st_size > _LARGEST_SCENARIO_FILE:
        raise AnytimeError(f"{path}: larger than {_LARGEST_SCENARIO_FILE} bytes, so split the file")
    lines = _lines(path)
    if not lines or lines[0].split() not in (["version", "1"], ["version", "1.0"]):
        found = lines[0][:40] if lines else ""
        _refuse(path, 1, f"the file begins with {found!r}; a .scen begins with 'version 1'")
    scenarios = []
    for number, line in enumerate(lines[1:], 2):
        if not line.strip():
            continue
        scenario = _scenario(path, number, line)
        if grid is not None:
            _check_fits(path, number, scenario, grid)
        scenarios.append(scenario)
    return tuple(scenarios)


def write_scenarios(scenarios: Iterable[Scenario], path: str | os.PathLike[str]) -> None:
    """Write queries as a MovingAI `.scen` file, with every digit of the optima."""
    lines = ["version 1"]
    for query in scenarios:
        if any(mark in query.map_name for mark in "\t\r\n") or not query.map_name.strip():
            raise AnytimeError(
                f"map name {query.map_name!r}: it must be one line without tabs, not empty"
            )
        (start_y, start_x), (goal_y, goal_x) = query.start, query.goal
        fields = (query.bucket, query.map_name, query.width, query.height)
        fields += (start_x, start_y, goal_x, goal_y, repr(float(query.optimal_length)))
        lines.append("\t".join(str(field) for field in fields))
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _read_header(file, path: Path) -> tuple[int, int, int]:
    """Height, width and the number of the line `map`; the file then stands at the first row."""
    sizes: dict[str, int] = {}
    for number in range(1, 5):
        line = file.readline(_LONGEST_HEADER_LINE)
        if number == 1 and line.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")):
            _refuse(path, 1, "the file begins with a byte order mark; save it as plain ASCII")
        try:
            words = line.decode("ascii").split()
        except UnicodeDecodeError:
            _refuse(path, number, "the header holds bytes that are no ASCII text; is it a .map?")
        shown = line[:40].decode("ascii").strip()
        if number == 1:
            if words != ["type", "octile"]:
                _refuse(path, 1, f"{shown!r}; the first line of a .map is 'type octile'")
        elif number < 4:
            key = words[0] if words else ""
            if key not in ("height", "width") or key in sizes or len(words) != 2:
                _refuse(path, number, f"{shown!r}; lines 2 and 3 are 'height N' and 'width N'")
            sizes[key] = _whole(words[1])
            if sizes[key] < 1:
                _refuse(path, number, f"{key} is {words[1][:20]!r}; it must be a whole number >= 1")
        elif words != ["map"]:
            _refuse(path, 4, f"{shown!r}; line 4 of a .map is 'map'")
    height, width = sizes["height"], sizes["width"]
    if height * width > LARGEST_MAP:
        _refuse(
            path,
            3,
            f"the header declares {height} x {width} cells; at most {LARGEST_MAP} are allowed",
        )
    return height, width, 4


def _lines(path: Path) -> list[str]:
    try:
        text = path.read_bytes()
    except OSError as error:
        raise AnytimeError(f"{path}: cannot be read ({error.strerror})") from None
    if text.startswith((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")):
        _refuse(path, 1, "the file begins with a byte order mark; save it without one")
    try:
        return text.decode("utf-8").split("\n")
    except UnicodeDecodeError as error:
        line = text.count(b"\n", 0, error.start) + 1
        _refuse(path, line, "the line holds bytes that are no text; a .scen is a text file")


def _scenario(path: Path, number: int, line: str) -> Scenario:
    fields = [field.strip() for field in line.split("\t")]
    if len(fields) == 1:  # some files part the columns by spaces
        bucket, _, rest = line.strip().partition(" ")
        fields = [bucket, *rest.rsplit(None, 7)]
    if len(fields) != 9:
        _refuse(
            path,
            number,
            f"{len(fields)} columns; a query has nine: bucket map width height x y x y optimum",
        )
    names = ("bucket", "width", "height", "start x", "start y", "goal x", "goal y")
    numbers = [_whole(text) for text in (fields[0], *fields[2:8])]
    for name, value, text in zip(names, numbers, (fields[0], *fields[2:8]), strict=True):
        if value < 0:
            _refuse(path, number, f"{name} is {text[:20]!r}; it must be a whole number >= 0")
    bucket, width, height, start_x, start_y, goal_x, goal_y = numbers
    try:
        optimal_length = float(fields[8])
    except ValueError:
        optimal_length = math.nan
    if not (math.isfinite(optimal_length) and optimal_length >= 0):
        _refuse(path, number, f"the optimum is {fields[8][:20]!r}; it must be a length >= 0")
    for name, x, y in (("start", start_x, start_y), ("goal", goal_x, goal_y)):
        if x >= width or y >= height:
            _refuse(
                path,
                number,
                f"{name} x {x}, y {y} lies off the map; it is {width} wide and {height} high",
            )
    return Scenario(
        bucket, fields[1], width, height, (start_y, start_x), (goal_y, goal_x), optimal_length
    )


def _check_fits(path: Path, number: int, scenario: Scenario, grid: GridMap) -> None:
    rows, columns = grid.shape
    if (scenario.height, scenario.width) != (rows, columns):
        _refuse(
            path,
            number,
            f"the query is for a map {scenario.width} wide and {scenario.height} high, but"
            f" {grid.name} is {columns} wide and {rows} high; take the map of that size",
        )
    for name, cell in (("start", scenario.start), ("goal", scenario.goal)):
        if not grid.free[cell]:
            _refuse(
                path,
                number,
                f"{name} x {cell[1]}, y {cell[0]} is blocked on {grid.name}; take the map that the"
                " file was made for",
            )


def _whole(text: str) -> int:
    """The number, or -1 if the text is none that a map could need."""
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 12 else -1


def _refuse(path: Path, line: int, problem: str) -> NoReturn:
    raise AnytimeError(f"{path}:{line}: {problem}")
