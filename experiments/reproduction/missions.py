"""What [PRP16] §4 claims of a robot that improves its plan while it executes it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

from experiments.benchmarks.nao import START
from experiments.benchmarks.nao_worlds import briefing
from experiments.reproduction.ways import Way
from monitor.reports import Report
from monitor.robots.nao import NaoRobot
from monitor.robots.nao_drift import Drift
from monitor.robots.nao_scenes import Goal, Scene
from monitor.robots.nao_world import Obstacle

GOAL = (-5.12, -0.18)
_HEADING = -3.09
_SHARE, _RADIUS, _APPEARS = 0.65, 0.08, 10.0  # where on its way, how large, and when (s)


def second_run(seed: int) -> Scene:
    """The second run of §4: its start and its goal. An obstacle appears in front of the robot when
    it has begun to walk; where and how large is not said."""
    at = tuple(s + _SHARE * (g - s) for s, g in zip(START, GOAL, strict=True))
    return Scene(
        "second run",
        start_in_world=(*START, _HEADING),
        goal=Goal(GOAL),
        obstacles=(Obstacle((at[0], at[1]), _RADIUS, appears=_APPEARS),),
        seed=seed,
    )


@lru_cache(maxsize=2)  # one seed, both ways
def lived(seed: int, way: Way) -> tuple[NaoRobot, Report]:
    """The robot at the end of the second run, and how that went."""
    return live(second_run(seed), way)


def live(scene: Scene, way: Way) -> tuple[NaoRobot, Report]:
    """Live a mission. Who does not learn, believes in no drift for ever."""
    able = replace(briefing(), planning=way.planning)
    drift = Drift() if way.learns else Drift(variance=0.0)
    robot = able.robot(scene, drift=drift)
    return robot, able.live(robot, scene.seed)


# --- The claims, one draw each.


def switch_above_threshold(seed: int, way: Way) -> bool:
    """It switches to another plan, and only to such as are better by the threshold."""
    robot, _ = lived(seed, way)
    return bool(robot.gains) and min(robot.gains) > robot.manner.threshold


def replanned_final(seed: int, way: Way) -> tuple[float, ...]:
    """Metres from the goal in the end, by odometry, however the mission ended."""
    robot, _ = lived(seed, way)
    return (math.dist(robot.reading.pose_in_world[:2], GOAL),)
