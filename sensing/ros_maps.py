"""The maps of ROS's map_server and Nav2: a yaml file and the image that it names."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import NoReturn

import numpy as np
import yaml

from anytime.errors import AnytimeError
from sensing.images import read_pgm, write_pgm
from sensing.maps import GridMap

_OCCUPIED, _UNKNOWN, _FREE = 0, 205, 254
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_LARGEST_YAML = 65536


def read_ros_map(path: str | os.PathLike[str]) -> GridMap:
    """Read a map of ROS's map_server; the image is looked for beside the yaml file.

    A pixel v is blocked with probability (255 - v)/255, or v/255 if `negate`: above
    `occupied_thresh` the cell is blocked, below `free_thresh` free, else unknown. The value 205 is
    unknown whatever the thresholds (map_saver writes it so; at Nav2's default of 0.25 it would pass
    for free), except with `negate`. Row 0 of the image is row 0 of the map: the greatest y.

    Raises AnytimeError, in one line with file and line, for anything else.
    """
    path = Path(path)
    settings, lines = _read_yaml(path)
    for key in _KEYS:
        if key not in settings:
            raise AnytimeError(f"{path}: no {key!r}; a ROS map names {', '.join(_KEYS)}")

    def refuse(key: str, right: str) -> NoReturn:
        raise AnytimeError(f"{path}:{lines.get(key, 1)}: {key} is {_shown(settings[key])}; {right}")

    def number(key: str, low: float, high: float, right: str) -> float:
        value = _number(settings[key])
        if not low <= value <= high:  # NaN is nowhere
            refuse(key, right)
        return value

    if settings.get("mode", "trinary") != "trinary":
        refuse("mode", "only trinary maps tell where a robot may go, so save it as trinary")
    resolution = number("resolution", 1e-6, 1e6, "it must be metres per cell, a positive number")
    occupied = number("occupied_thresh", 0.0, 1.0, "it must be a probability from 0 to 1")
    free_below = number("free_thresh", 0.0, occupied, "it must be from 0 to occupied_thresh")
    negate = settings["negate"]
    if negate not in (0, 1):
        refuse("negate", "it must be 0 or 1")
    origin = settings["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        refuse("origin", "it must be [x, y, yaw]")
    x, y, yaw = (_number(part) for part in origin)
    if not all(math.isfinite(part) for part in (x, y, yaw)):
        refuse("origin", "it must be [x, y, yaw], three finite numbers")
    image = read_pgm(_image_path(path, settings["image"], refuse))
    shade = np.arange(256) / 255
    blocked_probability = shade if negate else 1 - shade
    kind_free = blocked_probability < free_below
    kind_unknown = ~kind_free & (blocked_probability <= occupied)
    if not negate:
        kind_free[_UNKNOWN], kind_unknown[_UNKNOWN] = False, True
    free, unknown = kind_free[image], kind_unknown[image]
    free.flags.writeable = False
    unknown.flags.writeable = False
    return GridMap(free, unknown if unknown.any() else None, resolution, (x, y, yaw), path.stem)


def write_ros_map(grid: GridMap, path: str | os.PathLike[str]) -> None:
    """Write a map as `path`, a yaml file, with its PGM image of the same name beside it."""
    path = Path(path)
    if path.suffix not in (".yaml", ".yml"):
        raise AnytimeError(f"{path}: a ROS map is written to a file that ends in .yaml")
    image = np.where(grid.free, _FREE, _OCCUPIED).astype(np.uint8)
    if grid.unknown is not None:
        image[grid.unknown] = _UNKNOWN
    picture = path.with_suffix(".pgm")
    write_pgm(image, picture)
    x, y, yaw = (float(part) for part in grid.origin)
    image_name = yaml.safe_dump(picture.name, allow_unicode=True, width=math.inf)
    path.write_text(
        f"image: {image_name.splitlines()[0]}\n"
        "mode: trinary\n"
        f"resolution: {float(grid.resolution)!r}\n"
        f"origin: [{x!r}, {y!r}, {yaw!r}]\n"
        "negate: 0\n"
        "occupied_thresh: 0.65\n"
        "free_thresh: 0.196\n",
        encoding="utf-8",
        newline="\n",
    )


def _read_yaml(path: Path) -> tuple[dict[str, object], dict[str, int]]:
    """The settings of the file, and the line of each."""
    if not path.is_file():
        raise AnytimeError(f"{path}: no such file, or no plain file")
    try:
        with path.open("rb") as file:
            text = file.read(_LARGEST_YAML + 1)
    except OSError as error:
        raise AnytimeError(f"{path}: cannot be read ({error.strerror})") from None
    if len(text) > _LARGEST_YAML:
        raise AnytimeError(f"{path}: larger than {_LARGEST_YAML} bytes; is it the yaml of a map?")
    try:
        settings = yaml.safe_load(text)
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        problem = " ".join((error.problem or "syntax").split())[:80]
        raise AnytimeError(f"{path}:{line}: no yaml ({problem})") from None
    except Exception:  # yaml's constructors let through whatever int, float and date raise
        raise AnytimeError(f"{path}:1: no yaml; a ROS map is lines of 'key: value'") from None
    if not isinstance(settings, dict) or not isinstance(node, yaml.MappingNode):
        raise AnytimeError(f"{path}:1: no settings; a ROS map is lines of 'key: value'")
    lines = {str(key.value): key.start_mark.line + 1 for key, _ in node.value}
    return settings, lines


def _image_path(path: Path, image: object, refuse) -> Path:
    if not isinstance(image, str) or not image.strip() or "\0" in image:
        refuse("image", "it must be the name of a PGM file")
    folder = path.resolve().parent
    picture = (folder / str(image)).resolve()
    if not picture.is_relative_to(folder):
        refuse("image", "it must lie in the folder of the yaml file, or below")
    if picture.suffix.lower() != ".pgm":
        refuse("image", "it must be a PGM image, so convert it")
    return picture


def _shown(value: object) -> str:
    """A setting as an error shows it; never a nest of aliases, whose text can be endless."""
    flat = isinstance(value, list) and len(value) < 5 and not any(map(_is_nest, value))
    if _is_nest(value) and not flat:
        return f"a {type(value).__name__}"
    try:
        text = repr(value)
    except ValueError:  # Python does not print integers of thousands of digits
        return "a number of thousands of digits"
    return text if len(text) <= 40 else text[:37] + "..."


def _is_nest(value: object) -> bool:
    return isinstance(value, list | dict | set | tuple)


def _number(value: object) -> float:
    """The value as a float, or NaN if it is no number; YAML 1.1 reads 1e-3 as text."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan
