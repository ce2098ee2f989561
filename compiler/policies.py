"""Policies: what each call gets, in every state that a run may come to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import INSTANT
from anytime.joins import Branch, Known
from anytime.programs import Call, Input, Join, Program

Floats = NDArray[np.float64]
Seen = tuple[Floats, Floats]  # estimates [K], the quality that each stands for [K]; increasing
TICKS = 240  # parts of a budget between which shares are decided


@dataclass(frozen=True)
class Within:
    """When a call that is watched ends, in every state.

    state: as of a choice. ends: [..., M', ⌈L / 8⌉, TICKS + 1] whether at a moment within the budget
    with a level, a bit for each level.
    """

    state: tuple[str, ...]
    ends: NDArray[np.uint8]


@dataclass(frozen=True)
class Choice:
    """What one call, or all calls of a parallel, get in every state.

    calls: labels of those that begin. state: what the decision looks at, in order: labels of nodes,
    by their level, and of branches, by what their tests answer. chosen: [..., TICKS + 1] which
    division, by the state and the ticks that are left; of a call that is watched, the last moment
    at which it may end. shares: [D, calls] seconds of each division. within: of a call that is
    watched.
    """

    calls: tuple[str, ...]
    state: tuple[str, ...]
    chosen: NDArray[np.int16]
    shares: Floats
    within: Within | None = None


@dataclass(frozen=True)
class Share:
    """What a call gets when it begins.

    seconds: at most. moments: [M'] seconds; ends: [M', L] whether to end at one of them with a
    level; both empty where the call is not watched. levels: [L]; seen: what estimates stand for.
    """

    seconds: float
    moments: Floats = field(default_factory=lambda: np.zeros(0))
    ends: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))
    levels: Floats = field(default_factory=lambda: np.zeros(0))
    seen: Seen | None = None

    @property
    def watched(self) -> bool:
        """Whether it depends on what the call shows while it runs."""
        return len(self.moments) > 0

    def level(self, estimate: float) -> int:
        """The level of a result that shows this."""
        return nearest(self.levels, estimate, self.seen)


@dataclass(frozen=True)
class Plan:
    """The choices for one budget, and what they are worth."""

    budget: float
    value: float
    choices: tuple[Choice, ...]


@dataclass(frozen=True)
class Policy:
    """Plans for increasing budgets. A budget between two is spent by the plan of the lower one.

    levels: of the nodes that decisions look at, by label. seen: of those with estimates, what
    quality one stands for. watched: labels of the calls whose end is decided while they run.
    """

    plans: tuple[Plan, ...]
    levels: Mapping[str, Floats]
    seen: Mapping[str, Seen]
    watched: frozenset[str] = frozenset()

    def plan(self, seconds: float) -> Plan | None:
        """The plan for a budget; None below the least one."""
        inside = [plan for plan in self.plans if plan.budget <= seconds + INSTANT]
        return inside[-1] if inside else None

    def share(
        self, program: Program, plan: Plan, call: str, left: float, known: Mapping[str, Known]
    ) -> Share:
        """What a call gets when so many seconds are left of the plan's budget; one of a parallel,
        when so many are left as that begins.

        known: results that are there, by label of their node.
        """
        choice = next(choice for choice in plan.choices if call in choice.calls)
        tick = plan.budget / TICKS
        ticks = min(TICKS, max(0, math.floor(left / tick + 1e-9))) if tick > 0 else 0
        state = tuple(self._level(program, name, known) for name in choice.state)
        division = choice.chosen[(*state, ticks)]
        seconds = float(choice.shares[division, choice.calls.index(call)])
        if choice.within is None:
            return Share(seconds)
        levels = self.levels[call]
        inside = tuple(self._level(program, name, known) for name in choice.within.state)
        bits = choice.within.ends[(*inside, slice(None), slice(None), ticks)]
        ends = np.unpackbits(bits, axis=-1, count=len(levels)).astype(np.bool_)
        return Share(seconds, choice.shares[: len(ends), 0], ends, levels, self.seen.get(call))

    def _level(self, program: Program, name: str, known: Mapping[str, Known]) -> int:
        if name not in self.levels:
            join = next(node for node in program.nodes if node.label == name.removesuffix("?"))
            assert isinstance(join, Join)
            assert isinstance(join.rule, Branch)
            given = [known.get(label_of(argument)) for argument in join.arguments]
            return int(join.rule.answer(given) is False)
        result, levels = known.get(name), self.levels[name]
        if result is None:
            return 0
        estimate = 1.0 if result.estimate is None else result.estimate
        return nearest(levels, estimate, self.seen.get(name))


def nearest(levels: Floats, estimate: float, seen: Seen | None) -> int:
    """The level of a result that shows this; 0 where there are no levels but "no result"."""
    if len(levels) == 1:
        return 0
    quality = estimate if seen is None else float(np.interp(estimate, *seen))
    return 1 + int(np.abs(levels[1:] - quality).argmin())


def label_of(node: object) -> str:
    """What a node goes by in a state; an input has a name that no node has."""
    if isinstance(node, Call | Join):
        return node.label
    return f"input {node.name}" if isinstance(node, Input) else ""
