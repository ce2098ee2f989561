"""What a run has to show for its time."""

from __future__ import annotations

import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

from anytime.pictures import clipped, duration, number


class Status(Enum):
    """What a run has to show: nothing, something, or all that it can give."""

    NO_RESULT = "no result"
    INTERRUPTED = "interrupted"
    COMPLETE = "complete"


class Change(NamedTuple):
    """A registered result: when, after how much work, and what may be seen of its quality."""

    seconds: float
    work: float
    estimate: float | None


@dataclass(frozen=True)
class Fault:
    """What a module raised."""

    kind: str
    message: str
    details: str = field(repr=False, default="")

    @classmethod
    def of(cls, error: BaseException) -> Fault:
        try:
            message = str(error)
        except Exception as broken:  # its own __str__ raises
            message = f"an error that cannot say what it is: {type(broken).__name__}"
        return cls(type(error).__name__, message, "".join(traceback.format_exception(error)))

    def __str__(self) -> str:
        return f"{self.kind}: {self.message}" if self.message else self.kind


@dataclass(frozen=True)
class Result:
    """The outcome of a run; truthy when there is something to use.

    elapsed, overrun: seconds used, and seconds past the deadline (0 when in time).
    history: every registration, in seconds and units of work since the start.
    parts: of a composed program, the result of each call by its label.
    """

    status: Status
    value: Any
    fault: Fault | None
    elapsed: float
    overrun: float
    history: tuple[Change, ...]
    work: float = 0.0
    parts: Mapping[str, Result] = field(default_factory=dict[str, Any])
    why: str = ""

    def __bool__(self) -> bool:
        return self.status is not Status.NO_RESULT

    def __repr__(self) -> str:
        over = f" ({duration(self.overrun)} over)" if self.overrun >= 5e-7 else ""
        estimate = self.history[-1].estimate if self.history else None
        seen = "" if estimate is None else f" {number(estimate)}"
        # What a choice passes on has no history of its own.
        made = len(self.history) or sum(len(part.history) for part in self.parts.values())
        count = f"{made} result{'s' if made != 1 else ''}"
        lines = [f"{self.status.name}{seen} after {duration(self.elapsed)}{over} · {count}"]
        lines += [f"  {label}: {part!r}".split("\n")[0] for label, part in self.parts.items()]
        if self.fault:
            lines.append(f"  fault: {self.fault}")
        if self.why:
            lines.append(f"  {self.why}")
        return "\n".join(clipped(line) for line in lines)
