"""A mission as a decision process: think and walk, tick by tick, frame by frame.

While the plan in hand is walked, the next one is thought out. In each tick one chooses the speed
and whether to go on thinking; at the end of the path, whether to start the next frame with the plan
that there is or to stand and think on. What was spent is subtracted from what completing is worth,
so energy needs no place in the state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anytime.errors import AnytimeError

Floats = NDArray[np.float64]


class Moment(NamedTuple):
    """Where a mission stands.

    frames: still to be planned, beyond the plan in hand. path: cells left of the plan in hand.
    level: of the next plan, 0 is none. tick: since the task was presented.
    """

    frames: int
    path: int
    level: int
    tick: int


class Move(NamedTuple):
    """What to do in a tick: walk (0 stands) and think, or not; or start the next frame."""

    speed: float
    think: bool
    start: bool


@dataclass(frozen=True)
class DecisionProcess:
    """A mission of so many frames, in ticks.

    frames: to be planned and walked. lengths: [Y] cells to walk of a plan of each level; level 0
    is "no plan yet" and has length 0. planning: [Y, Y] chance of each level after a tick of
    thinking. speeds: [V] names of the speeds, cells a tick if all goes well. progress: [V, S]
    chance to come so many cells further in a tick. energy: [V] what a tick of walking costs, in
    units of value. value: [T] of completing at each tick; later it is worth nothing.
    thinking: what a tick of thinking costs.

    Raises AnytimeError for shapes that do not fit and rows that are no distributions.
    """

    frames: int
    lengths: tuple[int, ...]
    planning: Floats
    speeds: tuple[float, ...]
    progress: Floats
    energy: Floats
    value: Floats
    thinking: float = 0.0

    def __post_init__(self) -> None:
        levels, speeds = len(self.lengths), len(self.speeds)
        for name, shape in (
            ("planning", (levels, levels)),
            ("progress", (speeds, self.progress.shape[-1])),
            ("energy", (speeds,)),
            ("value", self.value.shape[:1]),
        ):
            if getattr(self, name).shape != shape:
                found = getattr(self, name).shape
                raise AnytimeError(f"{name} has shape {found}; it must be {shape}")
        for name in ("planning", "progress"):
            rows = getattr(self, name)
            if (rows < 0).any() or not np.allclose(rows.sum(axis=1), 1.0):
                raise AnytimeError(f"each row of {name} must be >= 0 and sum to 1")
        if self.frames < 1 or levels < 2 or not 0 < speeds <= 60:
            raise AnytimeError("a process has at least 1 frame, 2 levels and 1 to 60 speeds")
        if self.lengths[0] != 0 or min(self.lengths[1:]) < 1:
            raise AnytimeError("lengths are 0 for level 0, which is no plan, and >= 1 for plans")
        if not self.value.size or not np.isfinite(self.value).all() or self.thinking < 0:
            raise AnytimeError("value must be finite for at least one tick, thinking >= 0")
        if (self.pace <= 0).any():
            raise AnytimeError("each speed must make some progress")

    @cached_property
    def pace(self) -> Floats:
        """Cells that a tick at each speed is expected to come further, [V]."""
        return self.progress @ np.arange(self.progress.shape[1])

    @cached_property
    def unevenness(self) -> float:
        """Standard deviation of a tick's progress over its mean, at the greatest speed."""
        cells = np.arange(self.progress.shape[1])
        return float(np.sqrt(self.progress[-1] @ cells**2 - self.pace[-1] ** 2) / self.pace[-1])

    @cached_property
    def thinking_times(self) -> Floats:
        """Ticks of thinking to expect from each level to each that is as good or better, [Y, Y]."""
        times = np.zeros((self.levels, self.levels))
        for target in range(1, self.levels):
            rows = np.eye(target) - self.planning[:target, :target]
            times[:target, target] = np.linalg.lstsq(rows, np.ones(target), rcond=None)[0]
        return times

    @cached_property
    def ticks(self) -> int:
        """Ticks after which nothing is worth anything: a mission ends there."""
        return int(np.flatnonzero(self.value)[-1]) + 1 if self.value.any() else 1

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Of a table over the states: [T, F + 1, X, Y]."""
        return self.ticks, self.frames + 1, max(self.lengths) + 1, len(self.lengths)

    @property
    def levels(self) -> int:
        return len(self.lengths)

    def slower(self, factor: float) -> DecisionProcess:
        """The same with a planner that needs `factor` times as many ticks."""
        if not 1 <= factor < math.inf:
            raise AnytimeError(f"factor is {factor}; it must be a finite number >= 1")
        idle = np.eye(self.levels)
        return replace(self, planning=idle + (self.planning - idle) / factor)

    def move(self, action: int) -> Move:
        """An action of the kernels in words."""
        speeds = len(self.speeds)
        if action == 2 * speeds + 2:
            return Move(0.0, False, True)
        index, think = divmod(action, 2)
        return Move(self.speeds[index] if index < speeds else 0.0, bool(think), False)

    def chances(self, ticks: int) -> Floats:
        """Chance of each level after 0 to `ticks` ticks of thinking from none, [ticks + 1, Y]."""
        rows = [np.eye(self.levels)[0]]
        for _ in range(ticks):
            rows.append(rows[-1] @ self.planning)
        return np.array(rows)


def steady_planning(levels: int, rate: float) -> Floats:
    """A planner that comes a level further in a tick with this chance, [levels + 1, levels + 1]."""
    if not 0 < rate <= 1:
        raise AnytimeError(f"rate is {rate}; it must be > 0 and <= 1")
    rows = np.diag(np.full(levels + 1, 1.0 - rate)) + np.diag(np.full(levels, rate), 1)
    rows[-1, -1] = 1.0
    return rows


def uneven_progress(speeds: ArrayLike, factors: Sequence[float], shares: Sequence[float]) -> Floats:
    """Progress of a tick that is `factors` of what each speed promises, with these chances, [V, S].

    What is no whole number of cells is the next lower or the next higher by chance, so that the
    mean is right.
    """
    wanted = np.asarray(speeds, dtype=float)
    if math.fabs(sum(shares) - 1.0) > 1e-9 or min(shares) < 0 or min(factors) < 0:
        raise AnytimeError("shares must sum to 1; factors and shares must be >= 0")
    rows = np.zeros((len(wanted), int(np.ceil(wanted.max() * max(factors))) + 2))
    for factor, share in zip(factors, shares, strict=True):
        cells = wanted * factor
        low = np.floor(cells + 1e-9).astype(int)
        part = np.clip(cells - low, 0.0, 1.0)
        np.add.at(rows, (np.arange(len(wanted)), low), share * (1 - part))
        np.add.at(rows, (np.arange(len(wanted)), low + 1), share * part)
    return rows[:, : int(np.flatnonzero(rows.sum(axis=0))[-1]) + 1]
