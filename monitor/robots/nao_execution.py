"""A NAO's plan in execution: how far it has come, what its actions tell a body, where it leads."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from anytime.clocks import Clock
from monitor.robots.nao_body import Action, NaoBody, Outcome
from monitor.robots.nao_story import Way
from planners import nao_plan
from planners.nao import POSTURES
from planners.query import Solution


@dataclass
class Execution:
    """A plan, action by action.

    done: actions that are complete. began: when the one that goes on began, of whatever plan it
    was then. heading: of the robot then. rises: whether it stands up.
    """

    solution: Solution
    actions: tuple[nao_plan.Action, ...]
    done: int = 0
    began: float = 0.0
    running: Action | None = None
    heading: float = 0.0
    rises: bool = False

    @property
    def current(self) -> nao_plan.Action | None:
        return self.actions[self.done] if self.done < len(self.actions) else None


def command(body: NaoBody, clock: Clock, action: nao_plan.Action) -> Action:
    """Tell a body the next action of a plan."""
    if action.name == "walk":
        return body.walk(action.ahead, action.left, 0.0)
    if action.name == "turn":
        return body.walk(0.0, 0.0, action.ahead)
    if action.name == "posture":
        return body.posture(POSTURES[int(action.ahead)])
    return _Pause(clock, action.ahead)


def leads(actions: Iterable[nao_plan.Action], world: Mapping[str, Any]) -> Way:
    """Where the rest of a plan leads, as a world foresees it."""
    return [(pose.x, pose.y) for pose in nao_plan.trajectory(actions, world)]


class _Pause:
    """Waiting, as an action."""

    def __init__(self, clock: Clock, seconds: float) -> None:
        self._clock = clock
        self._until = clock.now() + seconds

    def poll(self) -> Outcome | None:
        return Outcome.DONE if self._clock.now() >= self._until - 1e-9 else None

    def cancel(self) -> None:
        self._until = self._clock.now()
