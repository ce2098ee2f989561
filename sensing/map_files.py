"""Map files of either kind, and where the public ones lie."""

from __future__ import annotations

import os
from pathlib import Path

from anytime.errors import AnytimeError
from sensing import movingai, ros_maps
from sensing.maps import GridMap

_REPOSITORY = Path(__file__).resolve().parent.parent


def read_map(path: str | os.PathLike[str]) -> GridMap:
    """Read a map file: MovingAI `.map`, or ROS `.yaml` with its image.

    Raises AnytimeError, in one line with file and line, if the file is no such map.
    """
    readers = {
        ".map": movingai.read_movingai,
        ".yaml": ros_maps.read_ros_map,
        ".yml": ros_maps.read_ros_map,
    }
    reader = readers.get(Path(path).suffix.lower())
    if reader is None:
        raise AnytimeError(f"{path}: a map file ends in .map (MovingAI) or .yaml (ROS)")
    return reader(path)


def map_folder() -> Path | None:
    """Where the public maps lie: `$ANYTIME_MAPS`, else `../shared/maps`; None if absent."""
    return _folder("ANYTIME_MAPS", "maps")


def trace_folder() -> Path | None:
    """Where the public traces lie: `$ANYTIME_TRACES`, else `../shared/traces`; None if absent."""
    return _folder("ANYTIME_TRACES", "traces")


def _folder(variable: str, name: str) -> Path | None:
    named = os.environ.get(variable)
    folder = Path(named) if named else _REPOSITORY.parent / "shared" / name
    return folder if folder.is_dir() else None
