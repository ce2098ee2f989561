"""What ships with the project: maps, missions and measured profiles."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from anytime import ProfileLibrary

DATA = Path(str(files("experiments") / "data"))


def mission_path(name: str = "office") -> Path:
    """The file of a shipped mission."""
    return DATA / "missions" / f"{name}.toml"


def profiles() -> ProfileLibrary:
    """The shipped profiles of `see` and `find_path`, quality over units of work."""
    return ProfileLibrary(DATA / "profiles")
