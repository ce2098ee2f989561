"""Conditional performance profiles: how good a result to expect, given time and inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anytime.distributions import Distribution
from anytime.errors import AnytimeError
from anytime.machines import Machine
from anytime.pictures import clipped, duration, figure, line_chart, number, sparkline
from anytime.recordings import Recording
from anytime.strata import stratum_weights

Floats = NDArray[np.float64]
FALLS = 0.05  # of expected quality from its best moment to the end of the runs, which is told


@dataclass(frozen=True)
class Profile:
    """How the quality of a module's results grows with time, given the quality of its inputs.

    A distribution over recorded runs, whose unit is the problem. `given(boxes=.8)` conditions it
    on the quality at the parameter `boxes`: each problem's runs are interpolated over the input
    quality and then problems are averaged, because good inputs and easy problems come together.
    *No result* is a level of its own and is never extrapolated to. [ZR93] §3.5.

    unsure: this machine may be so many times as fast or slow as where it was measured.
    """

    module: str
    inputs: tuple[str, ...]
    recordings: tuple[Recording, ...]
    references: Mapping[str, float] = field(default_factory=dict[str, float])
    machine: str = "this"
    condition: Mapping[str, float] = field(default_factory=dict[str, float])
    unsure: float = 1.0

    def __post_init__(self) -> None:
        if not self.recordings:
            raise AnytimeError(
                f"profile of {self.module!r} has no recorded run; measure at least one problem"
            )
        for name in self.condition:
            known = (*self.inputs, *self.features)
            if name not in known:
                raise AnytimeError(
                    f"profile of {self.module!r} is not conditioned on {name!r}; "
                    f"known: {', '.join(known) or 'nothing'}"
                )

    # What the runs achieved

    @property
    def features(self) -> tuple[str, ...]:
        return tuple(sorted({name for run in self.recordings for name in run.features}))

    @cached_property
    def problems(self) -> tuple[str, ...]:
        return tuple(sorted({run.problem for run in self.recordings}))

    @cached_property
    def qualities(self) -> tuple[Floats, ...]:
        """True quality at each registration of each run: raw, or cheapest known / raw cost."""
        if not self.references:
            return tuple(run.raw for run in self.recordings)
        result: list[Floats] = []
        for run in self.recordings:
            reference = self.references[run.problem]
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                quality = np.where(run.raw > 0, reference / run.raw, 1.0)
            result.append(np.clip(quality, 0.0, 1.0))
        return tuple(result)

    @cached_property
    def weights(self) -> Floats:
        """Weight of each run under the condition; every problem has the same weight. Sum 1."""
        return self.weights_given((), np.zeros((1, 0)))[0]

    def weights_given(self, asked: Sequence[str], qualities: Floats) -> Floats:
        """Weights of the runs, [n, runs], for n combinations of input qualities, [n, asked], on top
        of the condition; each row sums to 1."""
        key = (*asked, qualities.tobytes())
        if key not in self._weights_given:
            self._weights_given[key] = self._weights_of(asked, qualities)
        return self._weights_given[key]

    @cached_property
    def _weights_given(self) -> dict[tuple[str | bytes, ...], Floats]:
        return {}

    def _weights_of(self, asked: Sequence[str], qualities: Floats) -> Floats:
        known = {name: self.condition[name] for name in self.inputs if name in self.condition}
        fixed = {name: value for name, value in known.items() if name not in asked}
        names = [*asked, *fixed]
        targets = np.hstack([qualities, np.tile([*fixed.values()], (len(qualities), 1))])
        rows, there = self.by_problem
        points = np.array([[run.inputs[name] for name in names] for run in self.recordings])
        points = points.reshape(len(self.recordings), len(names))[rows]
        alike = self._alike(rows[:, 0])[:, None]
        weights = np.zeros((len(targets), len(self.recordings)))
        for first in range(0, len(targets), 64):  # some at a time, because all need much memory
            some = targets[first : first + 64]
            problems = np.tile(np.arange(len(rows)), len(some))
            target = np.repeat(some, len(rows), axis=0)
            each = stratum_weights(points[problems], target, there[problems])
            each = each.reshape(len(some), *there.shape) * alike
            weights[first : first + 64, rows[there]] = each[:, there]
        return weights / weights.sum(axis=1, keepdims=True)  # each problem has a run, so > 0

    @cached_property
    def by_problem(self) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Places of the runs of each problem, in the order of `problems`: [P, R] indices, padded
        with 0, and whether there is such a run."""
        members: dict[str, list[int]] = {problem: [] for problem in self.problems}
        for place, run in enumerate(self.recordings):
            members[run.problem].append(place)
        most = max(len(places) for places in members.values())
        padded = [[*places, *[-1] * (most - len(places))] for places in members.values()]
        rows = np.array(padded, dtype=np.intp)
        return np.maximum(rows, 0), rows >= 0

    def _alike(self, firsts: NDArray[np.intp]) -> Floats:
        """How much each problem, known by its first run, counts for the features asked for (a
        Gaussian kernel), [P]."""
        weights = np.ones(len(firsts))
        for name in self.condition:
            if name in self.inputs:
                continue
            values = np.array([run.features.get(name, np.nan) for run in self.recordings])
            width = max(float(np.nanstd(values)) * len(self.problems) ** -0.2, 1e-9)
            apart = np.nan_to_num(values[firsts], nan=np.inf) - self.condition[name]
            weights *= np.exp(-0.5 * (apart / width) ** 2) + 1e-9
        return weights

    def quality_at(self, seconds: ArrayLike) -> Floats:
        """Quality of each run at each time, [runs, times]; NaN before its first result."""
        times = np.atleast_1d(np.asarray(seconds, dtype=float))
        table = np.full((len(self.recordings), len(times)), np.nan)
        for row, (run, quality) in enumerate(zip(self.recordings, self.qualities, strict=True)):
            if not len(quality):
                continue
            last = np.searchsorted(run.seconds, times, side="right") - 1
            table[row] = np.where(last >= 0, quality[np.maximum(last, 0)], np.nan)
        return table

    @cached_property
    def times(self) -> Floats:
        """The moments at which something changes, [at most 512], increasing."""
        every = np.unique(np.concatenate([[0.0], *(run.seconds for run in self.recordings)]))
        if len(every) <= 512:
            return every
        return every[np.unique(np.linspace(0, len(every) - 1, 512).round().astype(int))]

    # Questions

    def given(self, **condition: float) -> Profile:
        """This profile under conditions: qualities of inputs by parameter, features by name.

        Raises AnytimeError for a name that it is not conditioned on or a quality outside [0, 1].
        """
        for name, value in condition.items():
            if name in self.inputs and not 0 <= value <= 1:
                raise AnytimeError(f"given({name}={value}): a quality lies in [0, 1]")
            if not np.isfinite(value):
                raise AnytimeError(f"given({name}={value}): give a finite number")
        return replace(self, condition={**self.condition, **condition})

    def at(self, seconds: float) -> Distribution:
        """The distribution of quality after `seconds`. Raises AnytimeError for NaN."""
        _no_nan(seconds)
        return Distribution(self.quality_at(seconds)[:, 0], self.weights)

    def mean(self, seconds: ArrayLike, *, as_measured: bool = False) -> Floats:
        """Expected quality after each time, [times]; no result counts 0.

        The monotone envelope (the best expectation with that time or less), or as measured.
        """
        times = np.atleast_1d(np.asarray(seconds, dtype=float))
        _no_nan(times)
        changes, measured = self._course
        known = measured if as_measured else np.maximum.accumulate(measured)
        return known[np.searchsorted(changes, times, side="right")]

    @cached_property
    def _course(self) -> tuple[Floats, Floats]:
        """The mean as measured, as a step function: every time at which it changes [n],
        increasing, and the mean before the first and from each of them on, [n + 1]."""
        steps = [np.diff(values, prepend=0.0) for values in self.qualities]
        moments = np.concatenate([run.seconds for run in self.recordings])
        gains = np.concatenate([w * step for w, step in zip(self.weights, steps, strict=True)])
        changes, place = np.unique(moments, return_inverse=True)
        gained = np.bincount(place, weights=gains, minlength=len(changes))
        return changes, np.clip(np.concatenate([[0.0], np.cumsum(gained)]), 0.0, 1.0)

    def quantile(self, share: float, seconds: float) -> float:
        """The quality that a share of the runs stays below; NaN where that is no result."""
        return self.at(seconds).quantile(share)

    def time_to(self, quality: float, share: float = 0.5) -> float:
        """Seconds until a share of the runs has reached this quality; inf if it never does.

        Raises AnytimeError for a share outside (0, 1].
        """
        if not 0 < share <= 1:
            raise AnytimeError(f"a share of {share} of the runs; give one in (0, 1]")
        arrived: list[float] = []
        for run, values in zip(self.recordings, self.qualities, strict=True):
            # Of results at one moment the last stands.
            stands = np.append(np.diff(run.seconds) > 0, True)[: len(values)]
            arrived.append(min(run.seconds[stands & (values >= quality)], default=np.inf))
        order = np.argsort(arrived, kind="stable")
        hits = np.flatnonzero(np.cumsum(self.weights[order]) >= share - 1e-12)
        return float(arrived[order[hits[0]]]) if len(hits) else float("inf")

    def progress(self, quality: float, seconds: float) -> Distribution:
        """Where a run that has this quality now will be in `seconds` [Hansen & Zilberstein 2001].

        Every moment at which a recorded run had about this quality (the nearest tenth of them)
        speaks once, weighted by its problem.
        """
        starts: list[tuple[float, float, float]] = []
        for weight, run, values in zip(self.weights, self.recordings, self.qualities, strict=True):
            if weight <= 0:
                continue
            for moment, value in zip(map(float, run.seconds), map(float, values), strict=True):
                index = int(np.searchsorted(run.seconds, moment + seconds, side="right")) - 1
                starts.append((abs(value - quality), weight / len(values), float(values[index])))
        if not starts:
            return Distribution(np.array([np.nan]), np.array([1.0]))
        starts.sort()
        nearest = starts[: max(8, len(starts) // 10)]
        weights = np.array([weight for _, weight, _ in nearest])
        return Distribution(np.array([value for *_, value in nearest]), weights / weights.sum())

    @property
    def effective_problems(self) -> float:
        """How many equally weighted problems the condition leaves (Kish)."""
        by_problem: dict[str, float] = {}
        for weight, run in zip(self.weights, self.recordings, strict=True):
            by_problem[run.problem] = by_problem.get(run.problem, 0.0) + weight
        return 1.0 / sum(weight**2 for weight in by_problem.values())

    def band(
        self, seconds: ArrayLike, confidence: float = 0.95, resamples: int = 400
    ) -> tuple[Floats, Floats]:
        """A band around the mean, simultaneous over the times: (low [times], high [times]).

        Cluster bootstrap over problems, studentised by the largest deviation (sup-t). Where it is
        unsure how fast this machine is, all that it is when slow, as fast and when fast.
        """
        times = np.atleast_1d(np.asarray(seconds, dtype=float))
        if self.unsure > 1.0:
            speeds = (1 / self.unsure, 1.0, self.unsure)
            here = replace(self, unsure=1.0)
            ends = np.array([here.band(times * each, confidence, resamples) for each in speeds])
            return ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
        table = self.weights[:, None] * np.nan_to_num(self.quality_at(times))
        index = {problem: row for row, problem in enumerate(self.problems)}
        rows = np.array([index[run.problem] for run in self.recordings])
        per_problem = np.zeros((len(index), len(times)))
        weight = np.zeros(len(index))
        np.add.at(per_problem, rows, table)
        np.add.at(weight, rows, self.weights)
        mean = per_problem.sum(axis=0)
        draws = np.random.default_rng(0).multinomial(
            len(index), np.full(len(index), 1 / len(index)), size=resamples
        )
        total = np.maximum(draws @ weight, 1e-12)
        sampled = (draws @ per_problem) / total[:, None]
        spread = sampled.std(axis=0) + 1e-9
        factor = float(np.quantile(np.max(np.abs(sampled - mean) / spread, axis=1), confidence))
        # The envelope that `mean` gives lies above the mean as measured where quality falls.
        envelope = np.maximum(self.mean(times), mean)
        low, high = mean - factor * spread, np.maximum(mean + factor * spread, envelope)
        return np.maximum(low, 0.0), np.minimum(high, 1.0)

    def on(self, machine: Machine) -> Profile:
        """This profile in the seconds of another machine: quality over work stays as it is."""
        moved = tuple(
            replace(
                run,
                seconds=machine.elapsed(self.module, run.work),
                end=(float(machine.elapsed(self.module, np.array([run.end[1]]))[0]), run.end[1]),
            )
            for run in self.recordings
        )
        return replace(self, recordings=moved, machine=machine.name, unsure=1.0)

    # Pictures

    def _horizon(self) -> float:
        return max(1e-9, *(run.end[0] for run in self.recordings))

    def __repr__(self) -> str:
        times = np.linspace(0, self._horizon(), 16)
        means = self.mean(times)
        first = self.time_to(1e-9)
        best, end = float(means[-1]), float(self.mean(times[-1], as_measured=True)[0])
        # Results that get worse are worth a look: often an unfinished one costs too little.
        falls = f" then {number(end)}" if best - end > FALLS else ""
        parts = [
            f"{self.module}  {sparkline(means.tolist())}  q {number(best)}{falls} "
            f"in {duration(self._horizon())}, first {duration(first)}"
        ]
        if self.condition:
            parts.append("given " + ", ".join(f"{k}={v:.2g}" for k, v in self.condition.items()))
        elif self.inputs:
            parts.append("given " + ", ".join(self.inputs))
        as_many = f" as {self.effective_problems:.0f}" if self.condition else ""
        parts.append(f"{len(self.problems)} problems{as_many}, {len(self.recordings)} runs")
        parts.append(self.machine)
        return clipped(" | ".join(parts))

    def _repr_html_(self) -> str:
        return self.picture()

    def picture(self) -> str:
        """The profile as inline SVG with its text, for a notebook."""
        times = np.linspace(0, self._horizon(), 80)
        levels: list[Profile] = [self]
        labels = ["mean"]
        if len(self.inputs) == 1 and not self.condition:
            name = self.inputs[0]
            seen = [run.inputs[name] for run in self.recordings if name in run.inputs]
            values = sorted({round(float(v), 2) for v in np.quantile(seen, [0.1, 0.5, 0.9])})
            levels = [self.given(**{name: value}) for value in values]
            labels = [f"{name} = {value:g}" for value in values]
        series = {
            label: (times.tolist(), profile.mean(times).tolist())
            for label, profile in zip(labels, levels, strict=True)
        }
        low, high = levels[-1].band(times)
        bands = {labels[-1]: (times.tolist(), low.tolist(), high.tolist())}
        svg = line_chart(
            series, bands=bands, x_label="time [s]", y_label="expected quality", title=self.module
        )
        return figure(svg, repr(self))


def _no_nan(seconds: ArrayLike) -> None:
    if np.isnan(np.asarray(seconds, dtype=float)).any():
        raise AnytimeError("seconds holds NaN; give times")
