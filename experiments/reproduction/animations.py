"""Animations of a reproduction: what is there moment by moment, as data that a page can draw."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from anytime.files import write_atomically
from anytime.pictures import COLOURS

Place = tuple[float, float]
"""x and y; y points up. Metres, or cells of a floor."""
Disc = tuple[float, float, float]
"""x, y and radius."""
DASHES = ((), (6, 4), (1, 4))
"""Of the lines, so that they are told apart in grey too."""


class Moment(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is there at a moment.

    at: seconds, or whatever else goes on. lines: places, of each of the animation's lines. discs:
    obstacles; rings: those believed. squares: left, lower and side. robot: x, y, heading, radius.
    said: in a few words, what happened.
    """

    at: float
    lines: tuple[tuple[Place, ...], ...] = ()
    goal: Place | None = None
    discs: tuple[Disc, ...] = ()
    rings: tuple[Disc, ...] = ()
    squares: tuple[tuple[int, int, int], ...] = ()
    robot: tuple[float, float, float, float] | None = None
    said: str = ""


class Line(msgspec.Struct, frozen=True, omit_defaults=True):
    """How a line is drawn, and what it is. grows: moments hold what comes on to it, not all."""

    label: str
    colour: str
    dash: tuple[int, ...]
    grows: bool = False


class Animation(msgspec.Struct, frozen=True):
    """Moments, one after the other, in a box (left, lower, right, upper) of a unit.

    clock: what `Moment.at` counts. floor: rows of blocked cells from below, as bits of hexadecimal
    numbers, the left cell first.
    """

    title: str
    unit: str
    clock: str
    box: tuple[float, float, float, float]
    lines: tuple[Line, ...]
    moments: tuple[Moment, ...]
    floor: tuple[str, ...] = ()


@dataclass(frozen=True)
class Animated:
    """file: of an `Animation` as JSON. caption: what it shows. part: of the claims that it belongs
    to."""

    part: str
    file: Path
    caption: str


def lines(*labels: str, growing: str = "") -> tuple[Line, ...]:
    """Lines of that meaning, each in a colour and a style of its own, of which one may grow."""
    return tuple(
        Line(label, COLOURS[place], DASHES[place % len(DASHES)], label == growing)
        for place, label in enumerate(labels)
    )


def places(points: Iterable[Sequence[float]]) -> tuple[Place, ...]:
    """Places to a tenth of a millimetre, of the first two numbers of each point; one that is where
    the one before it was is left out."""
    found: list[Place] = []
    for point in points:
        place = (round(float(point[0]), 4), round(float(point[1]), 4))
        if not found or found[-1] != place:
            found.append(place)
    return tuple(found)


def bits(blocked: NDArray[np.bool_]) -> tuple[str, ...]:
    """A floor [rows, columns], its first row below, as `Animation.floor`."""
    return tuple(row.tobytes().hex() for row in np.packbits(blocked, axis=1))


def save(animation: Animation, folder: Path, part: str, name: str, caption: str) -> Animated:
    """Write `part-name.json`."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{part}-{name}.json"
    write_atomically(file, msgspec.json.encode(animation))
    return Animated(part, file, caption)
