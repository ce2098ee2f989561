"""Forks: a mission lived again bit for bit, with one decision changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from monitor.policies import Policy, constant
from monitor.states import Decision, State


@dataclass(frozen=True)
class Forked:
    """A policy that decides otherwise at the beginning of one frame, and nowhere else.

    shares: seconds by call that are changed. speed: instead of the policy's; None keeps it.
    """

    policy: Policy
    frame: int
    shares: Mapping[str, float]
    speed: float | None = None

    def __call__(self, state: State) -> Decision:
        decision = self.policy(state)
        if state.moment != "frame" or state.frame != self.frame:
            return decision
        shares = {**decision.shares, **self.shares}
        return replace(decision, shares=shares, speed=self.speed or decision.speed)


def forked(policy: Policy, frame: int, shares: Mapping[str, float], speed: float | None) -> Forked:
    """A fork of a policy. Raises AnytimeError for what is no time or no speed."""
    constant(dict(shares), 1.0 if speed is None else speed)  # has the guards
    return Forked(policy, frame, dict(shares), speed)
