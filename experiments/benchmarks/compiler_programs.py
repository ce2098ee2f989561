"""Random programs for the compiler's engine: chains, trees, and shared results of a given width."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from compiler.elimination import Factor, Floats, Levels, order_of, times_to_levels

Feeds = list[list[int]]  # for each call, the calls before it that feed it


def chain(count: int) -> Feeds:
    """Each call feeds the next."""
    return [[place - 1] if place else [] for place in range(count)]


def binary(depth: int) -> Feeds:
    """A complete binary tree: 2^depth − 1 calls, the leaves first."""
    leaves = 2 ** (depth - 1)
    inner = [[2 * place, 2 * place + 1] for place in range(leaves - 1)]
    return [[] for _ in range(leaves)] + inner


def shared(rng: np.random.Generator, count: int, levels: int, width: int) -> Feeds:
    """Calls with one or two inputs among the calls before them, results shared at random, such
    that elimination joins tables of `width` variables."""
    while True:
        feeds = _drawn(rng, count, window=int(rng.integers(2, count)))
        if feeds is None:
            continue
        empty = [np.zeros((levels,) * (len(fed) + 1)) for fed in feeds]
        cells = order_of(factors_of(feeds, empty), (f"call {count - 1}",)).cells
        if round(math.log(cells, levels)) == width:
            return feeds


def _drawn(rng: np.random.Generator, count: int, window: int) -> Feeds | None:
    feeds: Feeds = [[]]
    for place in range(1, count):
        before = np.arange(max(0, place - window), place)
        inputs = min(int(rng.integers(1, 3)), len(before))
        feeds.append(sorted(map(int, rng.choice(before, size=inputs, replace=False))))
    unused = set(range(count - 1)) - {fed for each in feeds for fed in each}
    for place in sorted(unused):
        free = [user for user in range(place + 1, count) if len(feeds[user]) < 2]
        if not free:
            return None
        feeds[int(rng.choice(free[:window]))].append(place)
    return feeds


def smooth(rng: np.random.Generator, feeds: Feeds, levels: int, horizon: float) -> list[Floats]:
    """Seconds to each level, for exponential profiles that a better input makes better."""
    grid = np.linspace(0, 1, levels)
    tables: list[Floats] = []
    for fed in feeds:
        weights = rng.uniform(0.1, 0.6, size=len(fed))
        base = max(1 - weights.sum(), 0.1)
        top = np.full((levels,) * len(fed), base)
        for axis, weight in enumerate(weights):
            top = top + weight * grid.reshape([-1 if a == axis else 1 for a in range(len(fed))])
        top = np.maximum(top / (base + weights.sum()), 1e-9)
        share = np.minimum(grid / top[..., None], 1.0)
        pace = horizon / len(feeds) * rng.uniform(0.05, 0.5)
        with np.errstate(divide="ignore"):
            seconds = -pace * np.log1p(-share)
        tables.append(_without_input(seconds, len(fed)))
    return tables


def rough(rng: np.random.Generator, feeds: Feeds, levels: int) -> list[Floats]:
    """Seconds to each level, drawn at random; no call is slower on better input."""
    tables: list[Floats] = []
    for fed in feeds:
        seconds = rng.integers(1, 10, size=(levels,) * (len(fed) + 1)).cumsum(axis=-1).astype(float)
        for axis in range(len(fed)):
            seconds = np.flip(np.maximum.accumulate(np.flip(seconds, axis), axis=axis), axis)
        tables.append(_without_input(seconds, len(fed)))
    return tables


def _without_input(seconds: Floats, inputs: int) -> Floats:
    """No result of a call that feeds leaves none, in no time."""
    for axis in range(inputs):
        seconds[(slice(None),) * axis + (0,)] = np.inf
        seconds[(slice(None),) * axis + (0, ..., 0)] = 0.0
    return seconds


def factors_of(feeds: Feeds, tables: Sequence[Floats], name: str = "call") -> list[Factor]:
    """The tables with the names of their calls."""
    return [
        Factor((*[f"{name} {each}" for each in fed], f"{name} {place}"), table)
        for place, (fed, table) in enumerate(zip(feeds, tables, strict=True))
    ]


def stepped(rng: np.random.Generator, count: int, levels: int, steps: int) -> list[Levels]:
    """A chain in the time domain: the level that each call reaches from each level of its input at
    each of `steps` moments, [levels, steps]; [steps] for the first."""
    grid, moments = np.linspace(0, 1, levels), np.arange(steps)
    profiles: list[Levels] = []
    for place in range(count):
        rise = 1 - np.exp(-moments / rng.uniform(0.02, 0.2) / steps)
        weight = rng.uniform(0.5, 0.9)
        quality = ((1 - weight) + weight * grid)[:, None] * rise if place else rise
        profiles.append(np.floor(quality * (levels - 1) + 1e-9).astype(np.intp))
    return profiles


def chain_tables(profiles: Sequence[Levels], levels: int) -> list[Floats]:
    """The chain in the inverse domain: steps until exactly each level."""
    moments = np.arange(profiles[0].shape[-1], dtype=float)
    return [times_to_levels(profile, moments, levels) for profile in profiles]
