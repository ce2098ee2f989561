"""Missions lived by the benchmark of the monitor: forked, and in real time."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from anytime import WallClock
from monitor.logs import write_log
from monitor.policies import Policy
from monitor.reports import Report
from monitor.robots.briefing import Briefing
from monitor.states import Decision, State

SHORTEST = 30.0  # seconds of the mission in real time


@dataclass
class Clocked:
    """A policy and the CPU time that its decisions took, in seconds."""

    policy: Policy
    spent: list[float] = field(default_factory=list[float])

    def __call__(self, state: State) -> Decision:
        began = time.thread_time()
        decision = self.policy(state)
        self.spent.append(time.thread_time() - began)
        return decision


def fork_figures(briefing: Briefing, seed: int) -> dict[str, float | int | None]:
    """Whether the same decision forked lives the same mission, byte for byte, in every frame."""
    report = briefing.live(briefing.monitor("table"), seed)
    same = [
        _log(briefing, report) == _log(briefing, _forked_alike(report, index))
        for index in range(len(report.frames))
    ]
    return {"fork.same_bytes": int(all(same)), "fork.count": len(same)}


def _forked_alike(report: Report, index: int) -> Report:
    decision = report.frames[index].decision
    return report.fork(index, speed=decision.speed, **decision.shares)


def _log(briefing: Briefing, report: Report) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "mission.jsonl"
        return write_log(file, briefing.grid.mission, None, report).read_bytes()


def share_of_cpu(briefing: Briefing, seed: int) -> dict[str, float | int | None]:
    """CPU time of the monitor's decisions over the seconds of a mission lived in real time."""
    monitor = briefing.monitor("table")
    policy = Clocked(monitor.policy)
    report = briefing.live(replace(monitor, policy=policy), seed, clock=WallClock())
    if report.seconds < SHORTEST:
        return {"share_of_cpu": None}
    return {
        "share_of_cpu": sum(policy.spent) / report.seconds,
        "share_of_cpu_seconds": report.seconds,
        "share_of_cpu_decisions": len(policy.spent),
    }
