"""Rhythm: how a mission really goes, by the time that its frames give to sensing.

Single frames understate what sensing is worth (wrong doors, broken frames), so this is measured on
whole missions lived at constant decisions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Lived:
    """A mission lived at a constant sensing time.

    sensing: seconds of the first call in each frame. route: length of the route at the start.
    walked, planned: lengths. moving, standing: frames with and without a plan to execute.
    """

    sensing: float
    route: float
    walked: float
    planned: float
    moving: int
    standing: int
    estimate: float


@dataclass(frozen=True)
class Rhythm:
    """Frames and lengths to expect, by seconds of sensing a frame; [S] each, sensing increasing.

    frames: moving frames for each length of the route. length: walked in a moving frame.
    stretch: walked / planned length. stops: standing frames for each moving one.
    estimate: of a plan's quality, as seen at run time.
    """

    sensing: Floats
    frames: Floats
    length: Floats
    stretch: Floats
    stops: Floats
    estimate: Floats

    def at(self, sensing: Floats) -> tuple[Floats, Floats, Floats]:
        """(frames for each length of route, length of a frame, stops a frame) for sensing times."""
        return (
            np.interp(sensing, self.sensing, self.frames),
            np.interp(sensing, self.sensing, self.length),
            np.interp(sensing, self.sensing, self.stops),
        )

    def advertised(self, sensing: float) -> float:
        """The estimate to expect of a plan made on this much sensing."""
        return float(np.interp(sensing, self.sensing, self.estimate))

    def stretched(self, planned: float, sensing: float) -> float:
        """The length to expect of a plan of this planned length."""
        return planned * float(np.interp(sensing, self.sensing, self.stretch))


def rhythm_of(missions: Sequence[Lived]) -> Rhythm:
    """The rhythm of missions lived at several constant sensing times.

    More sensing never means more walking: what is walked for a length of route is projected to
    fall with sensing (pool adjacent violators).
    """
    if not missions:
        raise AnytimeError("no mission to take the rhythm from; live at least one")
    times = np.array(sorted({mission.sensing for mission in missions}))
    rows: list[tuple[float, float, float, float, float]] = []
    for time in times:
        group = [mission for mission in missions if mission.sensing == time]
        route = max(sum(mission.route for mission in group), 1e-9)
        moving = max(sum(mission.moving for mission in group), 1)
        walked = sum(mission.walked for mission in group)
        planned = max(sum(mission.planned for mission in group), 1e-9)
        standing = sum(mission.standing for mission in group)
        estimate = float(np.mean([mission.estimate for mission in group]))
        rows.append((walked / route, moving / route, walked / planned, standing / moving, estimate))
    table = np.array(rows)
    excess = _falling(table[:, 0])
    frames = _falling(table[:, 1])
    return Rhythm(
        times,
        frames,
        excess / frames,
        _falling(table[:, 2]),
        _falling(table[:, 3]),
        -_falling(-table[:, 4]),
    )


def _falling(values: Floats) -> Floats:
    """The nearest non-increasing sequence in least squares."""
    blocks: list[list[float]] = []
    for value in values:
        blocks.append([float(value), 1.0])
        while len(blocks) > 1 and blocks[-2][0] < blocks[-1][0]:
            mean, count = blocks.pop()
            before = blocks[-1]
            before[0] = (before[0] * before[1] + mean * count) / (before[1] + count)
            before[1] += count
    return np.concatenate([np.full(int(count), mean) for mean, count in blocks])
