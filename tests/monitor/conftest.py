"""What the tests of the monitor share: a made-up mission."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from monitor.endings import Ending
from monitor.logs import Floor
from monitor.missions import Energy, Mission, Value
from monitor.reports import CallRecord, Frame, Moment, Report
from monitor.states import Decision, Why

FLOOR = Floor(np.ones((12, 15), bool), start=(2, 1), goal=(9, 13), radius=4)
MISSION = Mission(Value("linear", 100.0, 60.0), Energy(0.2, 0.08, 0.03), name="ward")


def made_up_report(frames: int = 6, policy: str = "expected", seed: int = 3) -> Report:
    """A mission that was never lived: numbers that look like one's."""
    rng = np.random.default_rng(seed)
    told: list[Frame] = []
    belief = np.full((12, 15), 0.2)
    for index in range(frames):
        started, ended = 2.0 * index, 2.0 * index + 2.0
        belief = belief.copy()
        belief[rng.integers(12), rng.integers(15)] = rng.random()
        foreseen = 60.0 - 4.0 * (index > 2)  # frame 2 goes wrong
        curve = tuple((0.4 + 0.2 * step, foreseen - (step - 3.0) ** 2) for step in range(8))
        why = Why(foreseen + 10.0, 10.0, 20.0, curve, "inter-frame")
        decision = Decision({"see": 0.7, "find_path": 0.3}, 4.0, why)
        again = Moment(started + 1.0, "call", Decision(decision.shares, 5.0, decision.why))
        calls = (
            CallRecord("see", started, 0.7, 0.7, 0.0, "interrupted", None, 0.9, None),
            CallRecord("find_path", started + 0.7, 0.4, 0.3, 0.1, "complete", 0.8, 0.75, None),
        )
        told.append(
            Frame(
                index=index,
                started=started,
                ended=ended,
                standing=index == 0,
                moments=(Moment(started, "frame", decision), again),
                calls=calls if index < frames - 1 else (),
                driven=1.5 if index else 0.0,
                energy=3.0 + (index == 2),
                interrupted=False,
                story={
                    "path": [[2 + index, 1 + index], [3 + index, 2 + index]],
                    "plan": [[0, 2 + index, 1 + index], [1, 2, 2]],
                    "length": 1.4,
                    "belief": belief,
                },
            )
        )
    seconds, energy = 2.0 * frames, sum(frame.energy for frame in told)
    earned = float(MISSION.value(seconds))
    return Report(
        mission="ward",
        policy=policy,
        seed=seed,
        ending=Ending.REACHED,
        promised=60.0,
        net=earned - 0.2 * energy,
        earned=earned,
        seconds=seconds,
        energy=energy,
        driven=sum(frame.driven for frame in told),
        job=0.0,
        frames=tuple(told),
        machine="reference",
    )


@pytest.fixture
def mission() -> Mission:
    return MISSION


@pytest.fixture
def floor() -> Floor:
    return FLOOR


@pytest.fixture
def report() -> Report:
    return made_up_report()


@pytest.fixture(scope="session")
def made_up() -> Any:
    return made_up_report
