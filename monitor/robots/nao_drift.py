"""What a NAO learns of itself: how far standing up turns it. [PRP16] §4."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Drift:
    """What is believed of how far standing up turns the robot: a normal posterior, in radians.

    Each stand-up reports its own turn up to `noise`. [PRP16] §4: +0.13 rad, both times.
    """

    mean: float = 0.0
    variance: float = 0.05**2
    noise: float = 0.02

    def learn(self, turned: float) -> Drift:
        """The posterior after one more stand-up."""
        gain = self.variance / (self.variance + self.noise**2)
        return replace(
            self,
            mean=self.mean + gain * (turned - self.mean),
            variance=(1.0 - gain) * self.variance,
        )
