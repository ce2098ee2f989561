"""What [PRP16] §3 says that a collision does in its model."""

from __future__ import annotations

import math

import numpy as np

from experiments.reproduction.ways import Way
from planners.nao import CROUCH, STAND
from planners.nao_plan import Action, plan_world, trajectory


def collision_on_crossing(seed: int, way: Way) -> bool:
    """Of two walks past a disc, the one that crosses it ends in a crouch at its middle, and the one
    that does not ends where it was told to, standing."""
    rng = np.random.default_rng((seed, 4))
    x, y, radius = rng.uniform([0.4, -0.2, 0.1], [0.8, 0.2, 0.3])
    far = math.hypot(x, y)
    tangent = math.asin(radius / far)
    inside = rng.uniform(-0.95, 0.95) * tangent
    outside = rng.choice([-1.0, 1.0]) * rng.uniform(1.05, 2.0) * tangent
    ends = []
    for aside in (inside, outside):
        bearing = math.atan2(y, x) + aside
        walk = Action("walk", 2.0 * math.cos(bearing), 2.0 * math.sin(bearing))
        world = plan_world(
            (1.0, 0.0),
            posture="Stand",
            obstacles=[(x, y, radius)],
            collision=way.planning.collision,
        )
        end = trajectory([walk], world)[-1]
        ends.append((walk, end))
    (_, hit), (walk, passed) = ends
    collided = hit.posture == CROUCH and math.dist((hit.x, hit.y), (x, y)) < 1e-9
    went_on = math.dist((passed.x, passed.y), (walk.ahead, walk.left)) < 1e-9
    return collided and went_on and passed.posture == STAND
