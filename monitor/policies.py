"""Policies: pure functions from the monitor's state to its decision."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

from anytime.clocks import is_number
from anytime.errors import AnytimeError
from monitor.inter_frame import Contracts, Spread, best_contract
from monitor.intra_frame import keep_course
from monitor.missions import Mission
from monitor.rhythms import Rhythm
from monitor.states import Decision, State, Why


class Policy(Protocol):
    """Decides at the start of each frame and after each call in it."""

    def __call__(self, state: State) -> Decision: ...


@dataclass(frozen=True)
class Paper:
    """[ZR93] §5: certainty-equivalent argmax between frames, the rule of four cases within."""

    mission: Mission
    contracts: Contracts
    rhythm: Rhythm

    def __call__(self, state: State) -> Decision:
        if state.moment == "frame":
            return best_contract(self.mission, self.contracts, self.rhythm, Spread(), state)
        return keep_course(self.mission, state)


@dataclass(frozen=True)
class Expected:
    """Maximises the expectation over how missions really went, and again after each call.

    Between frames both contract and speed are chosen. Within one the same is asked from there on,
    and of the answer the speed is taken: the seconds of the calls stay as they were decided.
    """

    mission: Mission
    contracts: Contracts
    rhythm: Rhythm
    spread: Spread

    def __call__(self, state: State) -> Decision:
        if state.moment == "frame":
            return best_contract(self.mission, self.contracts, self.rhythm, self.spread, state)
        if state.contract is None:
            raise ValueError("a frame in progress has a contract")
        fresh = best_contract(self.mission, self.contracts, self.rhythm, self.spread, state)
        why = replace(state.contract.why, case="speed re-chosen")
        return replace(state.contract, speed=fresh.speed, why=why)


@dataclass(frozen=True)
class Informed:
    """Two policies, one for what is known before a time and one for what is known from it on."""

    at: float
    before: Policy
    after: Policy

    def __call__(self, state: State) -> Decision:
        return (self.before if state.time < self.at else self.after)(state)


@dataclass(frozen=True)
class Constant:
    """The same division and speed in every frame."""

    decision: Decision

    def __call__(self, state: State) -> Decision:
        return state.contract or self.decision


def constant(shares: dict[str, float], speed: float) -> Constant:
    """A tuned fixed division: seconds by call and a speed.

    Raises AnytimeError for a negative time or a speed that does not move.
    """
    if not is_number(speed) or not 0 < speed < math.inf:
        raise AnytimeError(f"speed is {speed!r}; it must be a finite number > 0")
    for label, seconds in shares.items():
        if not is_number(seconds) or not 0 <= seconds < math.inf:
            raise AnytimeError(f"{label} gets {seconds!r} s; it must be a finite number >= 0")
    return Constant(Decision(shares, speed, Why(case="fixed")))
