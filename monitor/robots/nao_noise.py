"""What goes wrong when a NAO moves: its steps, its odometry, its rising, its falls.

The figures are of the size that the literature reports for NAO; that variance grows with the way,
not with the number of ticks, is the law.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class MotionNoise:
    """Random and systematic errors of motion on the floor.

    Variances a metre walked and a radian turned, of the heading (rad²) and of the place in either
    direction (m²); standard deviations of what is drawn once for a robot: the scale of lengths, and
    the turning to one side (rad a metre).
    """

    heading_by_way: float = 5e-3
    heading_by_turn: float = 2e-3
    place_by_way: float = 4e-4
    place_by_turn: float = 1e-5
    scale: float = 0.03
    turning: float = 0.05


SILENT = MotionNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""No error at all."""


@dataclass(frozen=True)
class Noise:
    """All that is random about a simulated NAO.

    execution: of what it does against what it was told. odometry: of what it reports against what
    it did. drift: mean and standard deviation (rad) of the turn of heading when it stands up, which
    odometry reports: +0.13 in both runs of [PRP16] §4. hidden_drift: standard deviation of what
    odometry does not report of it. sonar: whether the sonars are noisy. falls: of spontaneous falls
    a metre. get_up: probability that one try to get up succeeds.
    """

    execution: MotionNoise = field(default_factory=MotionNoise)
    odometry: MotionNoise = field(default_factory=MotionNoise)
    drift: tuple[float, float] = (0.13, 0.02)
    hidden_drift: float = 0.03
    sonar: bool = True
    falls: float = 1e-3
    get_up: float = 0.9


NOISELESS = Noise(SILENT, SILENT, (0.0, 0.0), 0.0, False, 0.0, 1.0)
"""A NAO that does exactly what it is told, and knows it; it still falls over what it walks into."""


class Disturbance:
    """The errors of one robot's motion, drawn from a stream of their own."""

    def __init__(self, noise: MotionNoise, rng: np.random.Generator) -> None:
        self._noise = noise
        self._rng = rng
        scale, turning = rng.standard_normal(2).tolist()
        self.scale = 1.0 + noise.scale * scale
        self.turning = noise.turning * turning

    def disturb(
        self, ahead: float, aside: float, turn: float, way: float, turned: float
    ) -> tuple[float, float, float]:
        """A small motion in the robot's frame, with errors.

        way, turned: how far and how much the robot was told to go and turn meanwhile. The variance
        goes by them and not by the motion itself, whose own noise has a length without limit.
        """
        if way == 0.0 and turned == 0.0:
            return ahead, aside, turn
        noise = self._noise
        place = (noise.place_by_way * way + noise.place_by_turn * turned) ** 0.5
        heading = (noise.heading_by_way * way + noise.heading_by_turn * turned) ** 0.5
        first, second, third = self._rng.standard_normal(3).tolist()
        return (
            ahead * self.scale + place * first,
            aside * self.scale + place * second,
            turn + self.turning * way + heading * third,
        )
