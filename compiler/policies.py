"""Policies: what each call gets, in every state that a run may come to."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.joins import Branch, Known
from anytime.programs import Call, Input, Join, Program

Floats = NDArray[np.float64]
Seen = tuple[Floats, Floats]  # estimates [K], the quality that each stands for [K]; increasing
TICKS = 240  # parts of a budget between which shares are decided


@dataclass(frozen=True)
class Choice:
    """What one call gets in every state.

    state: what the decision looks at, in order: labels of nodes, by their level, and of branches,
    by what their tests answer. moments: [..., TICKS + 1] the moment at which the call is to end,
    by the state and the ticks that are left. seconds: [M] of the moments.
    """

    call: str
    state: tuple[str, ...]
    moments: NDArray[np.int16]
    seconds: Floats


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
    quality one stands for.
    """

    plans: tuple[Plan, ...]
    levels: Mapping[str, Floats]
    seen: Mapping[str, Seen]

    def plan(self, seconds: float) -> Plan | None:
        """The plan for a budget; None below the least one."""
        inside = [plan for plan in self.plans if plan.budget <= seconds + 1e-12]
        return inside[-1] if inside else None

    def share(
        self, program: Program, plan: Plan, call: str, left: float, known: Mapping[str, Known]
    ) -> float:
        """Seconds that a call gets when so many are left of the plan's budget.

        known: results that are there, by label of their node.
        """
        choice = next(choice for choice in plan.choices if choice.call == call)
        tick = plan.budget / TICKS
        ticks = min(TICKS, max(0, math.floor(left / tick + 1e-9))) if tick > 0 else 0
        state = tuple(self._level(program, name, known) for name in choice.state)
        return float(choice.seconds[choice.moments[(*state, ticks)]])

    def _level(self, program: Program, name: str, known: Mapping[str, Known]) -> int:
        if name not in self.levels:
            join = next(node for node in program.nodes if node.label == name.removesuffix("?"))
            assert isinstance(join, Join)
            assert isinstance(join.rule, Branch)
            given = [known.get(label_of(argument)) for argument in join.arguments]
            return int(join.rule.answer(given) is False)
        result, levels = known.get(name), self.levels[name]
        if result is None or len(levels) == 1:
            return 0
        estimate = 1.0 if result.estimate is None else result.estimate
        quality = float(np.interp(estimate, *self.seen[name])) if name in self.seen else estimate
        return 1 + int(np.abs(levels[1:] - quality).argmin())


def label_of(node: object) -> str:
    """What a node goes by in a state; an input has a name that no node has."""
    if isinstance(node, Call | Join):
        return node.label
    return f"input {node.name}" if isinstance(node, Input) else ""
