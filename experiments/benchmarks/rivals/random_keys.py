"""A program of any length as a vector of fixed length: random keys. [Bean 1994]

Libraries that optimise vectors know neither sources nor programs that ask for more or fewer
choices. Here each source owns a stretch of the vector, of as many keys in [0, 1] as it may be
called; a call turns its key into a value by the inverse of the distribution's CDF, so a uniformly
random vector is a random run of the program.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from types import SimpleNamespace
from typing import Any

import numpy as np

from anytime.errors import AnytimeError

_quantile = NormalDist().inv_cdf
_LEAST = 1e-9
_MOST = 1.0 - _LEAST


class _Stretches(dict[str, Iterator[float]]):
    """The keys that each source has left; none for a source without a stretch."""

    def __missing__(self, source: str) -> Iterator[float]:
        return iter(())


class KeyRng:
    """Answers a program's calls from a vector of keys.

    layout: calls of each source at most. Calls beyond it get a neutral value: the median, and
    False of a flip, at which a program is expected to end.
    """

    def __init__(self, layout: Mapping[str, int]) -> None:
        if not layout or min(layout.values()) < 0:
            raise AnytimeError(f"layout={dict(layout)}: give each source its calls at most, >= 0")
        ends = np.cumsum(list(layout.values())).tolist()
        begins = [0, *ends[:-1]]
        self._slices = [
            (source, slice(begin, end))
            for source, begin, end in zip(layout, begins, ends, strict=True)
        ]
        self._left = _Stretches()
        self.size: int = ends[-1]

    def load(self, keys: list[float]) -> None:
        """Answer the next run from these `size` keys."""
        self._left = _Stretches([(source, iter(keys[part])) for source, part in self._slices])

    def flip(self, source: str, p: float = 0.5) -> bool:
        """True with probability p."""
        return next(self._left[source], 1.0) < p

    def randint(self, source: str, n: int) -> int:
        """An integer below n, each equally likely."""
        key = next(self._left[source], 0.5)
        return int(key * n) if key < 1.0 else n - 1

    def gaussian(self, source: str, mean: float, sigma: float) -> float:
        """A normal value; keys within 1e-9 of an end give the six-sigma value there."""
        key = next(self._left[source], 0.5)
        return mean + sigma * _quantile(
            key if _LEAST <= key <= _MOST else _LEAST if key < 0.5 else _MOST
        )

    def uniform(self, source: str, low: float, high: float) -> float:
        """A value between low and high."""
        return low + (high - low) * next(self._left[source], 0.5)

    def categorical(self, source: str, weights: Sequence[float]) -> int:
        """An index, as likely as its weight is large."""
        rest = next(self._left[source], 0.5) * sum(weights)
        last = 0
        for index, weight in enumerate(weights):
            if rest < weight:
                return index
            rest -= weight
            last = index if weight > 0.0 else last
        return last

    def exponential(self, source: str, scale: float) -> float:
        """An exponential value of mean scale."""
        return -scale * math.log1p(-min(next(self._left[source], 0.5), _MOST))

    def lognormal(self, source: str, mean: float, sigma: float) -> float:
        """The exponential of a normal value."""
        return math.exp(self.gaussian(source, mean, sigma))


class _Count(KeyRng):
    """A random run that counts the calls of each source."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__({"": 0})
        self.calls: dict[str, int] = {}
        count = self

        class Draws(_Stretches):
            def __missing__(self, source: str) -> Iterator[float]:
                count.calls[source] = count.calls.get(source, 0) + 1
                return iter((rng.random(),))

        self._left = Draws()


def measured_layout(
    model: Callable[[Any, Any], float],
    world: Any,
    rng: np.random.Generator,
    *,
    runs: int = 1000,
    share: float = 0.95,
) -> dict[str, int]:
    """Calls that suffice each source in this share of the program's random runs.

    A longer vector slows every library down, a shorter one shuts plans out.
    """
    counts = []
    for _ in range(runs):
        count = _Count(rng)
        model(count, world)
        counts.append(count.calls)
    sources = dict.fromkeys(source for calls in counts for source in calls)
    return {
        source: max(1, int(np.quantile([calls.get(source, 0) for calls in counts], share)))
        for source in sources
    }


def plain_world(world: Mapping[str, Any]) -> SimpleNamespace:
    """The world for plain Python: its fields as attributes, of Python's own numbers.

    An array of several dimensions becomes a dict by index, `w.obstacles[i, 0]`: numpy's scalars
    would make the rivals' evaluations twice as slow.
    """

    def plain(value: Any) -> Any:
        if not isinstance(value, np.ndarray):
            return value
        if value.ndim == 1:
            return value.tolist()
        return {index: number.item() for index, number in np.ndenumerate(value)}

    return SimpleNamespace(**{name: plain(value) for name, value in world.items()})


@dataclass(frozen=True)
class Problem:
    """A program to be optimised, lower is better, as every rival gets it.

    world: what the program reads, as attributes. layout: of its random keys.
    """

    model: Callable[[Any, Any], float]
    world: Any
    layout: Mapping[str, int]

    @property
    def size(self) -> int:
        """Keys of a vector."""
        return sum(self.layout.values())

    def objective(self) -> Callable[[Any], float]:
        """The value of a vector of keys, an array or a list."""
        rng, model, world = KeyRng(self.layout), self.model, self.world
        load = rng.load

        def value(keys: Any) -> float:
            load(keys if isinstance(keys, list) else keys.tolist())
            return model(rng, world)

        return value
