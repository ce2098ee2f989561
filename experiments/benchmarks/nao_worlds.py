"""Random worlds for a NAO, and how it fares in them with the monitor and without."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from experiments.benchmarks.figures import Figures, ratio_interval, share_interval
from monitor.endings import Ending
from monitor.robots.nao_drift import Drift
from monitor.robots.nao_missions import NaoBriefing, brief
from monitor.robots.nao_scenes import Goal, Scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.simulated_nao import SimulatedNao
from planners.nao import Body

NEAR = 0.06
"""Metres from the goal, by odometry, at which a robot without a monitor has arrived."""
EXPLAINED = 60
"""In so many worlds the plan is executed without a monitor twice more, which tells what its
failures come of: by a robot that knows how standing up turns it, and by one that never errs."""

_CELL = 0.02  # metres, of the grid on which a way is looked for


class Life(NamedTuple):
    """A mission lived. apart, truly_apart: metres from its goal then, by odometry and truly."""

    ending: Ending
    apart: float
    truly_apart: float
    falls: int

    @property
    def reached(self) -> bool:
        return self.ending is Ending.REACHED

    @property
    def arrived(self) -> bool:
        """Whether a plan that was executed come what may led to the goal."""
        return self.falls == 0 and self.apart <= NEAR


class Outcome(NamedTuple):
    """The lives in one world. knowing, unerring: unmonitored, with the drift known, and without any
    noise; None where they were not lived."""

    reachable: bool
    monitored: Life
    unmonitored: Life
    knowing: Life | None
    unerring: Life | None


@cache
def briefing() -> NaoBriefing:
    """What all NAOs of the benchmark know; measured once a process."""
    return brief()


def lived(briefing: NaoBriefing, scene: Scene, drift: Drift | None = None) -> Life:
    """Live a mission in a scene. drift: what is known of standing up beforehand."""
    robot = briefing.robot(scene, drift=drift)
    report = briefing.live(robot, scene.seed)
    body = robot.body
    assert isinstance(body, SimulatedNao)
    true = math.dist(body.true_pose_in_world[:2], body.goal_in_world)
    return Life(report.ending, robot.apart(), true, body.falls)


def outcome(seed: int, explained: bool) -> Outcome:
    """How a NAO fares in a random world. explained: whether without a monitor three times."""
    scene = random_world(seed)
    alone = briefing().unmonitored()
    known = Drift(mean=scene.noise.drift[0], variance=0.0)
    return Outcome(
        reachable(scene),
        lived(briefing(), scene),
        lived(alone, scene),
        lived(alone, scene, known) if explained else None,
        lived(alone, scene.noiseless()) if explained else None,
    )


def figures(outcomes: Sequence[Outcome]) -> Figures:
    """Shares of the worlds, with their intervals; success over those whose goal can be reached."""
    able = [each for each in outcomes if each.reachable]
    missed = [
        o.unmonitored.apart for o in able if not (o.unmonitored.falls or o.unmonitored.arrived)
    ]
    shares = {
        "reachable": [each.reachable for each in outcomes],
        "monitored_success": [each.monitored.reached for each in able],
        "monitored_fell": [each.monitored.falls > 0 for each in able],
        "unmonitored_success": [each.unmonitored.arrived for each in able],
        "unmonitored_fell": [each.unmonitored.falls > 0 for each in able],
        "unmonitored_missed": [
            each.unmonitored.falls == 0 and not each.unmonitored.arrived for each in able
        ],
        "unmonitored_knowing_drift_success": [o.knowing.arrived for o in able if o.knowing],
        "unmonitored_noiseless_success": [o.unerring.arrived for o in able if o.unerring],
    }
    found: Figures = {}
    for name, held in shares.items():
        if held:
            found |= share_interval(f"worlds.{name}", held)
    arrived = shares["monitored_success"]
    found |= ratio_interval("worlds.vs_unmonitored", arrived, shares["unmonitored_success"])
    if any(o.unerring for o in able):
        both = [(o.monitored.reached, o.unerring.arrived) for o in able if o.unerring]
        found |= ratio_interval("worlds.vs_noiseless", *zip(*both, strict=True))
    found["worlds.unmonitored_missed_median_m"] = float(np.median(missed)) if missed else 0.0
    return found


def random_world(seed: int) -> Scene:
    """A goal behind one to three obstacles, one of which comes or moves in half of the worlds."""
    rng = np.random.default_rng((seed, 7))
    distance, bearing = rng.uniform([1.0, -0.5], [1.8, 0.5])
    goal = (distance * math.cos(bearing), distance * math.sin(bearing))
    obstacles: list[Obstacle] = []
    changing = bool(rng.integers(2))
    for number in range(rng.integers(1, 4)):
        while True:
            along, aside, radius = rng.uniform([0.4, -0.25, 0.06], [distance - 0.35, 0.25, 0.13])
            at = (
                along * math.cos(bearing) - aside * math.sin(bearing),
                along * math.sin(bearing) + aside * math.cos(bearing),
            )
            apart = [math.dist(at, other.at) - radius - (other.radius or 0) for other in obstacles]
            clear = min(math.hypot(*at), math.dist(at, goal)) - radius
            if clear > 0.25 and all(gap > 0.0 for gap in apart):
                break
            radius *= 0.9
        comes = changing and number == 0 and bool(rng.integers(2))
        moves = changing and number == 0 and not comes
        obstacles.append(
            Obstacle(
                at,
                radius,
                appears=float(rng.uniform(8.0, 14.0)) if comes else 0.0,
                velocity=(0.0, float(rng.uniform(-0.02, 0.02))) if moves else (0.0, 0.0),
            )
        )
    return Scene(f"world {seed}", goal=Goal(goal), obstacles=tuple(obstacles), seed=seed)


def reachable(scene: Scene) -> bool:
    """Whether a disc of the robot's size can get from the start to the goal among all obstacles
    that ever come; one that moves clears its way by and by, so it stands where it begins."""
    places = [scene.start_in_world[:2], scene.goal.at, *(each.at for each in scene.obstacles)]
    low, high = np.min(places, axis=0) - 1.0, np.max(places, axis=0) + 1.0
    xs, ys = (np.arange(low[axis], high[axis], _CELL) for axis in (0, 1))
    free = np.ones((len(xs), len(ys)), bool)
    for obstacle in scene.obstacles:
        clearance = [[obstacle.clearance((x, y)) for y in ys] for x in xs]
        free &= np.array(clearance) > Body().radius
    parts = np.zeros(free.shape, int)
    ndimage.label(free, output=parts)
    (start_x, start_y), (goal_x, goal_y) = (
        ((np.array(place) - low) / _CELL).astype(int) for place in places[:2]
    )
    return bool(parts[start_x, start_y] != 0 and parts[start_x, start_y] == parts[goal_x, goal_y])
