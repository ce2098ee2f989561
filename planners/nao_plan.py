"""Plans of a NAO as a probabilistic program, and the simulation that judges them. [PRP16] §3, §4.

Nothing here says "stand up first" or "go round": a plan is any list of actions, and the objective
is the distance from the goal that it leaves plus the effort that it takes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from planners.nao import CROUCH, POSTURES, STAND, STAND_INIT, STAND_ZERO, Body

WAIT, WALK, TURN, POSTURE = range(4)
"""The actions: wait(ms), walk(x, y), turn(a), posture(name)."""

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
    elapsed: float = 0.0,
    drift: float = 0.0,
    effort: float = 0.005,
    collision: str = "stops",
    body: Body | None = None,
) -> dict[str, Any]:
    """What a plan is simulated in, for `Query(plan, …)`.

    goal: (x, y) in world, metres. pose: (x, y, heading) in world. obstacles: discs (x, y, radius)
    in world, the robot's own radius included. elapsed: seconds of the plan that are executed
    already, from whose end `pose` and `posture` are. drift: radians by which standing up turns the
    robot. effort: of a second, in metres of distance. collision: "stops", or "paper" for the
    paper's rule. Raises AnytimeError for an unknown posture or rule and for too many obstacles.
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
    }


def standing(posture: int) -> bool:
    """Whether NAO can walk from this posture."""
    return posture == STAND or posture == STAND_INIT or posture == STAND_ZERO  # noqa: PLR1714


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


def plan(rng: Any, w: Any) -> float:
    """A plan of any length, and what it costs: metres from the goal plus effort."""
    x, y, heading, posture = w.x, w.y, w.heading, w.posture
    behind = w.elapsed
    seconds = 0.0
    while rng.flip("more", 0.7):
        action = rng.randint("action", 4)
        dx, dy, angle, target, takes = 0.0, 0.0, 0.0, posture, 0.0
        if action == WAIT:
            takes = rng.randint("wait", 1000) * 0.001
        elif action == WALK:
            ahead, left = rng.gaussian("walk", 0.0, 1.0), rng.gaussian("walk", 0.0, 1.0)
            if standing(posture):
                c, s = math.cos(heading), math.sin(heading)
                dx, dy = c * ahead - s * left, s * ahead + c * left
                takes = math.sqrt(dx * dx + dy * dy) / w.speed + w.step_phase
        elif action == TURN:
            a = rng.gaussian("turn", 0.0, 1.0)
            if standing(posture):
                angle = a
                takes = abs(angle) / w.turn_rate + w.step_phase
        else:
            target = rng.randint("posture", 6)
            takes = w.posture_seconds[posture, target]
        if behind >= takes:  # executed: the pose and the posture of the world contain it
            behind -= takes
            continue
        rest = 1.0 - behind / takes
        behind = 0.0
        dx, dy, angle = rest * dx, rest * dy, rest * angle
        seconds += rest * takes
        if not standing(posture) and standing(target):
            heading += w.drift
        posture = target
        heading += angle
        share, hit = first_contact(x, y, dx, dy, w)
        if hit < 0:
            x, y = x + dx, y + dy
            continue
        posture = CROUCH
        if w.collision == TELEPORTS:
            x, y = w.obstacles[hit, 0], w.obstacles[hit, 1]
        else:
            x, y = x + share * dx, y + share * dy
            seconds += w.fall_seconds
    ex, ey = x - w.goal_x, y - w.goal_y
    return math.sqrt(ex * ex + ey * ey) + w.effort * seconds
