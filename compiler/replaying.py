"""Living a division again on recorded runs, problem by problem: what it would have achieved.

Tables hold averages over problems, so they lose what a hard problem does to several modules at
once, what flows on when a module completes early, and what is missing when a first result comes
late. All of that is still in the recordings, because each names its problem.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import INSTANT
from anytime.joins import Best
from anytime.profiles import Profile
from anytime.programs import Join, Program, upstream
from anytime.recordings import Recording
from anytime.running import RECENT
from anytime.sampling import CHANGES
from anytime.strata import stratum_weights
from compiler.executing import unwanted
from compiler.guarding import STEPS, Steps
from compiler.tables import Table

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
PATHS = 1200  # lives in all, shared by the problems
BETTER = 1.1  # times as good, what is called 10 % better


@dataclass(frozen=True)
class Records:
    """The recorded runs of one module as arrays: P problems, at most R runs of C changes each.

    inputs: parameters that other modules feed. fed: [P, R, inputs] quality of what arrived there.
    seconds: [P, R, C] of each change, inf beyond the last. qualities, estimates: [P, R, C]; of a
    module without estimates these are 0.
    counts: [P, R] changes. ends: [P, R] seconds at which a run was complete, inf if it was cut.
    there: [P, R] whether there is such a run; none on a problem for which nothing ever arrived.
    """

    inputs: tuple[str, ...]
    seconds: Floats
    qualities: Floats
    estimates: Floats
    fed: Floats
    counts: Indices
    ends: Floats
    there: NDArray[np.bool_]


@dataclass(frozen=True)
class Replay:
    """The recordings of a program's modules, ready to be lived again.

    problems: keys of the P problems, one for each row of what `achieved` returns.
    records: by module. tables: of the program's nodes, for what a call needs to have a first
    result. chosen: [calls, P, lives], numbers in [0, 1) that decide which run is taken; the same in
    every life, so that divisions are compared on common luck.
    """

    program: Program
    problems: tuple[str, ...]
    records: Mapping[str, Records]
    steps: Mapping[str, Steps]
    tables: tuple[Table, ...]
    chosen: Floats

    def achieved(
        self, shares: Sequence[float], budget: float, rows: Indices | None = None
    ) -> Floats:
        """Quality at the end of the budget on each problem, [P] or [rows]; 0 for no result.

        shares: seconds of each call, as `CompiledProgram.stages` has them: time that is left
        flows on, a late first result is waited for, and an alternative without time is not run.
        """
        rows = np.arange(len(self.problems)) if rows is None else rows
        lives = self.chosen.shape[2]
        problem = np.repeat(rows, lives)
        labels = [call.label for call in self.program.calls]
        skipped = unwanted(self.program, self.tables, dict(zip(labels, shares, strict=True)))
        firsts = {t.label: t.first for t in self.tables if not t.rule and t.label not in skipped}
        nothing = _Delivered(np.zeros(len(problem)), np.zeros(len(problem)), problem < 0)
        delivered: dict[str, _Delivered] = {}
        now, share_end = np.zeros(len(problem)), 0.0
        for call in self.program.nodes:
            if isinstance(call, Join):
                delivered[call.label] = _best(call, delivered)
                continue
            if call.label in skipped:
                delivered[call.label] = nothing
                continue
            place = labels.index(call.label)
            records, first = self.records[call.module.name], firsts.pop(call.label)
            sources = upstream(call)
            fed = {name: delivered[source.label].quality for name, source in sources.items()}
            alive = np.ones(len(problem), dtype=bool)
            for source in sources.values():
                alive &= delivered[source.label].there
            run = _drawn(records, problem, fed, self.chosen[place, rows].ravel())
            seconds = records.seconds[problem, run]
            counts = records.counts[problem, run]
            share_end += shares[place]
            last, hard = not firsts, budget - sum(firsts.values())
            if last and call.module.generator and not call.module.contract:
                count = _to_the_end(self.steps[call.module.name], now, seconds, counts, budget)
            elif last:
                count = (now[:, None] + seconds <= budget + 1e-9).sum(axis=1)
            elif call.module.contract:
                ends = np.maximum(share_end, np.minimum(now + first, hard))
                count = (seconds <= (ends - now)[:, None] + INSTANT).sum(axis=1)
            elif call.module.generator and self.steps[call.module.name].median:
                count = self._guarded(call.module.name, now, seconds, share_end, hard)
            else:
                ends = np.maximum(share_end, np.minimum(now + first, hard))
                count = (now[:, None] + seconds < ends[:, None]).sum(axis=1) + 1
                count[now >= ends] = 0
            count = np.minimum(count, counts)
            alive &= count > 0
            at = np.maximum(count - 1, 0)
            told = records.estimates[problem, run, at]
            delivered[call.label] = _Delivered(records.qualities[problem, run, at], told, alive)
            spent = np.where(alive, records.seconds[problem, run, at], 0.0)
            complete = (count == counts) & np.isfinite(records.ends[problem, run])
            # What it does after its last result, the guard ends with its share.
            most = np.maximum(share_end - now, spent)
            spent = np.where(complete, np.clip(records.ends[problem, run], spent, most), spent)
            if call.module.contract:
                spent = np.maximum(spent, np.minimum(share_end - now, spent * 2))
            now = now + spent
        output = delivered[self.program.output.label]
        output = np.where(output.there, output.quality, 0.0)
        return output.reshape(len(rows), lives).mean(axis=1)

    def faster(self, module: str, factor: float) -> Replay:
        """The same with a module `factor` times as fast."""
        records, steps = self.records[module], self.steps[module]
        quick = replace(records, seconds=records.seconds / factor, ends=records.ends / factor)
        median, p95 = (tuple(s / factor for s in row) for row in (steps.median, steps.p95))
        pace = replace(steps, median=median, p95=p95)
        tables = tuple(t.faster(factor) if t.module == module else t for t in self.tables)
        return replace(
            self,
            records={**self.records, module: quick},
            steps={**self.steps, module: pace},
            tables=tables,
        )

    def better(self, module: str) -> Replay:
        """The same with every result of a module better by `BETTER`, at most 1."""
        records = self.records[module]
        good = replace(
            records,
            qualities=np.minimum(records.qualities * BETTER, 1.0),
            estimates=np.minimum(records.estimates * BETTER, 1.0),
        )
        return replace(self, records={**self.records, module: good})

    def longer(self, module: str) -> Replay:
        """The same with one more result of each run of a module, after twice the time of its last,
        whose error is to the last one's as, on average, that was to the error at half its time."""
        records = self.records[module]
        place = np.maximum(records.counts - 1, 0)[..., None]
        times = np.take_along_axis(records.seconds, place, axis=2)
        last = np.take_along_axis(records.qualities, place, axis=2)[..., 0]
        at_half = np.maximum((records.seconds <= times / 2).sum(axis=2) - 1, 0)[..., None]
        half = np.take_along_axis(records.qualities, at_half, axis=2)[..., 0]
        some = records.counts > 0
        ratio = error_ratio(float(last[some].mean()), float(half[some].mean()))
        seconds = np.concatenate([records.seconds, np.full((*some.shape, 1), np.inf)], axis=2)
        after = records.counts[..., None]
        np.put_along_axis(seconds, after, np.where(some[..., None], 2 * times, np.inf), axis=2)
        grown: list[Floats] = []
        for values in (records.qualities, records.estimates):
            last = np.take_along_axis(values, place, axis=2)
            values = np.concatenate([values, np.zeros((*some.shape, 1))], axis=2)
            np.put_along_axis(values, after, 1 - ratio * (1 - last), axis=2)
            grown.append(values)
        qualities, estimates = grown
        ends = np.where(some, np.maximum(records.ends, 2 * times[..., 0]), records.ends)
        counts = records.counts + some
        more = replace(
            records,
            seconds=seconds,
            qualities=qualities,
            estimates=estimates,
            ends=ends,
            counts=counts,
        )
        return replace(self, records={**self.records, module: more})

    def _guarded(
        self, module: str, now: Floats, seconds: Floats, share_end: float, hard: float
    ) -> Indices:
        """How many results the deadline guard lets a generator have (`compiler.guarding`)."""
        steps = self.steps[module]
        last = len(steps.median) - 1
        index = [min(done, last) for done in range(1, seconds.shape[1])]
        median = np.array([steps.median[place] for place in index])
        p95 = np.array([steps.p95[place] for place in index])
        at = now[:, None] + seconds[:, :-1]
        refused = (at + median > share_end + INSTANT) | (at + p95 > hard + INSTANT)
        stops = np.hstack([refused, np.ones((len(refused), 1), dtype=bool)])
        count = 1 + np.asarray(stops.argmax(axis=1), dtype=np.intp)
        return np.where(now < hard, count, 0)


class _Delivered(NamedTuple):
    """What lives have of a node, each [lives]: its quality, its estimate, and whether it came."""

    quality: Floats
    estimate: Floats
    there: NDArray[np.bool_]


def _best(join: Join, delivered: Mapping[str, _Delivered]) -> _Delivered:
    """What a choice (`anytime.joins.Best`) takes in each life."""
    assert isinstance(join.rule, Best)
    one, other = (delivered[argument.label] for argument in join.arguments)
    taken = one.there & ~other.there
    taken |= one.there & ((one.estimate >= other.estimate) | (not join.rule.compare))
    return _Delivered(
        np.where(taken, one.quality, other.quality),
        np.where(taken, one.estimate, other.estimate),
        one.there | other.there,
    )


def _to_the_end(
    known: Steps, now: Floats, seconds: Floats, counts: Indices, budget: float
) -> Indices:
    """How many results in time the last call has, which is guarded by what is known of its steps,
    and beyond those by the moving average of its own (`compiler.guarding.last_guard`). Where it can
    be ended between two results it has all that come in time."""
    at = now[:, None] + np.where(np.isfinite(seconds), seconds, 0.0)
    steps = np.diff(at, axis=1, prepend=now[:, None])
    may = np.ones(seconds.shape, dtype=bool)
    for done in range(1, seconds.shape[1] if known.whole else 1):
        if done < min(len(known.median), STEPS - 1):
            expected = known.next(done, at[:, done - 1] - now)
        else:
            recent = steps[:, max(0, done - RECENT) : done]
            expected = np.sort(recent, axis=1)[:, recent.shape[1] // 2]
            for step in recent.T:
                expected += 0.4 * (np.minimum(step, 4 * expected + 1e-6) - expected)
        # Of a long run not every result is recorded, so that its steps are not known.
        may[:, done] = (at[:, done - 1] + expected <= budget + 1e-9) | (counts >= CHANGES)
    in_time = np.logical_and.accumulate(may, axis=1) & (now[:, None] + seconds <= budget + 1e-9)
    return np.where(now <= budget, in_time.sum(axis=1), 0)


def error_ratio(last: float, half: float) -> float:
    """By how much one more doubling of the time shrinks errors that the last one shrank from
    those of the quality `half` to those of `last`."""
    return float(np.clip((1.0 - last) / max(1.0 - half, 1e-9), 0.0, 1.0))


def replay_of(
    program: Program,
    profiles: Mapping[str, Profile],
    steps: Mapping[str, Steps],
    tables: Sequence[Table],
    seed: int = 0,
) -> Replay:
    """Arrange the recordings of a program's modules by problem.

    The program is one of calls and alternatives, one after the other. steps, tables: for the
    deadline guard, as in the compiled program. Profiles that were measured on problems of their own
    are put side by side by chance, as if they were independent.
    """
    rng = np.random.default_rng(seed)
    base = max((profile.problems for profile in profiles.values()), key=len)
    apart = {
        name: rng.permutation(profile.problems).tolist()
        for name, profile in profiles.items()
        if not set(profile.problems) & set(base)
    }
    # As many as the scarcest has: a problem that is used twice says nothing new.
    count = min([len(base), *map(len, apart.values())])
    records = {
        name: _records(profile, apart.get(name, base)[:count]) for name, profile in profiles.items()
    }
    lives = int(np.clip(PATHS // count, 8, 64))
    strata = np.array(
        [[rng.permutation(lives) for _ in range(count)] for _ in range(len(program.calls))]
    )
    chosen = (strata + rng.random(strata.shape)) / lives
    return Replay(program, tuple(base[:count]), records, steps, tuple(tables), chosen)


def _records(profile: Profile, problems: Sequence[str]) -> Records:
    runs: dict[str, list[tuple[Recording, Floats]]] = {}
    for run, quality in zip(profile.recordings, profile.qualities, strict=True):
        runs.setdefault(run.problem, []).append((run, quality))
    most = max(len(each) for each in runs.values())
    changes = 1 + max(max((len(run.seconds) for run in profile.recordings), default=0), 1)
    shape = (len(problems), most)
    seconds = np.full((*shape, changes), np.inf)
    qualities, estimates = np.zeros((*shape, changes)), np.zeros((*shape, changes))
    fed = np.zeros((*shape, len(profile.inputs)))
    counts = np.zeros(shape, dtype=np.intp)
    ends = np.full(shape, np.inf)
    there = np.zeros(shape, dtype=bool)
    for row, problem in enumerate(problems):
        for column, (run, quality) in enumerate(runs.get(problem, ())):
            count = len(run.seconds)
            seconds[row, column, :count] = run.seconds
            qualities[row, column, :count] = quality
            estimates[row, column, :count] = np.nan_to_num(run.estimates)
            fed[row, column] = [run.inputs[name] for name in profile.inputs]
            counts[row, column] = count
            ends[row, column] = run.end[0] if run.complete else np.inf
            there[row, column] = True
    return Records(profile.inputs, seconds, qualities, estimates, fed, counts, ends, there)


def _drawn(records: Records, problem: Indices, fed: Mapping[str, Floats], luck: Floats) -> Indices:
    """Which run of its problem each life takes, given the qualities [lives] fed to it: by chance,
    with the weights of `Profile.given`."""
    there = records.there[problem]
    points = records.fed[problem][:, :, [records.inputs.index(name) for name in fed]]
    target = np.array([*fed.values()]).reshape(len(fed), len(problem)).T
    edges = np.cumsum(stratum_weights(points, target, there), axis=1)
    drawn = (edges <= luck[:, None] * edges[:, -1:]).sum(axis=1)
    return np.clip(drawn, 0, np.maximum(there.sum(axis=1) - 1, 0))
