"""Hindsight: the best sequence of choices for one seed, found when its noise is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monitor.monitoring import Monitor
from monitor.reports import Report
from monitor.robots.briefing import Briefing
from monitor.states import Decision, State, Why

Choice = tuple[float, float, float]  # seconds of sensing and planning, speed
GRID = (6, 6, 4)


@dataclass
class Recited:
    """A policy that recites a sequence of choices, a frame each, the last one for ever."""

    labels: tuple[str, ...]
    choices: list[Choice]
    frame: int = -1

    def __call__(self, state: State) -> Decision:
        if state.moment == "frame":
            self.frame += 1
        see, plan, speed = self.choices[min(self.frame, len(self.choices) - 1)]
        return Decision(dict(zip(self.labels, (see, plan), strict=True)), speed, Why())


def choices_of(report: Report, labels: Sequence[str]) -> list[Choice]:
    """The choices that a mission was lived with."""
    return [
        (
            frame.decision.shares[labels[0]],
            frame.decision.shares[labels[1]],
            frame.moments[-1].decision.speed,
        )
        for frame in report.frames
    ]


def hindsight(
    briefing: Briefing, seed: int, lived: Sequence[Report], candidates: int = 300
) -> float:
    """The best net value found for this seed: every policy's own, then coordinate ascent from
    the best of them, each candidate judged by living the mission again."""
    labels = briefing.program.labels
    top = max(lived, key=lambda report: report.net)
    best, choices = top.net, choices_of(top, labels)
    shares = briefing.contracts.shares
    grids = (
        np.geomspace(shares[:, 0].min(), shares[:, 0].max(), GRID[0]),
        np.geomspace(shares[:, 1].min(), shares[:, 1].max(), GRID[1]),
        np.geomspace(*briefing.grid.mission.speeds, GRID[2]),
    )
    rng = np.random.default_rng([seed, 7])
    for _ in range(candidates):
        changed = list(choices)
        frame = int(rng.integers(len(changed)))
        place = int(rng.integers(3))
        value = list(changed[frame])
        value[place] = float(rng.choice(grids[place]))
        changed[frame] = (value[0], value[1], value[2])
        policy = Recited(labels, changed)
        report = briefing.live(Monitor(briefing.program, policy, "hindsight"), seed)
        if report.net > best:
            best, choices = report.net, choices_of(report, labels)
    return best
