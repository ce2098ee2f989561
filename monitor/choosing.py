"""The policy that wins on missions that it was not made with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compiler import CompiledProgram
from monitor.calibration import MakeRobot, Steady
from monitor.courses import Leg
from monitor.missions import Mission
from monitor.monitoring import Monitor
from monitor.policies import Constant, Policy, constant
from monitor.reports import Report
from monitor.rhythms import Rhythm
from monitor.states import Decision, State

Floats = NDArray[np.float64]
SPEEDS = 19


@dataclass(frozen=True)
class Verdict:
    """What held-out missions said of several policies.

    name: of the best. nets: net value of each mission, by policy, on the same seeds; alone: of
    those that the best lived afterwards. worth: their mean, what is to be expected of it. missed:
    by how much that is more than it promises itself; None if it foresees nothing.
    """

    name: str
    nets: Mapping[str, tuple[float, ...]]
    alone: tuple[float, ...]
    worth: float
    missed: float | None


@dataclass(frozen=True)
class Chosen:
    """Of several policies by name the one that held-out missions chose."""

    policies: Mapping[str, Policy]
    verdict: Verdict

    def __call__(self, state: State) -> Decision:
        verdict = self.verdict
        decision = self.policies[verdict.name](state)
        if state.moment != "frame":
            return decision
        if verdict.missed is None:  # what it was worth before is what it promises
            if state.frame:
                return decision
            curve = ((decision.contract, verdict.worth),)
            return replace(decision, why=replace(decision.why, value=verdict.worth, curve=curve))
        situation, why = state.situation, decision.why
        share = (situation.to_go + situation.in_hand) / state.route if state.route > 0 else 0.0
        more = verdict.missed * min(share, 1.0)
        curve = tuple((contract, net + more) for contract, net in why.curve)
        return replace(decision, why=replace(why, value=why.value + more, curve=curve))


def judge_policies(
    program: CompiledProgram,
    mission: Mission,
    policies: Mapping[str, Policy],
    rhythm: Rhythm | None,
    make_robot: MakeRobot,
    *,
    seeds: Sequence[int],
    further: Sequence[int],
) -> Verdict:
    """Which has the greatest mean net value on these seeds, which made none of them.

    further: seeds of missions that the best of them lives alone. What these were worth is what it
    promises: they had no part in the choice, so they do not know the luck that made it the best.
    """

    def live(name: str, seeds: Sequence[int]) -> list[Report]:
        monitor = Monitor(program, policies[name], name, rhythm)
        return [monitor.run(mission, make_robot(), seed=seed) for seed in seeds]

    nets = {name: tuple(report.net for report in live(name, seeds)) for name in policies}
    name = max(policies, key=lambda each: float(np.mean(nets[each])))
    reports = live(name, further)
    alone = tuple(report.net for report in reports)
    worth = float(np.mean(alone))
    missed = worth - float(np.mean([report.promised for report in reports]))
    return Verdict(name, nets, alone, worth, missed if np.isfinite(missed) else None)


def tuned_division(
    program: CompiledProgram, mission: Mission, lived: Sequence[Steady]
) -> Constant | None:
    """The best fixed division and speed, by missions lived at constant divisions; None without.

    What was seen, and so what was walked, hardly depends on the speed: each mission tells what it
    would have been worth at every speed.
    """
    speeds = np.geomspace(*mission.speeds, SPEEDS)
    best: tuple[float, Constant] | None = None
    for steady in lived:
        if not steady.legs:
            continue
        nets = np.mean([_nets(mission, legs, speeds) for legs in steady.legs], axis=0)
        index = int(np.argmax(nets))
        if best is None or nets[index] > best[0]:
            shares = dict(zip(program.labels, steady.shares, strict=True))
            best = float(nets[index]), constant(shares, float(speeds[index]))
    return best[1] if best else None


def _nets(mission: Mission, legs: Sequence[Leg], speeds: Floats) -> Floats:
    """Net values of a mission had it been walked at each speed, [V]."""
    walked = np.array([leg.walked for leg in legs])[:, None] / speeds
    thinking = np.array([leg.thinking for leg in legs])[:, None]
    seconds = np.maximum(walked, thinking).sum(axis=0) + mission.job
    energy = walked.sum(axis=0) * mission.energy.power(speeds)
    energy += mission.energy.idle * (seconds - walked.sum(axis=0))
    return mission.value(seconds) - mission.energy.price * energy
