"""Profiles as tables over levels of quality: what compilation computes with."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.profiles import Profile
from anytime.programs import Call, Program, upstream

Floats = NDArray[np.float64]
LEVELS = 16  # of an intermediate result, besides "no result"
TIMES = 96  # moments of a module at which its time may end
JOINT = 4096  # combinations of input levels of one module, at most


@dataclass(frozen=True)
class Table:
    """One call: its distribution over output levels for input levels and times.

    label, module: of the call. feeds: labels of the calls that feed it, in the order of the axes.
    levels: [L] representative quality of each output level; levels[0] = 0 is "no result".
    times: [M] seconds, increasing, times[0] = 0.
    chances: [L_1, …, L_k, M, L] probability of each output level.
    first: seconds by which half of the runs have a first result.
    """

    label: str
    module: str
    feeds: tuple[str, ...]
    levels: Floats
    times: Floats
    chances: Floats
    first: float

    @property
    def expected(self) -> Floats:
        """Expected quality, [L_1, …, L_k, M]."""
        return self.chances @ self.levels

    @property
    def saturation(self) -> float:
        """Seconds after which the expected quality, on average over inputs, is at its greatest."""
        expected = self.expected[(slice(1, None),) * len(self.feeds)]
        inputs = max(expected.size // len(self.times), 1)
        mean = expected.reshape(-1, len(self.times)).sum(axis=0) / inputs
        return float(self.times[int(np.flatnonzero(mean >= mean.max() - 1e-9)[0])])

    def faster(self, factor: float) -> Table:
        """This call with its module `factor` times as fast."""
        return replace(self, times=self.times / factor, first=self.first / factor)

    def ahead(self, seconds: float) -> Table:
        """This call with `seconds` of its time given to it for nothing."""
        return replace(self, times=np.maximum(self.times - seconds, 0.0))


def tables(
    program: Program, profiles: Mapping[str, Profile], counts: Mapping[str, float] | None = None
) -> tuple[Table, ...]:
    """A table for each call of the program, in order.

    counts: how often each problem counts, for the bootstrap; once each otherwise.
    Raises AnytimeError for a module without a profile or with one conditioned on other inputs.
    """
    made: dict[str, Table] = {}
    for call in program.calls:
        made[call.label] = _table(call, profiles, made, counts, output=call is program.output)
    return tuple(made.values())


def _table(
    call: Call,
    profiles: Mapping[str, Profile],
    made: Mapping[str, Table],
    counts: Mapping[str, float] | None,
    output: bool,
) -> Table:
    name = call.module.name
    if name not in profiles:
        raise AnytimeError(
            f"no profile for module {name!r}; measured: {', '.join(profiles) or 'none'}. "
            f"Measure the program, or anytime profile {name}"
        )
    profile = profiles[name]
    feeding = upstream(call)
    if set(feeding) - set(profile.inputs):
        missing = sorted(set(feeding) - set(profile.inputs))
        raise AnytimeError(
            f"the profile of {name!r} is not conditioned on {', '.join(missing)}, which another "
            "module feeds here; measure the program instead of the module alone"
        )
    times = _moments(profile)
    qualities = profile.quality_at(times)
    levels = _levels(qualities, 2 * LEVELS if output else LEVELS)
    bins = _binned(qualities, levels)
    sources = [made[source.label] for source in feeding.values()]
    shape = tuple(len(source.levels) for source in sources)
    if np.prod(shape, dtype=float) > JOINT:
        raise AnytimeError(
            f"{name!r} has {len(shape)} inputs from other modules, {int(np.prod(shape))} "
            f"combinations of levels; at most {JOINT} are compiled, join some in a module"
        )
    scale = _scale(profile, counts)
    chances = np.zeros((*shape, len(times), len(levels)))
    for cell in itertools.product(*(range(size) for size in shape)):
        if any(level == 0 for level in cell):
            chances[(*cell, slice(None), 0)] = 1.0  # no input, no result
            continue
        values = {
            parameter: float(source.levels[level])
            for parameter, source, level in zip(feeding, sources, cell, strict=True)
        }
        weights = (profile.given(**values) if values else profile).weights * scale
        weights = weights / max(float(weights.sum()), 1e-300)
        for level in range(len(levels)):
            chances[(*cell, slice(None), level)] = weights @ (bins == level)
    # Ta of [ZR93] §2, moved up to one of the moments.
    first = float(times[min(int(np.searchsorted(times, profile.time_to(0.0))), len(times) - 1)])
    return Table(
        call.label, name, tuple(s.label for s in feeding.values()), levels, times, chances, first
    )


def _scale(profile: Profile, counts: Mapping[str, float] | None) -> Floats:
    if counts is None:
        return np.ones(len(profile.recordings))
    return np.array([counts.get(run.problem, 0.0) for run in profile.recordings])


def _moments(profile: Profile) -> Floats:
    """At most `TIMES` moments: where runs change, spread over time and over quality gained."""
    every = profile.times
    if len(every) <= TIMES:
        return every
    gained = profile.mean(every)
    levels = np.linspace(float(gained[0]), float(gained[-1]), TIMES // 2)
    spaced: Floats = np.interp(levels, gained, np.arange(len(every)))
    evenly = np.linspace(0, len(every) - 1, TIMES - TIMES // 2)
    return every[np.unique(np.concatenate([spaced, evenly]).round().astype(int))]


def _levels(qualities: Floats, count: int) -> Floats:
    """Distinct qualities if there are few, else quantiles; before them 0 for "no result"."""
    values = qualities[~np.isnan(qualities)]
    if not len(values):
        return np.array([0.0])
    distinct = np.unique(values.round(9))
    if len(distinct) > count:
        edges = np.quantile(values, np.linspace(0, 1, count + 1))
        bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, count - 1)
        distinct = np.unique([values[bins == b].mean() for b in range(count) if (bins == b).any()])
    return np.concatenate([[0.0], distinct])


def _binned(qualities: Floats, levels: Floats) -> NDArray[np.intp]:
    """The level nearest to each quality; 0 where there is no result."""
    if len(levels) == 1:
        return np.zeros(qualities.shape, dtype=np.intp)
    middles = (levels[1:-1] + levels[2:]) / 2
    nearest = 1 + np.searchsorted(middles, np.nan_to_num(qualities), side="right")
    return np.where(np.isnan(qualities), 0, nearest)
