"""What became of a mission: frames, decisions, a ledger of time that adds up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from anytime.clocks import is_number
from anytime.errors import AnytimeError
from anytime.pictures import clipped, duration, sparkline, thinned
from monitor.endings import Ending
from monitor.states import Decision, Situation

PRESENTED = Situation(0.0, 0.0, 0.0)  # nothing used, nothing in hand


@dataclass(frozen=True)
class Moment:
    """A decision and when it was made, in seconds since the task was presented."""

    time: float
    moment: str
    decision: Decision


@dataclass(frozen=True)
class CallRecord:
    """One call of the program in a frame."""

    label: str
    started: float
    elapsed: float
    share: float
    overrun: float
    status: str
    advertised: float | None
    estimate: float | None
    fault: str | None


@dataclass(frozen=True)
class Frame:
    """One frame: sensing and planning for the next while this one is executed.

    started, ended: seconds since the task was presented. standing: there was no plan to execute.
    moments: the decisions made in it, the first at its start. driven: seconds in motion.
    interrupted: the plan in execution was broken off. story: what the robot tells of it.
    situation: at its start. made_on: seconds of sensing behind the plan in execution.
    """

    index: int
    started: float
    ended: float
    standing: bool
    moments: tuple[Moment, ...]
    calls: tuple[CallRecord, ...]
    driven: float
    energy: float
    interrupted: bool
    story: Mapping[str, Any] = field(default_factory=dict[str, Any])
    situation: Situation = PRESENTED
    made_on: float = 0.0

    @property
    def decision(self) -> Decision:
        """The decision that the frame began with."""
        return self.moments[0].decision

    @property
    def waited(self) -> float:
        """Seconds in which the robot stood."""
        return self.ended - self.started - self.driven

    def told(self, name: str) -> float:
        """A length in the robot's story. Raises AnytimeError where it tells none by that name."""
        value: Any = self.story.get(name)
        if not is_number(value) or not 0 <= value < math.inf:
            raise AnytimeError(
                f"the robot's story says {name!r} is {value!r}; calibration needs the lengths "
                "walked and planned, `length` and `planned`, as finite numbers >= 0"
            )
        return float(value)


class Again(Protocol):
    """Lives a mission again with the decision of a frame changed."""

    def __call__(self, frame: int, shares: Mapping[str, float], speed: float | None) -> Report: ...


@dataclass(frozen=True)
class Report:
    """The outcome of a mission.

    promised: net value computed when the task was presented, NaN without foresight.
    net: what it was really worth.
    seconds: completion or ending time; energy used; driven: seconds in motion; job: seconds of work
    at the goal.
    again: lives the mission again with (frame, shares, speed) changed; None where nobody can.
    """

    mission: str
    policy: str
    seed: int
    ending: Ending
    promised: float
    net: float
    earned: float
    seconds: float
    energy: float
    driven: float
    job: float
    frames: tuple[Frame, ...]
    machine: str = ""
    fault: str = ""
    again: Again | None = field(default=None, repr=False, compare=False)

    def fork(self, frame: int, *, speed: float | None = None, **shares: float) -> Report:
        """The mission lived again, bit for bit, with the decision of one frame changed.

        speed, and seconds by call: instead of those that were decided; `report.fork(7, see=0.03)`.
        From there on the policy goes on as it sees fit. Raises AnytimeError for a frame or a call
        that there is not, and for a mission that cannot be lived again.
        """
        if self.again is None:
            raise AnytimeError("this mission cannot be lived again; live it with a briefing")
        if not isinstance(frame, int) or not 0 <= frame < len(self.frames):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(
                f"frame is {frame}; the mission had frames 0 to {len(self.frames) - 1}"
            )
        decided = self.frames[frame].decision.shares
        unknown = [label for label in shares if label not in decided]
        if unknown:
            raise AnytimeError(f"no call {unknown[0]!r} to fork; there are {', '.join(decided)}")
        return self.again(frame, shares, speed)

    @property
    def ledger(self) -> dict[str, float]:
        """Where the time went: drive + wait + job is all of it; the rest is what thinking took."""
        spent: dict[str, float] = {
            "drive": self.driven,
            "wait": self.seconds - self.driven - self.job,
            "job": self.job,
        }
        for frame in self.frames:
            for call in frame.calls:
                spent[call.label] = spent.get(call.label, 0.0) + call.elapsed
        spent["overrun"] = sum(call.overrun for frame in self.frames for call in frame.calls)
        return spent

    def _promise(self) -> str:
        return "" if math.isnan(self.promised) else f" (promised {self.promised:.1f})"

    def __bool__(self) -> bool:
        return self.ending is Ending.REACHED

    def __repr__(self) -> str:
        head = (
            f"{self.mission}, {self.policy}, seed {self.seed}: {self.ending.value} after "
            f"{duration(self.seconds)}, net value {self.net:.1f}{self._promise()}"
        )
        ledger = ", ".join(f"{name} {duration(spent)}" for name, spent in self.ledger.items())
        contracts = [frame.decision.contract for frame in self.frames]
        longest = max(contracts, default=1.0) or 1.0
        lines = [
            head,
            f"  {len(self.frames)} frames, contract times "
            f"{sparkline(thinned(contracts, 50), 0, longest)} up to {duration(longest)}",
            f"  {ledger}",
        ]
        if self.fault:
            lines.append(f"  fault: {self.fault}")
        return "\n".join(clipped(line) for line in lines)
