"""Profiles as tables over levels of quality: what compilation computes with."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.joins import Rule, Several
from anytime.profiles import Profile
from anytime.programs import Call, Join, Program, upstream
from anytime.structure import Arm, answers, paths

Floats = NDArray[np.float64]
LEVELS = 16  # of an intermediate result, besides "no result"
TIMES = 96  # moments of a module at which its time may end
JOINT = 8192  # combinations of input levels of one node, at most
SHORTEST = 1e-9  # seconds: a call, or a contract, of no time at all is not run
KNOWN = np.array([0.0, 1.0])  # levels of an input that a test is: it is there and right


@dataclass(frozen=True)
class Courses:
    """The recorded runs that a table counts.

    levels: [R, M] output level of each run at each moment. weights: [L_1, …, L_k, R] how much each
    run counts for input levels, in sum 1, or 0 where an input is missing.
    """

    levels: NDArray[np.intp]
    weights: Floats


@dataclass(frozen=True)
class Table:
    """One node: its distribution over output levels for input levels and times.

    label: of the node. module: of the call; empty for a join. feeds: labels of the nodes that
    feed it, in the order of the axes, each once.
    levels: [L] representative quality of each output level; levels[0] = 0 is "no result".
    times: [M] seconds, increasing, times[0] = 0.
    chances: [L_1, …, L_k, M, L] probability of each output level.
    first: seconds by which half of the runs on the most suitable inputs have a first result.
    path: the arms of branches and parallels that the call stands in, from the outermost in.
    rule: of a join, which takes no time; None for a call.
    courses: of a call, the runs that `chances` counts, where they are known.
    """

    label: str
    module: str
    feeds: tuple[str, ...]
    levels: Floats
    times: Floats
    chances: Floats
    first: float
    path: tuple[Arm, ...] = ()
    rule: Rule | None = None
    courses: Courses | None = None

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
    """A table for each node of the program, in order.

    counts: how often each problem counts, for the bootstrap; once each otherwise.
    Raises AnytimeError for a module without a profile or with one conditioned on other inputs.
    """
    made: dict[str, Table] = {}
    path = paths(program)
    told: dict[str, dict[str, float]] = {call.label: {} for call in program.calls}
    for join, labels, answer in answers(program):
        for label in labels:
            told[label][join.label] = float(answer)
    for node in program.nodes:
        if isinstance(node, Join):
            made[node.label] = table_of(node, made, output=node is program.output)
            continue
        output = node is program.output
        table = _table(node, profiles, made, counts, told[node.label], output)
        made[node.label] = replace(table, path=path[node.label])
    return tuple(made.values())


def table_of(join: Join, made: Mapping[str, Table], output: bool) -> Table:
    """The table of a join: its rule, for every combination of its arguments' levels.

    made: the tables of its arguments by label. An input that is a test is always there and right.
    """
    sources = [
        made[argument.label] if isinstance(argument, Call | Join) else None
        for argument in join.arguments
    ]
    feeds = tuple(source.label for source in sources if source is not None)
    every = [KNOWN[1:] if source is None else source.levels for source in sources]
    shape = tuple(len(levels) for levels in every)
    _joint(join.label, shape)
    cells: list[tuple[tuple[int, ...], float, float | None]] = []
    for cell in itertools.product(*(range(size) for size in shape)):
        known = [
            None if source is not None and level == 0 else float(levels[level])
            for source, levels, level in zip(sources, every, cell, strict=True)
        ]
        cells += [(cell, chance, quality) for chance, quality in join.rule.outcome(known)]
    there = np.array([[np.nan if quality is None else quality for *_, quality in cells]])
    # What a join passes on keeps its levels: combinations are not as likely as each other, so that
    # quantiles of them would make one level of all that comes of an alternative seldom needed. The
    # value of several results is their sum: coarse levels would spoil it.
    most = (64 if output and isinstance(join.rule, Several) else 2) * LEVELS
    most = max(most, sum(shape))
    levels, bins = levels_of(there, most)
    chances = np.zeros((*shape, 1, len(levels)))
    for (cell, chance, _), level in zip(cells, bins[0], strict=True):
        chances[(*cell, 0, level)] += chance
    kept = tuple(0 if source is None else slice(None) for source in sources)
    feeds, chances = _once_each(feeds, chances[kept])
    return Table(join.label, "", feeds, levels, np.zeros(1), chances, 0.0, rule=join.rule)


def _once_each(feeds: tuple[str, ...], chances: Floats) -> tuple[tuple[str, ...], Floats]:
    """Where one node feeds several inputs, they have its level together: the diagonal."""
    for place, label in enumerate(feeds):
        if label in feeds[:place]:
            first = feeds.index(label)
            diagonal = np.moveaxis(np.diagonal(chances, axis1=first, axis2=place), -1, first)
            return _once_each(feeds[:place] + feeds[place + 1 :], diagonal)
    return feeds, chances


def _joint(name: str, shape: tuple[int, ...]) -> None:
    if np.prod(shape, dtype=float) > JOINT:
        raise AnytimeError(
            f"{name!r} has {len(shape)} inputs from other modules, {int(np.prod(shape))} "
            f"combinations of levels; at most {JOINT} are compiled, join some in a module"
        )


def _table(
    call: Call,
    profiles: Mapping[str, Profile],
    made: Mapping[str, Table],
    counts: Mapping[str, float] | None,
    told: Mapping[str, float],
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
    times, qualities = _given_time(times, qualities)
    levels, bins = levels_of(qualities, 2 * LEVELS if output else LEVELS)
    sources = [made[source.label] for source in feeding.values()]
    shape = tuple(len(source.levels) for source in sources)
    _joint(name, shape)
    # Of an arm, the problems on which it is run; where no test was measured, all of them.
    same = {name: answer for name, answer in told.items() if name in profile.features}
    arrived = [*itertools.product(*(source.levels[1:] for source in sources))]
    given = np.array(arrived).reshape(len(arrived), len(sources))
    weights = (profile.given(**same) if same else profile).weights_given([*feeding], given)
    weights = weights * _scale(profile, counts)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    known = np.stack([weights @ (bins == level) for level in range(len(levels))], axis=-1)
    chances = np.zeros((*shape, len(times), len(levels)))
    chances[..., 0] = 1.0  # no input, no result
    filled = (slice(1, None),) * len(sources)
    chances[filled] = known.reshape(*(size - 1 for size in shape), len(times), len(levels))
    first = _first(times, 1.0 - known[..., 0])
    counted = np.zeros((*shape, len(profile.recordings)))
    counted[filled] = weights.reshape(*(size - 1 for size in shape), -1)
    labels = tuple(s.label for s in feeding.values())
    feeds, chances = _once_each(labels, chances)
    courses = Courses(bins, _once_each(labels, counted)[1])
    return Table(call.label, name, feeds, levels, times, chances, first, courses=courses)


def _first(times: Floats, there: Floats) -> float:
    """Ta of [ZR93] §2 on the inputs that suit the module best: others may never give it a result,
    and whoever waits for that gives the modules before it no time.

    there: chances of a result by inputs and time, [n, times].
    """
    best = there.max(axis=0)
    return float(times[int(np.argmax(best >= min(0.5, best[-1]) - 1e-12))])


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


def _given_time(times: Floats, qualities: Floats) -> tuple[Floats, Floats]:
    """Moments and qualities [runs, moments] with nothing at 0: a call without time is not run.

    What is there at once, as of a module that costs nothing on a work clock, needs `SHORTEST`.
    """
    soon = int(np.searchsorted(times, SHORTEST, side="right")) - 1  # the last of those moments
    if np.isnan(qualities[:, soon]).all():
        return times, qualities
    nothing = np.full((len(qualities), 1), np.nan)
    return (
        np.concatenate([[0.0, SHORTEST], times[soon + 1 :]]),
        np.concatenate([nothing, qualities[:, soon:]], axis=1),
    )


def levels_of(qualities: Floats, count: int) -> tuple[Floats, NDArray[np.intp]]:
    """Levels that stand for qualities, and the level of each; NaN = no result, which is level 0.

    Distinct qualities if there are at most `count`, else the means of quantiles.
    """
    values = qualities[~np.isnan(qualities)]
    if not len(values):
        return np.array([0.0]), np.zeros(qualities.shape, dtype=np.intp)
    distinct = np.unique(values.round(9))
    if len(distinct) > count:
        edges = np.quantile(values, np.linspace(0, 1, count + 1))
        bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, count - 1)
        distinct = np.unique([values[bins == b].mean() for b in range(count) if (bins == b).any()])
    middles = (distinct[:-1] + distinct[1:]) / 2
    nearest = 1 + np.searchsorted(middles, np.nan_to_num(qualities), side="right")
    return np.concatenate([[0.0], distinct]), np.where(np.isnan(qualities), 0, nearest)
