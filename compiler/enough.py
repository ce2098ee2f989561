"""When a campaign has run enough: no other division can be much better than the compiled one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from anytime.confidence import problems_left, regret_bound
from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.pictures import number
from anytime.profiles import Profile
from anytime.programs import Program
from compiler.compiling import compile
from compiler.division import divide
from compiler.guarding import guards_of
from compiler.replaying import Replay, replay_of
from compiler.tables import tables

Floats = NDArray[np.float64]
PILOT = 15  # problems that settle what is compared and how it is guarded, and are not judged by
EQUAL = 33  # divisions of a budget into equal ticks, at most
LIKELY = 31  # divisions beside them that looked best to the pilot, at most
HALVINGS = 4  # budgets: the time of a run, and halves of it
ERROR = 0.05


@dataclass
class UntilRegret:
    """Ends a campaign when the compiled program's regret is surely small; see `measure(until=…)`.

    Compared are divisions of a budget into equal ticks and those that looked best after the first
    problems, at the time of a run and at halves of it. Every later problem lives them all again.
    The compiled division counts as the nearest of them. With 95 % no other is better by more than
    `bound`, on average over problems, whenever one looks: so the campaign may end when the bound is
    small. Problems must come in a random order.

    seconds: the time of a run, the largest budget. wanted: the bound, in quality, at which it ends.
    Raises AnytimeError for a bound outside (0, 1), and for a program without anything to divide.
    """

    program: Program
    wanted: float
    seconds: float
    problems: int = 0
    bound: float = 1.0
    _pilot: Replay | None = None
    _choices: list[Floats] = field(default_factory=list[Floats])
    _lived: list[list[Floats]] = field(default_factory=list[list[Floats]])

    def __post_init__(self) -> None:
        name, nodes, calls = self.program.name, self.program.nodes, self.program.calls
        if not 0 < self.wanted < 1:
            raise AnytimeError(
                f"a regret of {self.wanted:g}; give a share of the quality, in (0, 1)"
            )
        if len(calls) < 2 or len(nodes) > len(calls) or self.program.parallels:
            raise AnytimeError(
                f"{name!r} has no time to divide among calls in a row, so it has no regret; give a "
                "program of two or more, or a number of runs"
            )

    @property
    def left(self) -> int:
        """About how many problems more it takes."""
        return problems_left(max(self.problems - PILOT, 1), self.bound, self.wanted)

    def __call__(self, library: ProfileLibrary) -> bool:
        """Whether these runs are enough. The library grows from call to call."""
        profiles = {call.module.name: library[call.module.name] for call in self.program.calls}
        keys = list(dict.fromkeys(r.problem for p in profiles.values() for r in p.recordings))
        if self._pilot is None:
            self._begin(profiles, keys[:PILOT])
        fresh = keys[self.problems :]
        if fresh:
            self._lived.append(self._values(profiles, fresh))
            self.problems = len(keys)
            self.bound = self._bound(library)
        return self.bound <= self.wanted

    @property
    def _budgets(self) -> list[float]:
        return [self.seconds / 2**halving for halving in range(HALVINGS)]

    def _begin(self, profiles: dict[str, Profile], problems: Sequence[str]) -> None:
        some = {name: _only(profile, set(problems)) for name, profile in profiles.items()}
        made = tables(self.program, some)
        frontier = divide(made)
        self._pilot = replay_of(self.program, some, guards_of(some), made)
        self.problems = len(problems)
        for budget in self._budgets:
            likely = frontier.shares[frontier.budgets <= budget][-LIKELY:] / budget
            self._choices.append(np.vstack([equal_ticks(len(made)), _whole(likely)]))

    def _values(self, profiles: dict[str, Profile], problems: Sequence[str]) -> list[Floats]:
        """Quality of every division on some problems, [P, divisions] for each budget."""
        assert self._pilot is not None
        some = {name: _only(profile, set(problems)) for name, profile in profiles.items()}
        pilot = self._pilot
        replay = replay_of(self.program, some, pilot.steps, pilot.tables, self.problems)
        values: list[Floats] = []
        for budget, choices in zip(self._budgets, self._choices, strict=True):
            rows = [replay.achieved((shares * budget).tolist(), budget) for shares in choices]
            values.append(np.array(rows).T)
        return values

    def _bound(self, library: ProfileLibrary) -> float:
        compiled = compile(self.program, library)
        if compiled.least > self.seconds:
            return 1.0
        worst = 0.0
        for place, (budget, choices) in enumerate(zip(self._budgets, self._choices, strict=True)):
            if budget < compiled.least:
                continue
            given = np.array([*compiled.allocate(budget).shares.values()]) / budget
            nearest = int(np.abs(choices - _whole(given[None])).max(axis=1).argmin())
            values = np.concatenate([lived[place] for lived in self._lived])
            worst = max(worst, regret_bound(values, nearest, ERROR / HALVINGS))
        return worst

    def __repr__(self) -> str:
        told = f"{self.problems} problems: no division is better by more than {number(self.bound)}"
        if self.bound <= self.wanted:
            return told
        return f"{told}; at most about {self.left} more until {number(self.wanted)}"


def equal_ticks(calls: int) -> Floats:
    """The divisions of a whole into equal ticks, [divisions, calls], as fine as `EQUAL` lets them
    be."""
    ticks = 1
    while math.comb(ticks + calls, calls - 1) <= EQUAL:
        ticks += 1
    bars = np.array(list(combinations(range(ticks + calls - 1), calls - 1)))
    ends = np.hstack(
        [np.full((len(bars), 1), -1), bars, np.full((len(bars), 1), ticks + calls - 1)]
    )
    return (np.diff(ends, axis=1) - 1.0) / ticks


def _whole(shares: Floats) -> Floats:
    """Shares [n, calls] of which the last has all that is left."""
    return np.hstack([shares[:, :-1], 1.0 - shares[:, :-1].sum(axis=1, keepdims=True)])


def _only(profile: Profile, problems: set[str]) -> Profile:
    """The runs on some problems; those on all where there are none, which then count for nobody."""
    kept = tuple(run for run in profile.recordings if run.problem in problems)
    return replace(profile, recordings=kept) if kept else profile
