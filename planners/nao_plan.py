"""Plans of a NAO as a probabilistic program, and the simulation that judges them. [PRP16] §3, §4.

Nothing here says "stand up first" or "go round": a plan is any list of actions, and the objective
is the distance from the goal that it leaves plus the effort that it takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from planners import query
from planners.nao import CROUCH, POSTURES, STAND, STAND_INIT, STAND_ZERO, Body
from planners.query import Address, Choices

WAIT, WALK, TURN, POSTURE = range(4)
"""The actions: wait(ms), walk(x, y), turn(a), posture(name)."""
ACTIONS = ("wait", "walk", "turn", "posture")

MOST_OBSTACLES = 8
STOPS, TELEPORTS = 0, 1
"""What a collision does to the robot: it falls where it touched, or, as the paper's model has it,
it is found crouching at the obstacle's centre."""


def plan_world(
    goal: tuple[float, float],
    *,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    posture: str = "Sit",
    obstacles: Sequence[tuple[float, float, float]] = (),
    done: int = 0,
    current: Action | None = None,
    elapsed: float = 0.0,
    drift: float = 0.0,
    effort: float = 0.005,
    collision: str = "stops",
    body: Body | None = None,
) -> dict[str, Any]:
    """What a plan is simulated in, for `Query(plan, …)`.

    goal: (x, y) in world, metres. pose: (x, y, heading) in world. obstacles: discs (x, y, radius)
    in world, the robot's own radius included. done: actions of the plan that are complete, which
    `pose` and `posture` contain. current, elapsed: the action that goes on, if any, and the seconds
    since it began; a plan that goes on with it is spared them.
    drift: radians by which standing up turns the robot. effort: of a second, in metres of distance.
    collision: "stops", or "paper" for the paper's rule.
    Raises AnytimeError for an unknown posture or rule and for too many obstacles.
    """
    if posture not in POSTURES:
        raise AnytimeError(f"posture {posture!r} is unknown; choose from {', '.join(POSTURES)}")
    if collision not in ("stops", "paper"):
        raise AnytimeError(f"collision={collision!r}; choose 'stops' or 'paper'")
    if len(obstacles) > MOST_OBSTACLES:
        raise AnytimeError(
            f"{len(obstacles)} obstacles; a plan is simulated among {MOST_OBSTACLES} at most: "
            "give the nearest"
        )
    body = body or Body()
    discs = np.zeros((MOST_OBSTACLES, 3))
    if obstacles:
        discs[: len(obstacles)] = obstacles
    return {
        "x": pose[0],
        "y": pose[1],
        "heading": pose[2],
        "posture": POSTURES.index(posture),
        "goal_x": goal[0],
        "goal_y": goal[1],
        "done": done,
        "current": -1 if current is None else ACTIONS.index(current.name),
        "current_ahead": 0.0 if current is None else current.ahead,
        "current_left": 0.0 if current is None else current.left,
        "elapsed": elapsed,
        "drift": drift,
        "effort": effort,
        "collision": STOPS if collision == "stops" else TELEPORTS,
        "obstacle_count": len(obstacles),
        "obstacles": discs,
        "speed": body.speed,
        "turn_rate": body.turn_rate,
        "step_phase": body.step_phase,
        "posture_seconds": np.array(body.posture_seconds),
        "fall_seconds": body.fall_seconds,
        "command_seconds": body.command_seconds,
    }


def standing(posture: int) -> bool:
    """Whether NAO can walk from this posture."""
    return posture in (STAND, STAND_INIT, STAND_ZERO)


def first_contact(x: float, y: float, dx: float, dy: float, w: Any) -> tuple[float, int]:
    """The share of the way by (dx, dy) after which the robot touches a disc, and which; (2, -1) if
    none. A robot that stands inside a disc may leave it."""
    share, which = 2.0, -1
    way = dx * dx + dy * dy
    if way == 0.0:
        return share, which
    for i in range(w.obstacle_count):
        fx, fy, r = x - w.obstacles[i, 0], y - w.obstacles[i, 1], w.obstacles[i, 2]
        along = fx * dx + fy * dy
        if along >= 0.0:
            continue
        apart = fx * fx + fy * fy - r * r
        if apart <= 0.0:
            return 0.0, i
        square = along * along - way * apart
        if square <= 0.0:
            continue
        touch = (-along - math.sqrt(square)) / way
        if touch < share and touch < 1.0:
            share, which = touch, i
    return share, which


def duration(posture: int, action: int, ahead: float, left: float, w: Any) -> float:
    """Seconds that an action takes from a posture; 0 for one that is refused."""
    if action == WAIT:
        return ahead
    if action == POSTURE:
        return w.posture_seconds[posture, int(ahead)]
    if not standing(posture):
        return 0.0
    if action == WALK:
        return math.sqrt(ahead * ahead + left * left) / w.speed + w.step_phase
    return abs(ahead) / w.turn_rate + w.step_phase


def share_left(action: int, behind: float, takes: float, w: Any) -> float:
    """What is left of an action after `behind` of its seconds. A walk moves but for half of its
    step phase at the beginning and half of it at the end."""
    if behind <= 0.0:
        return 1.0
    if behind >= takes:
        return 0.0
    if action in (WAIT, POSTURE):
        return 1.0 - behind / takes
    way = takes - w.step_phase
    if way <= 0.0:
        return 0.0
    return 1.0 - min(1.0, max(0.0, (behind - 0.5 * w.step_phase) / way))


def perform(
    x: float,
    y: float,
    heading: float,
    posture: int,
    seconds: float,
    action: int,
    ahead: float,
    left: float,
    behind: float,
    w: Any,
) -> tuple[float, float, float, int, float]:
    """One action: where it leads, and the seconds that it takes.

    ahead, left: what the action is told: wait (seconds, –), walk (x, y) in the robot's frame at its
    start, turn (angle, –), posture (number, –). behind: seconds since it began; what is executed of
    it the world's pose and posture contain ([PRP16] §4). A walk or a turn needs a standing posture;
    otherwise nothing happens.
    """
    takes = duration(posture, action, ahead, left, w)
    share = share_left(action, behind, takes, w)
    seconds += max(0.0, takes - behind)
    if action == WAIT:
        return x, y, heading, posture, seconds
    if action == POSTURE:
        target = int(ahead)
        if not standing(posture) and standing(target):
            heading += share * w.drift
        return x, y, heading, target, seconds
    if not standing(posture):
        return x, y, heading, posture, seconds
    if action == TURN:
        return x, y, heading + share * ahead, posture, seconds
    c, s = share * math.cos(heading), share * math.sin(heading)
    dx, dy = c * ahead - s * left, s * ahead + c * left
    touch, hit = first_contact(x, y, dx, dy, w)
    if hit < 0:
        return x + dx, y + dy, heading, posture, seconds
    if w.collision == TELEPORTS:
        return w.obstacles[hit, 0], w.obstacles[hit, 1], heading, CROUCH, seconds
    return x + touch * dx, y + touch * dy, heading, CROUCH, seconds + w.fall_seconds


def going_on(action: int, ahead: float, left: float, w: Any) -> bool:
    """Whether this is the very action that goes on; another one would begin now."""
    return action == w.current and ahead == w.current_ahead and left == w.current_left


def objective(x: float, y: float, seconds: float, w: Any) -> float:
    """Metres from the goal, plus the effort of the seconds. [PRP16] §3."""
    ex, ey = x - w.goal_x, y - w.goal_y
    return math.sqrt(ex * ex + ey * ey) + w.effort * seconds


@query.model
def plan(rng: Any, w: Any) -> float:
    """A plan of any length, and what it costs. [PRP16] §3."""
    x, y, heading, posture, seconds = w.x, w.y, w.heading, w.posture, 0.0
    made = 0
    while rng.flip("more", 0.7):
        action = rng.randint("action", 4)
        ahead, left = 0.0, 0.0
        if action == WAIT:
            ahead = rng.randint("wait", 1000) * 0.001
        elif action == WALK:
            ahead, left = rng.gaussian("walk", 0.0, 1.0), rng.gaussian("walk", 0.0, 1.0)
        elif action == TURN:
            ahead = rng.gaussian("turn", 0.0, 1.0)
        else:
            ahead = float(rng.randint("posture", 6))
        made += 1
        if made <= w.done:
            continue
        goes_on = made == w.done + 1 and going_on(action, ahead, left, w)
        behind = w.elapsed if goes_on else 0.0
        x, y, heading, posture, seconds = perform(
            x, y, heading, posture, seconds, action, ahead, left, behind, w
        )
        seconds += w.command_seconds
    return objective(x, y, seconds, w)


@dataclass(frozen=True)
class Action:
    """One action of a plan: "wait" (seconds), "walk" (x, y), "turn" (angle) or "posture"."""

    name: str
    ahead: float
    left: float = 0.0

    def __str__(self) -> str:
        if self.name == "posture":
            return f"posture {POSTURES[int(self.ahead)]}"
        told = f"{self.ahead:.2f}, {self.left:.2f}" if self.name == "walk" else f"{self.ahead:.2f}"
        return f"{self.name} ({told})"


@dataclass(frozen=True)
class Pose:
    """Where the robot is expected: metres and radians in world, a posture, seconds from now."""

    x: float
    y: float
    heading: float
    posture: int
    seconds: float


def actions_of(choices: Mapping[Address, Any]) -> tuple[Action, ...]:
    """The actions that a plan's choices stand for."""
    values: dict[str, list[Any]] = {}
    for (source, _), value in choices.items():
        values.setdefault(source, []).append(value)
    told = {source: iter(found) for source, found in values.items()}
    actions: list[Action] = []
    for action in values.get("action", []):
        if action == WAIT:
            actions.append(Action("wait", next(told["wait"]) * 0.001))
        elif action == WALK:
            actions.append(Action("walk", next(told["walk"]), next(told["walk"])))
        elif action == TURN:
            actions.append(Action("turn", next(told["turn"])))
        else:
            actions.append(Action("posture", float(next(told["posture"]))))
    return tuple(actions)


def made_before(choices: Choices, done: int) -> Choices:
    """The choices that the first `done` actions of a plan are made of."""
    turns = [place for place, (source, _) in enumerate(choices) if source == "more"]
    return choices.first(turns[done] if done < len(turns) else len(choices))


def trajectory(actions: Iterable[Action], world: Mapping[str, Any]) -> tuple[Pose, ...]:
    """Where a plan leads in a world, by the model's own simulation: the pose now, and after each
    action that is still to be done."""
    w = query.plain(world)
    x, y, heading, posture, seconds = w.x, w.y, w.heading, w.posture, 0.0
    poses = [Pose(x, y, heading, posture, 0.0)]
    for made, action in enumerate(actions):
        number = ACTIONS.index(action.name)
        if made < w.done:
            continue
        goes_on = made == w.done and going_on(number, action.ahead, action.left, w)
        behind = w.elapsed if goes_on else 0.0
        x, y, heading, posture, seconds = perform(
            x, y, heading, posture, seconds, number, action.ahead, action.left, behind, w
        )
        seconds += w.command_seconds
        poses.append(Pose(x, y, heading, posture, seconds))
    return tuple(poses)
