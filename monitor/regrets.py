"""Regret, measured: every decision of a mission lived again with others in its place."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from monitor.logs import plain
from monitor.missions import Mission
from monitor.reports import Report

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fork:
    """Another decision at the beginning of a frame, and what the mission was worth with it."""

    shares: Mapping[str, float]
    speed: float
    net: float


@dataclass(frozen=True)
class Regret:
    """A decision and its forks, each lived to the end on the same seed.

    net: what the mission was worth as it was lived.
    """

    frame: int
    net: float
    forks: tuple[Fork, ...]

    @property
    def best(self) -> Fork:
        """The fork that was worth most."""
        return max(self.forks, key=lambda fork: fork.net)

    @property
    def regret(self) -> float:
        """By how much the best fork was worth more than what was decided; 0 if none was.

        It profits from knowing the noise: no policy can have a regret of 0 in every frame.
        """
        return max(self.best.net - self.net, 0.0)


def regrets(
    report: Report,
    mission: Mission,
    divisions: Floats,
    *,
    count: int = 20,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Regret, ...]:
    """The measured regret of every decision of a mission.

    Half of the forks of a decision change its division to one of `divisions`, [C, n] seconds of
    each call, the others its speed; all of them the one where the other has no effect, because
    the robot stands or nothing is computed. count: forks of a decision, at least 2.
    Raises AnytimeError for fewer, and for a mission that cannot be lived again.
    """
    if count < 2:
        raise AnytimeError(f"{count} forks a decision; it takes 2 or more")
    found: list[Regret] = []
    for frame in report.frames:
        decided = frame.decision
        timed = 0 if not frame.calls else count if frame.standing else count // 2
        changed = _divisions(divisions, decided.shares, timed)
        speeds = _speeds(mission, decided.speed, count - timed)
        others = [(shares, decided.speed) for shares in changed]
        others += [(dict(decided.shares), speed) for speed in speeds]
        forks = tuple(
            Fork(shares, speed, report.fork(frame.index, speed=speed, **shares).net)
            for shares, speed in others
        )
        found.append(Regret(frame.index, report.net, forks))
        if progress is not None:
            progress(len(found), len(report.frames))
    return tuple(found)


def log_regrets(path: Path, found: tuple[Regret, ...]) -> None:
    """Add the regrets to the log of the mission, behind its end."""
    lines = [
        {
            "kind": "regret",
            "frame": regret.frame,
            "forks": [[dict(fork.shares), fork.speed, fork.net] for fork in regret.forks],
        }
        for regret in found
    ]
    with path.open("ab") as file:
        for line in lines:
            text = json.dumps(plain(line), separators=(",", ":"), allow_nan=False)
            file.write(text.encode() + b"\n")


def _divisions(
    divisions: Floats, decided: Mapping[str, float], count: int
) -> list[dict[str, float]]:
    """Divisions from the shortest to the longest that are not the decided one."""
    own = np.array(list(decided.values()))
    rows = np.unique(divisions[~np.isclose(divisions, own).all(axis=1)], axis=0)
    count = min(count, len(rows))
    kept = rows[np.unique(np.linspace(0, len(rows) - 1, count).round().astype(int))]
    return [dict(zip(decided, row, strict=True)) for row in kept.tolist()]


def _speeds(mission: Mission, decided: float, count: int) -> list[float]:
    """Speeds from the least to the greatest that are not the decided one."""
    if not count:
        return []
    every = np.geomspace(*mission.speeds, count + 1)
    return np.delete(every, int(np.argmin(np.abs(np.log(every / decided))))).tolist()
