"""Anytime vision: a description of the floor whose quality rises with the time given [ZR93] §2."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import anytime
from anytime.errors import AnytimeError
from sensing.maps import BoolGrid, Cell
from sensing.random_maps import uniform
from sensing.sensed_maps import Disc, SensedMap, disc

_CONCAVITY = 3.0


@dataclass(frozen=True)
class Vision:
    """The paper's sensor, by the four numbers of its performance profile [ZR93] Fig. 2.

    Before `t_a` units of work there is no description; then its quality rises from `q_a` to `q_b`
    at `t_b`, steeply at first if `concave`, else on a straight line. A unit is one exposure; a
    machine turns units into seconds. `falloff` is the share of its advantage over guessing that the
    sensor loses from the robot to the edge of the disc (0: the quality is the same everywhere).
    """

    t_a: float = 4.0
    t_b: float = 48.0
    q_a: float = 0.75
    q_b: float = 1.0
    concave: bool = True
    falloff: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.t_a <= self.t_b < math.inf:
            raise AnytimeError(f"t_a {self.t_a}, t_b {self.t_b}: it must be 0 < t_a <= t_b")
        if not 0.5 <= self.q_a <= self.q_b <= 1.0:
            raise AnytimeError(f"q_a {self.q_a}, q_b {self.q_b}: it must be 0.5 <= q_a <= q_b <= 1")
        if not 0.0 <= self.falloff <= 1.0:
            raise AnytimeError(f"falloff is {self.falloff}: it must be from 0 to 1")

    def quality(self, work: float) -> float | None:
        """The probability that a cell is called rightly after that work; None before `t_a`."""
        if work < self.t_a:
            return None
        if work >= self.t_b:
            return self.q_b
        share = (work - self.t_a) / (self.t_b - self.t_a)
        if self.concave:
            share = math.expm1(-_CONCAVITY * share) / math.expm1(-_CONCAVITY)
        return self.q_a + (self.q_b - self.q_a) * share

    def look(
        self, free: BoolGrid, center: Cell, radius: int, rng: np.random.Generator
    ) -> Iterator[SensedMap | None]:
        """Look at the floor, one unit of work after the other.

        A cell has one number u for the whole look and is called wrongly while u >= quality, so that
        no cell once right turns wrong, and what is sensed after t units does not depend on when one
        asked before.
        """
        glance = _Glance(free, center, radius, self.falloff, rng)
        for work in range(1, math.ceil(self.t_b) + 1):
            quality = self.quality(work)
            yield None if quality is None else glance.at(quality)


def sense(
    free: BoolGrid,
    center: Cell,
    radius: int,
    quality: float,
    rng: np.random.Generator,
    falloff: float = 0.0,
) -> SensedMap:
    """Sense the floor once at a given quality.

    Each cell within `radius` cells is called wrongly with probability 1 - quality, independently;
    it is what `Vision.look` yields at that quality from an equal generator.
    """
    if not 0.0 <= quality <= 1.0:
        raise AnytimeError(f"quality is {quality}: it must be a probability from 0 to 1")
    return _Glance(free, center, radius, falloff, rng).at(quality)


class Device(Protocol):
    """Anything that can look at the floor exposure by exposure; `Vision` and `Camera` do."""

    def look(
        self, free: BoolGrid, center: Cell, radius: int, rng: np.random.Generator
    ) -> Iterator[SensedMap | None]:
        """One item a unit of work: what is sensed by then, or None before the first."""
        ...


@dataclass(frozen=True, eq=False)
class Sensor:
    """A device at a place: what `see` looks with, and at. `free` is the true floor."""

    free: BoolGrid
    center: Cell
    radius: int = 32
    device: Device = field(default_factory=Vision)


class HasSensor(Protocol):
    """A problem that says with which sensor, and so on which floor, one looks."""

    @property
    def sensor(self) -> Sensor:
        """The sensor."""
        ...


@dataclass(frozen=True, eq=False)
class Look:
    """A problem for `see`: one look with that sensor; its true floor is the sensor's `free`."""

    sensor: Sensor


def looks(
    rng: np.random.Generator,
    count: int = 30,
    device: Device | None = None,
    radius: int = 32,
    density: float = 0.2,
) -> Iterator[Look]:
    """Problems to measure `see` on: random floors, each cell blocked independently."""
    side = 2 * radius + 1
    for _ in range(count):
        free = uniform(side, density, rng)
        yield Look(Sensor(free, (radius, radius), radius, device or Vision()))


def seen_quality(sensed: SensedMap, problem: HasSensor) -> float:
    """The true quality of a look: (right + half of the unknown) / cells within the radius."""
    return sensed.score(problem.sensor.free).quality


@anytime.module(
    quality=seen_quality, estimate=lambda sensed: sensed.quality, problems=looks, name="see"
)
def see(sensor: Sensor, *, rng: np.random.Generator) -> Iterator[SensedMap | None]:
    """Look at the floor: no description at first, then better and better ones.

    One exposure is one unit of work. The estimate is the sensor's own, calibrated quality.
    """
    for sensed in sensor.device.look(sensor.free, sensor.center, sensor.radius, rng):
        anytime.charge(1)
        yield sensed


class _Glance:
    """One look's luck: a uniform number for each cell of the disc."""

    def __init__(
        self,
        free: BoolGrid,
        center: Cell,
        radius: int,
        falloff: float,
        rng: np.random.Generator,
    ) -> None:
        self.disc = disc(center, radius, (free.shape[0], free.shape[1]))
        self.blocked = ~free[self.disc.window] & self.disc.inside
        self.luck = rng.random(self.disc.inside.shape, dtype=np.float32)
        self.keep = _keep(self.disc, center, radius, falloff) if falloff else None

    def at(self, quality: float) -> SensedMap:
        confidence = None
        if self.keep is not None:
            confidence = np.float32(0.5) + np.float32(quality - 0.5) * self.keep
        wrong = self.luck >= (np.float32(quality) if confidence is None else confidence)
        wrong &= self.disc.inside
        mean = quality
        if confidence is not None:
            mean = float(confidence[self.disc.inside].mean())
        window = (self.disc.row, self.disc.column)
        return SensedMap(window, self.blocked ^ wrong, self.disc.inside, mean, confidence)


def _keep(around: Disc, center: Cell, radius: int, falloff: float) -> NDArray[np.float32]:
    """The share of the advantage over guessing that is left at each cell of the window."""
    height, width = around.inside.shape
    down = np.arange(height)[:, None] + (around.row - center[0])
    right = np.arange(width)[None, :] + (around.column - center[1])
    distance = np.sqrt(down**2 + right**2) / max(radius, 1)
    return (1.0 - falloff * np.minimum(distance, 1.0)).astype(np.float32)
