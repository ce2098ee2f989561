"""Shifts: by how much longer modules take than before, and how much better or worse they end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.profiles import Profile
from anytime.programs import Program
from compiler import CompiledProgram
from compiler.tables import Table

Floats = NDArray[np.float64]
GROUPS = 12  # of problems, each left out once
MOMENTS, NEARLY = 24, 0.97  # at which courses are compared, up to this share of where they end
ROUNDED = 1e-9


@dataclass(frozen=True)
class Shift:
    """A module against itself before: times as long to the same share of its quality, and times
    as good in the end."""

    slower: float = 1.0
    quality: float = 1.0

    def __repr__(self) -> str:
        return f"{self.slower:.3f} times as long, {self.quality:.3f} times as good"


SAME = Shift()


@dataclass(frozen=True)
class Shifts:
    """Shifts by label of the calls: of all problems, and with each group of them left out."""

    all: Mapping[str, Shift]
    groups: Sequence[Mapping[str, Shift]] = ()

    def without(self, out: int) -> Mapping[str, Shift]:
        """The shifts without a group; of all where there are no problems to leave out."""
        return self.groups[out] if self.groups else self.all


def shifts_of_libraries(program: Program, before: ProfileLibrary, after: ProfileLibrary) -> Shifts:
    """What changed from one library to another.

    A problem that is in both is left out of both, so what it adds to both cancels. Between
    machines of different names seconds say nothing, so units of work are compared there.
    Raises AnytimeError for a module that a library lacks.
    """
    for library, which in ((before, "before"), (after, "after")):
        for call in program.calls:
            if call.module.name not in library:
                known = ", ".join(library) or "none"
                raise AnytimeError(
                    f"the library {which} has no profile of {call.module.name!r}; it has {known}"
                )
    work = before.machine.name != after.machine.name
    pairs = {
        call.label: tuple(
            _conditioned(library[call.module.name], before[call.module.name], work)
            for library in (before, after)
        )
        for call in program.calls
    }
    problems = {run.problem for pair in pairs.values() for p in pair for run in p.recordings}
    group = {problem: index % GROUPS for index, problem in enumerate(sorted(problems))}

    def between(out: int | None) -> dict[str, Shift]:
        kept = {label: [_kept(p, group, out) for p in pair] for label, pair in pairs.items()}
        return {label: _between(*(_course(p) for p in pair)) for label, pair in kept.items()}

    return Shifts(between(None), [between(out) for out in range(GROUPS)])


def shifts_of_schedules(before: CompiledProgram, after: CompiledProgram) -> Shifts:
    """What changed from one compiled program to another; their files hold no problems, so nothing
    is known of the noise of measuring."""
    pairs = zip(before.tables, after.tables, strict=True)
    return Shifts({old.label: _between(_of_table(old), _of_table(new)) for old, new in pairs})


def _conditioned(profile: Profile, before: Profile, work: bool) -> Profile:
    """On the inputs that the module had before, so that it does not answer for those of others."""
    runs = before.recordings
    given = {name: float(np.mean([run.inputs[name] for run in runs])) for name in before.inputs}
    if work:
        moved = (replace(run, seconds=run.work) for run in profile.recordings)
        profile = replace(profile, recordings=tuple(moved))
    return profile.given(**given)


def _kept(profile: Profile, group: Mapping[str, int], out: int | None) -> Profile:
    kept = tuple(run for run in profile.recordings if group[run.problem] != out)
    if not kept:
        raise AnytimeError(
            f"{profile.module!r} was measured on too few problems to tell a change from noise"
        )
    return replace(profile, recordings=kept)


def _course(profile: Profile) -> tuple[Floats, Floats]:
    """(times, mean quality from each on) as a step function."""
    times = np.unique(np.concatenate([run.seconds for run in profile.recordings]))
    return times, profile.mean(times)


def _of_table(table: Table) -> tuple[Floats, Floats]:
    expected = table.expected[(slice(1, None),) * len(table.feeds)]
    mean = expected.reshape(-1, len(table.times)).mean(axis=0)
    return table.times[1:], np.maximum.accumulate(mean)[1:]


def _between(before: tuple[Floats, Floats], after: tuple[Floats, Floats]) -> Shift:
    """Geometric mean of the ratios of times to equal shares of where each course ends, and the
    ratio of those ends."""
    ends = float(before[1][-1]), float(after[1][-1])
    if min(ends) <= 0:
        return Shift(1.0, ends[1] / ends[0] if ends[0] > 0 else 1.0)
    # Levels of both, so that neither is favoured: a course comes late to those of the other.
    levels = (_levels(*before) + _levels(*after)) / 2
    levels -= ROUNDED  # a level that is a step of its course is reached by it, whatever was rounded
    reached = [times[np.searchsorted(mean / mean[-1], levels)] for times, mean in (before, after)]
    ratios = reached[1].clip(1e-9) / reached[0].clip(1e-9)
    return Shift(float(np.exp(np.log(ratios).mean())), ends[1] / ends[0])


def _levels(times: Floats, mean: Floats) -> Floats:
    """Shares of where a course ends, at times evenly spread on a logarithmic scale."""
    times, share = times.clip(1e-9), mean / mean[-1]
    moments = np.geomspace(times[0], times[np.searchsorted(share, NEARLY)], MOMENTS)
    return share[np.searchsorted(times, moments * (1 + 1e-9), side="right") - 1]
