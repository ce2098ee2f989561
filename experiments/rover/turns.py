"""Turns of a rover, drawn afresh: what is around it and what its sensors make of that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZE = 32  # cells, and pixels, along a side
NOISE = 0.6  # of one exposure; obstacles are 1, free ground 0
REACH = 4  # cells that the rover may be off where it believes to be
TOUCHED = 6.0  # cells of way that one blocked cell on it costs
POINTS = 48  # of a drive
GROUNDS = (0.3, 0.6, 1.2)  # wavelengths of the texture in radians a cell: sand, gravel, rock
GRIP = (0.3, 0.6, 1.0)  # greatest sideways acceleration there, cells / s²


@dataclass(frozen=True)
class Sensors:
    """What the rover can look at; only the modules that sense may. seed: of the noise."""

    light: Floats
    ranges: Floats
    seed: int


@dataclass(frozen=True)
class Turn:
    """A problem. blocked: [SIZE, SIZE]. start, goal: cells; offset: how far the rover is from
    where it believes to be. clutter: share of blocked cells. ground: index into `GROUNDS`."""

    name: str
    sensors: Sensors
    blocked: NDArray[np.bool_]
    start: tuple[int, int]
    goal: tuple[int, int]
    offset: tuple[int, int]
    clutter: float
    ground: int


def turns(count: int, seed: int = 0) -> list[Turn]:
    """Turns of the rover, drawn afresh; equal seeds give equal turns."""
    return [_turn(index, np.random.default_rng([seed, index]), seed) for index in range(count)]


def _turn(index: int, rng: np.random.Generator, seed: int) -> Turn:
    start, goal = (3, 3), (SIZE - 4, SIZE - 4)
    blocked = np.zeros((SIZE, SIZE), dtype=bool)
    for _ in range(int(rng.integers(4, 16))):
        row, column = rng.integers(0, SIZE - 4, size=2)
        height, width = rng.integers(2, 9, size=2)
        blocked[row : row + height, column : column + width] = True
    for cell in (start, goal):
        blocked[cell[0] - 3 : cell[0] + 4, cell[1] - 3 : cell[1] + 4] = False
    ground = int(rng.integers(3))
    row, column = rng.integers(-REACH, REACH + 1, size=2).tolist()
    offset = (row, column)
    wave = np.sin(GROUNDS[ground] * np.indices((SIZE, SIZE)).sum(axis=0) + rng.uniform(0, 6))
    light = blocked + np.where(blocked, 0.0, 0.25 * wave) + rng.uniform(-0.2, 0.2)
    # The range sensor turns with the rover, so that its picture is shifted by the offset.
    ranges = np.roll(blocked.astype(float), offset, axis=(0, 1))
    sensors = Sensors(light, ranges, int(rng.integers(2**31)))
    clutter = float(blocked.mean())
    return Turn(f"{seed}/{index}", sensors, blocked, start, goal, offset, clutter, ground)
