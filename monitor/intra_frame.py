"""Intra-frame optimisation: speed while the frame runs. [ZR93] §5."""

from __future__ import annotations

from dataclasses import replace

from monitor.missions import Mission
from monitor.states import Decision, State


def keep_course(mission: Mission, state: State) -> Decision:
    """The paper's rule for a frame in progress.

    Planning ahead of what its profile advertised and execution behind: faster. Planning behind and
    execution ahead: slower. The two cases that the paper leaves out keep course. The change of
    speed is gain × deviation, the deviation being the share of the contract by which execution
    is behind or ahead.
    """
    contract = state.contract
    if contract is None:
        raise ValueError("a frame in progress has a contract")
    if state.advertised is None or state.seen is None or contract.contract <= 0:
        return contract
    ends = state.time + state.situation.in_hand / contract.speed
    late = (ends - (state.frame_started + contract.contract)) / contract.contract
    plan_ahead = state.seen >= state.advertised
    slow, fast = mission.speeds
    speed, case = contract.speed, "keep course"
    if plan_ahead and late > 0:
        speed, case = min(fast, speed * (1 + mission.gain * min(late, 1.0))), "faster"
    elif not plan_ahead and late < 0:
        speed, case = max(slow, speed * (1 - mission.gain * min(-late, 0.9))), "slower"
    return replace(contract, speed=speed, why=replace(contract.why, case=case))
