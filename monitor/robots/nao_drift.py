"""What a NAO learns of itself: how far standing up turns it. [PRP16] §4."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from anytime.errors import AnytimeError
from anytime.files import Stored, read_record, write_record

SCHEMA = "anytime.drift/1"


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
        total = self.variance + self.noise**2
        # 1 - gain would be 0 for a variance of which nothing is known.
        return replace(
            self,
            mean=self.mean + self.variance / total * (turned - self.mean),
            variance=self.noise**2 / total * self.variance,
        )


class _Record(Stored):
    """A `Drift` in a file."""

    mean: float
    variance: float
    noise: float


def read_drift(path: Path) -> Drift:
    """What earlier runs taught, or what is believed before any run if there is no such file.

    Raises AnytimeError, in one line with the path, for a file that is none of ours.
    """
    if not path.exists():
        return Drift()
    told = read_record(path, SCHEMA, _Record)
    if not (told.variance > 0.0 and told.noise > 0.0):
        raise AnytimeError(f"{path}: variance and noise must be > 0")
    return Drift(told.mean, told.variance, told.noise)


def write_drift(path: Path, drift: Drift) -> None:
    """Keep what was learnt for the next run; the file is whole or as it was."""
    write_record(path, SCHEMA, _Record(**asdict(drift)))
