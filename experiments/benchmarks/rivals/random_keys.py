"""A program of any length as a vector of fixed length: random keys. [Bean 1994]

Libraries that optimise vectors know neither sources nor programs that ask for more or fewer
choices. Here each source owns a stretch of the vector, of as many keys in [0, 1] as it may be
called; a call turns its key into a value by the inverse of the distribution's CDF, so a uniformly
random vector is a random run of the program.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from statistics import NormalDist
from types import SimpleNamespace
from typing import Any

import numpy as np

from anytime.errors import AnytimeError

_quantile = NormalDist().inv_cdf
_LEAST = 1e-9
_MOST = 1.0 - _LEAST


def normal_quantile(key: float) -> float:
    """The standard normal value below which this share lies; six sigmas at the ends."""
    return _quantile(min(max(key, _LEAST), _MOST))


def exponential_quantile(key: float) -> float:
    """The exponential value of mean 1 below which this share lies; 20.7 at the end."""
    return -math.log1p(-min(key, _MOST))


class KeyRng:
    """Answers a program's calls from a vector of keys.

    layout: calls of each source at most. Calls beyond it get a neutral value: the middle of the
    distribution, and False of a flip, at which a program is expected to end.
    """

    # Each draw repeats the look-up of its key: a call of a method more would be a tenth of all.

    def __init__(self, layout: Mapping[str, int]) -> None:
        if not layout or min(layout.values()) < 0:
            raise AnytimeError(f"layout={dict(layout)}: give each source its calls at most, >= 0")
        ends = list(accumulate(layout.values()))
        self._begins = defaultdict(int, zip(layout, (0, *ends), strict=False))
        self._ends = defaultdict(int, zip(layout, ends, strict=True))
        self._next = self._begins.copy()
        self._keys: Any = [0.5] * ends[-1]
        self.size: int = ends[-1]

    def load(self, keys: list[float]) -> None:
        """Answer the next run from these `size` keys."""
        self._keys = keys
        self._next = self._begins.copy()

    def flip(self, source: str, p: float = 0.5) -> bool:
        """True with probability p."""
        at = self._next[source]
        if at >= self._ends[source]:
            return False
        self._next[source] = at + 1
        return self._keys[at] < p

    def randint(self, source: str, n: int) -> int:
        """An integer below n, each equally likely."""
        at = self._next[source]
        if at >= self._ends[source]:
            return n // 2
        self._next[source] = at + 1
        key = self._keys[at]
        return int(key * n) if key < 1.0 else n - 1

    def gaussian(self, source: str, mean: float, sigma: float) -> float:
        """A normal value; keys within 1e-9 of an end give the six-sigma value there."""
        at = self._next[source]
        if at >= self._ends[source]:
            return mean
        self._next[source] = at + 1
        key = self._keys[at]
        return mean + sigma * (_quantile(key) if _LEAST < key < _MOST else normal_quantile(key))

    def uniform(self, source: str, low: float, high: float) -> float:
        """A value between low and high."""
        at = self._next[source]
        if at >= self._ends[source]:
            return 0.5 * (low + high)
        self._next[source] = at + 1
        return low + (high - low) * self._keys[at]

    def categorical(self, source: str, weights: Sequence[float]) -> int:
        """An index, as likely as its weight is large."""
        rest = self.uniform(source, 0.0, sum(weights))
        last = 0
        for index, weight in enumerate(weights):
            if rest < weight:
                return index
            rest -= weight
            last = index if weight > 0.0 else last
        return last

    def exponential(self, source: str, scale: float) -> float:
        """An exponential value of mean scale."""
        return scale * exponential_quantile(self.uniform(source, 0.0, 1.0))

    def lognormal(self, source: str, mean: float, sigma: float) -> float:
        """The exponential of a normal value."""
        return math.exp(self.gaussian(source, mean, sigma))


class _Draws:
    """Endless keys, each drawn when it is looked at."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def __getitem__(self, at: int) -> float:
        return self._rng.random()


class _Random(KeyRng):
    """Answers from a generator, and counts the calls of each source."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__({"": 0})
        self._begins = self._next = defaultdict(int)
        self._ends = defaultdict(lambda: sys.maxsize)
        self._keys = _Draws(rng)

    @property
    def calls(self) -> dict[str, int]:
        """Of each source that was called."""
        return dict(self._next)


def _function(model: Callable[..., float]) -> Callable[[Any, Any], float]:
    """The bare function of (rng, world) in a model: a wrapper's work is no rival's."""
    function = inspect.unwrap(model)
    if len(inspect.signature(function).parameters) == 1:
        return lambda rng, world: function(rng)
    return function


def measured_layout(
    model: Callable[..., float],
    world: Any,
    rng: np.random.Generator,
    *,
    runs: int = 1000,
    share: float = 0.95,
) -> dict[str, int]:
    """Calls that suffice each source in this share of the program's random runs.

    A longer vector slows every library down, a shorter one shuts plans out.
    """
    counts, function = [], _function(model)
    for _ in range(runs):
        run = _Random(rng)
        function(run, world)
        counts.append(run.calls)
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

    model: a function of rng, or of rng and the world, or a `query.model` of one. world: what it
    reads, as attributes. layout: of its random keys.
    """

    model: Callable[..., float]
    world: Any
    layout: Mapping[str, int]

    @property
    def size(self) -> int:
        """Keys of a vector."""
        return sum(self.layout.values())

    @property
    def function(self) -> Callable[[Any, Any], float]:
        """The program as a bare function of rng and the world."""
        return _function(self.model)

    def objective(self) -> Callable[[Any], float]:
        """The value of a vector of keys, an array or a list."""
        rng, function, world = KeyRng(self.layout), self.function, self.world
        load = rng.load

        def value(keys: Any) -> float:
            load(keys if isinstance(keys, list) else keys.tolist())
            return function(rng, world)

        return value
