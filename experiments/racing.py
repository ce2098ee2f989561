"""The fixed division that is hardest to beat: a race of many on seeds that nobody else uses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.robots.briefing import Briefing

RACE_SEED = 3_000_000
# (how many are still in the race, on how many seeds they have run by then)
HEATS = ((None, 2), (80, 5), (30, 10), (10, 20))


@dataclass(frozen=True)
class Fixed:
    """A fixed division: seconds of sensing and planning in each frame, and a speed."""

    see: float
    find_path: float
    speed: float
    net: float

    def __repr__(self) -> str:
        return (
            f"see = {self.see:.3f}, find_path = {self.find_path:.3f}, speed = {self.speed:.3f}"
            f"  (net {self.net:.2f})"
        )


def candidates(briefing: Briefing) -> list[tuple[float, float, float]]:
    """At least 200 triples: 9 sensing times × 3 planning times × 9 speeds."""
    shares = briefing.contracts.shares
    sensing = np.geomspace(max(shares[:, 0].min(), 1e-6), shares[:, 0].max(), 9)
    planning = np.quantile(shares[:, 1], [0.25, 0.5, 1.0])
    speeds = np.geomspace(*briefing.grid.mission.speeds, 9)
    return [(float(a), float(b), float(c)) for a, b, c in product(sensing, planning, speeds)]


def race(briefing: Briefing, progress: Callable[[int, int], None] = lambda d, t: None) -> Fixed:
    """The best triple: losers are dropped after a few seeds, finalists run on twenty."""
    labels = briefing.program.labels
    runners = candidates(briefing)
    nets: dict[tuple[float, float, float], list[float]] = {runner: [] for runner in runners}
    for heat, (keep, seeds) in enumerate(HEATS):
        runners = sorted(runners, key=lambda r: -np.mean(nets[r]) if nets[r] else 0.0)[:keep]
        for place, runner in enumerate(runners):
            policy = constant(dict(zip(labels, runner[:2], strict=True)), runner[2])
            monitor = Monitor(briefing.program, policy, "fixed")
            for seed in range(RACE_SEED + len(nets[runner]), RACE_SEED + seeds):
                nets[runner].append(briefing.live(monitor, seed).net)
            progress(heat * len(runners) + place + 1, len(HEATS) * len(runners))
    best = max(runners, key=lambda r: float(np.mean(nets[r])))
    return Fixed(*best, float(np.mean(nets[best])))
