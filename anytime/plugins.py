"""What other packages add by entry points: modules, commands, drawings, endings of campaigns."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Any

from anytime.errors import AnytimeError

GROUPS = ("anytime.commands", "anytime.drawings", "anytime.endings", "anytime.modules")


def registered(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by name, sorted; nothing is imported."""
    return {point.name: point for point in sorted(entry_points(group=group), key=lambda p: p.name)}


def load(point: EntryPoint) -> Any:
    """What an entry point names. Raises AnytimeError that tells whose it is and what is wrong."""
    try:
        return point.load()
    except Exception as error:  # whatever a third party's file does when it is imported
        raise AnytimeError(
            f"{origin(point)} cannot be loaded: {type(error).__name__}: {error}"
        ) from error


def origin(point: EntryPoint) -> str:
    """A name and the package that registered it."""
    package = point.dist.name if point.dist is not None else "an unknown package"
    return f"{point.name!r} of {package}"


def broken() -> list[str]:
    """One line for each entry point of ours that cannot be loaded. Imports them all."""
    told: list[str] = []
    for group in GROUPS:
        for point in registered(group).values():
            try:
                load(point)
            except AnytimeError as error:
                told.append(f"{group}: {error}")
    return told
