"""The policy that wins on missions that it was not made with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compiler import CompiledProgram
from monitor.calibration import SPEEDS, MakeRobot, Steady
from monitor.missions import Mission
from monitor.monitoring import Monitor
from monitor.policies import Constant, Policy, constant
from monitor.reports import Report
from monitor.rhythms import Rhythm
from monitor.states import Decision, State
from monitor.stopping import errors_apart

ROUND = 20  # missions of each policy, before some are dropped
BEHIND = 2.0


@dataclass(frozen=True)
class Verdict:
    """What held-out missions said of several policies.

    name: of the best. nets: net value of each mission, by policy, on the same seeds, fewer of those
    that were dropped; alone: of those that the best lived afterwards. worth: their mean, what is to
    be expected of it. missed: by how much that is more than it promises itself; None if it foresees
    nothing.
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
    """Which is worth most on these seeds, which made none of them: a race in rounds, in which
    policies are dropped that are `BEHIND` standard errors of the paired difference behind the best.

    further: seeds of missions that the best of them lives alone. What these were worth is what it
    promises: they had no part in the choice, so they do not know the luck that made it the best.
    """

    def live(name: str, seeds: Sequence[int]) -> list[Report]:
        monitor = Monitor(program, policies[name], name, rhythm)
        return [monitor.run(mission, make_robot(), seed=seed) for seed in seeds]

    nets: dict[str, list[float]] = {name: [] for name in policies}
    racing, name = list(policies), next(iter(policies))
    for start in range(0, len(seeds), ROUND):
        for each in racing:
            nets[each] += [report.net for report in live(each, seeds[start : start + ROUND])]
        name = max(racing, key=lambda each: float(np.mean(nets[each])))
        if len(nets[name]) < 2:  # a single mission tells of no error
            continue
        best = np.array(nets[name])
        racing = [each for each in racing if errors_apart(best, np.array(nets[each])) < BEHIND]
        if len(racing) == 1:
            break
    reports = live(name, further)
    alone = tuple(report.net for report in reports)
    worth = float(np.mean(alone))
    missed = worth - float(np.mean([report.promised for report in reports]))
    told = {each: tuple(values) for each, values in nets.items()}
    return Verdict(name, told, alone, worth, missed if np.isfinite(missed) else None)


def tuned_division(
    program: CompiledProgram, mission: Mission, lived: Sequence[Steady]
) -> Constant | None:
    """The best fixed division and speed, by missions lived at constant divisions; None without."""
    speeds = np.geomspace(*mission.speeds, SPEEDS)
    if not any(steady.legs for steady in lived):
        return None
    nets = np.array([steady.nets(mission, speeds) for steady in lived])
    place, index = np.unravel_index(int(np.argmax(nets)), nets.shape)
    shares = dict(zip(program.labels, lived[int(place)].shares, strict=True))
    return constant(shares, float(speeds[index]))
