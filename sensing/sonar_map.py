"""Sonar sensing as an anytime module: every reading makes the map of what is around better."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

import anytime
from sensing.sonar import PERIOD, Sonars, Surroundings
from sensing.sonar_discs import obstacles
from sensing.sonar_grid import Echoes, SonarMap, wrapped

__all__ = [
    "Echoes",
    "Listener",
    "Listening",
    "Recorded",
    "SonarMap",
    "listenings",
    "map_quality",
    "obstacles",
    "sonar_map",
]


class Listener(Protocol):
    """What `sonar_map` listens with: a robot's sonars, and what was heard with them before."""

    @property
    def known(self) -> SonarMap:
        """The map to go on with."""
        ...

    @property
    def sonars(self) -> Sonars:
        """Which sonars these are."""
        ...

    def listen(self) -> Iterator[Echoes]:
        """The next readings, one after the other as they come."""
        ...


@dataclass(frozen=True, eq=False)
class Recorded:
    """Readings that were taken before."""

    readings: tuple[Echoes, ...]
    sonars: Sonars = field(default_factory=Sonars)
    known: SonarMap = field(default_factory=lambda: SonarMap.around(0.0, 0.0))

    def listen(self) -> Iterator[Echoes]:
        return iter(self.readings)


@dataclass(frozen=True, eq=False)
class Listening:
    """A problem for `sonar_map`: readings, and what really stands around."""

    sonar: Recorded
    truth: Surroundings


class HasTruth(Protocol):
    """A problem that says what stands around and with what one listens."""

    @property
    def sonar(self) -> Recorded: ...

    @property
    def truth(self) -> Surroundings: ...


def listenings(
    rng: np.random.Generator, count: int = 30, sonars: Sonars | None = None
) -> Iterator[Listening]:
    """Problems to measure `sonar_map` on: one to three discs ahead of a robot that stands, turns on
    the spot or walks, for four seconds."""
    sonars = sonars or Sonars()
    for _ in range(count):
        circles = []
        for _ in range(rng.integers(1, 4)):
            bearing, far, radius = rng.uniform([-0.8, 0.5, 0.08], [0.8, 1.2, 0.2])
            circles.append((far * math.cos(bearing), far * math.sin(bearing), radius))
        truth = Surroundings(tuple(circles))
        speed, turn = ((0.0, 0.0), (0.0, 0.42), (0.0, -0.42), (0.06, 0.0))[rng.integers(4)]
        side = rng.uniform(-1, 1)
        readings = []
        for index in range(40):
            time = PERIOD * index
            pose = (speed * time * 0.3, speed * time * side, turn * min(time, 2.0))
            told = sonars.hear(sonars.distances(pose, truth), rng)
            readings.append(Echoes(time, pose, told))
        yield Listening(Recorded(tuple(readings), sonars), truth)


def map_quality(heard: SonarMap, problem: HasTruth) -> float:
    """How much of what is near is told rightly: the mean of the shares of blocked and of free cells
    that the discs of `obstacles` call so, within a metre ahead of where the listening began."""
    x, y, heading = problem.sonar.readings[0].pose_in_world
    xs, ys = heard.places()
    right, up = np.meshgrid(xs - x, ys - y)
    aside = np.abs(wrapped(np.arctan2(up, right) - heading))
    near = (np.hypot(right, up) <= 1.0) & (aside <= math.radians(55.0))
    px, py = right[near] + x, up[near] + y
    blocked = _covered(px, py, np.array(problem.truth.circles).reshape(-1, 3))
    told = _covered(px, py, obstacles(heard))
    shares = [told[blocked].mean()] if blocked.any() else []
    shares += [1.0 - told[~blocked].mean()] if not blocked.all() else []
    return float(np.mean(shares))


def _covered(
    x: NDArray[np.float64], y: NDArray[np.float64], discs: NDArray[np.float64]
) -> NDArray[np.bool_]:
    apart = np.hypot(x[:, None] - discs[None, :, 0], y[:, None] - discs[None, :, 1])
    return np.any(apart <= discs[None, :, 2], axis=1)


@anytime.module(quality=map_quality, problems=listenings, name="sonar_map")
def sonar_map(sonar: Listener) -> Iterator[SonarMap]:
    """Listen to the sonars: a map of what is around, better with every reading.

    One reading of both sonars is one unit of work.
    """
    known = sonar.known
    for echoes in sonar.listen():
        anytime.charge(1)
        x, y, _ = echoes.pose_in_world
        known = known.centred(x, y).hear(echoes, sonar.sonars)
        yield known
