"""What a mission does about failures: who failed how often, and who is asked no more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from anytime.clocks import is_number
from anytime.results import Result
from compiler import CompiledProgram
from monitor.missions import Mission
from monitor.states import Decision, Why

FAILURES = 3  # faults of a module in a mission, or frames in a row without a plan to execute


@dataclass
class Failures:
    """What has failed in a mission so far.

    faults: by call. fruitless: frames in a row without a plan. refused: plans in a row that the
    robot did not begin. notes: what to tell of it.
    """

    faults: dict[str, int] = field(default_factory=dict[str, int])
    fruitless: int = 0
    refused: int = 0
    notes: list[str] = field(default_factory=list[str])

    def count(self, label: str, result: Result) -> None:
        """Take note of a call's result."""
        if result.fault is not None:
            self.blame(label, str(result.fault))

    def blame(self, label: str, reason: str) -> None:
        """A call has failed; the third time it is quarantined."""
        self.faults[label] = self.faults.get(label, 0) + 1
        if self.faults[label] == FAILURES:
            self.note(f"{label} failed {FAILURES} times and is asked no more: {reason}")

    def refuse(self, reason: str) -> None:
        """The robot has not begun a plan. Who made it is asked again: it may be the robot."""
        self.refused += 1
        if self.refused == FAILURES:
            self.note(f"the robot refused {FAILURES} plans in a row: {reason}")

    def note(self, text: str) -> None:
        """Keep something to tell, once."""
        if text not in self.notes:
            self.notes.append(text)

    @property
    def quarantined(self) -> bool:
        """Whether a module is asked no more, so that no plan can be made."""
        return any(count >= FAILURES for count in self.faults.values())

    @property
    def no_plan_in_sight(self) -> bool:
        """Whether it is time to go without one."""
        return self.quarantined or max(self.fruitless, self.refused) >= FAILURES


def unsound(decision: Decision, labels: Sequence[str]) -> str:
    """Why a decision cannot be carried out; empty if it can.

    It is a Decision with a finite time >= 0 for each of the calls, and a speed that moves.
    """
    if not isinstance(decision, Decision):  # pyright: ignore[reportUnnecessaryIsInstance]
        return f"it gives {decision!r}, no Decision"
    if not isinstance(decision.why, Why):  # pyright: ignore[reportUnnecessaryIsInstance]
        return f"its reason is {decision.why!r}, no Why"
    for label in labels:
        if label not in decision.shares:
            return f"it gives no time to {label!r}"
    for label, time in decision.shares.items():
        if not is_number(time) or not 0 <= time < math.inf:
            return f"it gives {time!r} s to {label!r}, no finite number >= 0"
    if not is_number(decision.speed) or not 0 < decision.speed < math.inf:
        return f"its speed is {decision.speed!r}, no finite number > 0"
    return ""


def last_resort(program: CompiledProgram, mission: Mission) -> Decision:
    """What is decided when nothing can be: the least time with a result, at the least speed."""
    least = program.allocate(program.least).shares
    return Decision(dict(least), mission.speeds[0], Why(case="last resort"))
