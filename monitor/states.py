"""What the monitor sees and what it decides: plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from anytime.clocks import is_number
from anytime.errors import AnytimeError
from monitor.endings import Ending

Moment = Literal["frame", "call"]


@dataclass(frozen=True)
class Situation:
    """What a robot reports of itself, in its own lengths.

    energy: used so far. to_go: length of the route beyond the hand-over, or from where it stands
    when there is no plan in hand. in_hand: planned length of the plan in execution that is left.
    interrupted: the plan in execution was broken off. ending: set when the robot's part is over.
    """

    energy: float
    to_go: float
    in_hand: float
    interrupted: bool = False
    ending: Ending | None = None


def checked(situation: Situation) -> Situation:
    """What a robot reports of itself, if it can be.

    Raises AnytimeError, which names what cannot: energy and lengths are numbers >= 0, and finite
    but for the way to go.
    """
    if not isinstance(situation, Situation):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"the robot's situation() gives {situation!r}; give a Situation")
    ending = situation.ending
    if ending is not None and not isinstance(ending, Ending):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"the robot's situation says ending = {ending!r}, no Ending or None")
    for name in ("energy", "to_go", "in_hand"):
        value = getattr(situation, name)
        finite = is_number(value) and (name == "to_go" or value < math.inf)
        if not finite or not value >= 0:
            raise AnytimeError(f"the robot's situation says {name} = {value!r}, no number >= 0")
    return situation


def loggable(story: Mapping[str, Any]) -> Mapping[str, Any]:
    """What a robot tells of a frame, if it can be logged.

    Raises AnytimeError if it is no mapping, or a length in it no finite number >= 0.
    """
    if not isinstance(story, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"the robot's story() gives {story!r}; give a dict")
    for name in ("length", "planned"):
        value = story.get(name, 0.0)
        if not is_number(value) or not 0 <= value < math.inf:
            raise AnytimeError(f"the robot's story says {name} = {value!r}, no finite number >= 0")
    return story


@dataclass(frozen=True)
class State:
    """The state that a decision is made in.

    moment: "frame" when a frame begins, "call" when a call of the program has ended in it.
    time: seconds since the task was presented. standing: there is no plan to execute.
    made_on: seconds that the sensing behind the plan in hand had.
    advertised, seen: expected quality of what was just computed by its profile, and its estimate;
    None where there is none. contract: the decision in force. route: length of the route when
    the task was presented. walked: length walked since; walked_on: seconds that the sensing behind
    the plans walked had, on average over their length. frame: its index.
    """

    moment: Moment
    time: float
    situation: Situation
    standing: bool
    made_on: float = 0.0
    advertised: float | None = None
    seen: float | None = None
    frame_started: float = 0.0
    contract: Decision | None = None
    route: float = 0.0
    walked: float = 0.0
    walked_on: float = 0.0
    frame: int = 0


@dataclass(frozen=True)
class Why:
    """The numbers behind a decision.

    value, cost: expected value of the task and cost of energy (VOT and COE of [ZR93] §5).
    seconds: foreseen to be left, before the spread of what really happens. curve: (contract
    seconds, net value) of the best decision for each contract time. case: which rule decided
    within a frame. prices: net value of one second more for each call, by label.
    """

    value: float = 0.0
    cost: float = 0.0
    seconds: float = 0.0
    curve: tuple[tuple[float, float], ...] = ()
    case: str = ""
    prices: Mapping[str, float] = field(default_factory=dict[str, float])

    @property
    def net(self) -> float:
        return self.value - self.cost


@dataclass(frozen=True)
class Decision:
    """Seconds for each call of the program in the frame, and the speed of execution."""

    shares: Mapping[str, float]
    speed: float
    why: Why = field(default_factory=Why)

    @property
    def contract(self) -> float:
        """The contract time t_c of the frame."""
        return sum(self.shares.values())
