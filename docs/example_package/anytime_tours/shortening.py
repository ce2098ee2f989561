"""A tour through places, shortened by reversing parts of it (2-opt)."""

from dataclasses import dataclass

import anytime
import numpy as np


@dataclass(frozen=True)
class Places:
    """A problem: its attribute is the module's input. places: [n, 2] in metres."""

    places: np.ndarray


def some_places(rng, count=30):
    """Problems for `anytime profile shorten`, without end."""
    while True:
        yield Places(rng.random((count, 2)))


def length(tour, problem):
    """Metres of the closed tour."""
    way = problem.places[list(tour)]
    return float(np.hypot(*(way - np.roll(way, 1, axis=0)).T).sum())


@anytime.module(cost=length, problems=some_places)
def shorten(places):
    """Yield ever shorter tours, each a tuple of indices into places [n, 2]."""
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    tour = list(range(len(places)))
    anytime.charge(1)
    yield tuple(tour)
    better = True
    while better:
        better = False
        for i in range(1, len(tour) - 1):
            anytime.charge(1)
            for j in range(i + 1, len(tour)):
                a, b, c, d = tour[i - 1], tour[i], tour[j], tour[(j + 1) % len(tour)]
                if apart[a, c] + apart[b, d] < apart[a, b] + apart[c, d] - 1e-12:
                    tour[i : j + 1] = tour[i : j + 1][::-1]
                    better = True
            yield tuple(tour)
