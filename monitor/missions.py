"""A mission: what a task is worth by its completion time, and what energy costs. [ZR93] §5."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anytime.clocks import is_number
from anytime.errors import AnytimeError

Floats = NDArray[np.float64]
Kind = Literal["linear", "exponential", "soft", "hard"]


@dataclass(frozen=True)
class Value:
    """The value of a task as a function of its completion time.

    linear: falls from `worth` to 0 at `seconds`. exponential: halves every `seconds`.
    soft: stays until `seconds`, then falls to 0 at twice that. hard: stays until `seconds`, then 0.
    """

    kind: Kind
    worth: float
    seconds: float

    def __post_init__(self) -> None:
        if self.kind not in ("linear", "exponential", "soft", "hard"):
            raise AnytimeError(
                f"value.kind is {self.kind!r}; it must be linear, exponential, soft or hard"
            )
        for name, number in (("worth", self.worth), ("seconds", self.seconds)):
            if not is_number(number) or not 0 < number < math.inf:
                raise AnytimeError(f"value.{name} is {number!r}; it must be a finite number > 0")

    def __call__(self, time: ArrayLike) -> Floats:
        """The value of completing at each time, in seconds since the task was presented."""
        times = np.asarray(time, dtype=float)
        share = times / self.seconds
        if self.kind == "linear":
            left = 1.0 - share
        elif self.kind == "exponential":
            left = np.exp2(-share)
        elif self.kind == "soft":
            left = np.minimum(1.0, 2.0 - share)
        else:
            left = np.where(share <= 1.0, 1.0, 0.0)
        return self.worth * np.maximum(left, 0.0)

    @property
    def deadline(self) -> float:
        """The time from which on the task is worth nothing; inf if there is none."""
        factor = {"linear": 1.0, "exponential": math.inf, "soft": 2.0, "hard": 1.0}[self.kind]
        return factor * self.seconds


@dataclass(frozen=True)
class Energy:
    """What moving costs: power(v) = base + square v² while moving, `idle` while standing."""

    price: float
    base: float
    square: float
    idle: float = 0.0

    def __post_init__(self) -> None:
        for name in ("price", "base", "square", "idle"):
            number = getattr(self, name)
            if not is_number(number) or not 0 <= number < math.inf:
                raise AnytimeError(f"energy.{name} is {number!r}; it must be a finite number >= 0")

    def power(self, speed: ArrayLike) -> Floats:
        """Energy a second at each speed."""
        return self.base + self.square * np.square(np.asarray(speed, dtype=float))


@dataclass(frozen=True)
class News:
    """What becomes known on the way: from `at` seconds on, the task has another value.

    Times of that value are seconds since the task was presented, as before.
    """

    at: float
    value: Value

    def __post_init__(self) -> None:
        if not is_number(self.at) or not 0 < self.at < math.inf:
            raise AnytimeError(f"news.at is {self.at!r}; it must be a finite number > 0")


@dataclass(frozen=True)
class Mission:
    """A task for a robot.

    value, energy: what counts; net value = value(completion time) − price × energy, and the value
    counts only if the goal was reached. speeds: (least, greatest), lengths a second.
    job: seconds of work at the goal. gain: how strongly speed answers to a frame that is ahead or
    behind [ZR93 §5]. fixed: a tuned fixed division (seconds by call, and "speed") to compare with.
    news: what nobody knows before it comes; the deadline, for instance.
    """

    value: Value
    energy: Energy
    speeds: tuple[float, float] = (1.0, 10.0)
    job: float = 0.0
    gain: float = 1.0
    name: str = "mission"
    fixed: Mapping[str, float] = field(default_factory=dict[str, float])
    news: News | None = None

    def __post_init__(self) -> None:
        for name, kind in (("value", Value), ("energy", Energy)):
            if not isinstance(getattr(self, name), kind):
                raise AnytimeError(
                    f"{name} is {getattr(self, name)!r}; it must be a {kind.__name__}"
                )
        try:
            slow, fast = self.speeds
            sound = is_number(slow) and is_number(fast) and 0 < slow <= fast < math.inf
        except (TypeError, ValueError):  # not a pair
            sound = False
        if not sound:
            raise AnytimeError(f"speeds are {self.speeds!r}; they must be 0 < least <= greatest")
        for name in ("job", "gain"):
            number = getattr(self, name)
            if not is_number(number) or not 0 <= number < math.inf:
                raise AnytimeError(f"{name} is {number!r}; it must be a finite number >= 0")
        for name, number in self.fixed.items():
            if not is_number(number) or not 0 <= number < math.inf:
                raise AnytimeError(f"fixed.{name} is {number!r}; it must be a finite number >= 0")
        slow, fast = self.speeds
        if not slow <= self.fixed.get("speed", slow) <= fast:
            raise AnytimeError(
                f"fixed.speed is {self.fixed['speed']}; it must lie within speeds, {slow} to {fast}"
            )

    def known(self, time: float) -> Mission:
        """The mission as it is known at a time, without what comes later."""
        if self.news is None:
            return self
        value = self.news.value if time >= self.news.at else self.value
        return replace(self, value=value, news=None)

    def net(self, reached: bool, seconds: float, energy: float) -> float:
        """What a mission was worth that ended after `seconds`."""
        earned = float(self.known(seconds).value(seconds)) if reached else 0.0
        return earned - self.energy.price * energy
