"""NAO's figures: the paper's scenes, its printed plans, faults, and worlds with the monitor off."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from experiments.benchmarks.figures import Benchmark
from monitor.endings import Ending
from monitor.robots.nao_missions import NaoBriefing, brief
from monitor.robots.nao_scenes import Goal, Scene, read_scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.simulated_nao import SimulatedNao
from planners.nao import Body
from planners.nao_plan import Action, plan_world, trajectory

SCENES = (
    *("sitting", "moving_target", "removed_early", "removed_late"),
    *("appearing", "hidden_second", "fall"),
)
START = (-4.12, -0.13)
"""Where the second run of [PRP16] §4 begins."""
PRINTED = (  # heading of the frame of reference, walks, where they led
    (-3.09, ((-0.69, -0.43), (0.74, -1.13), (0.91, 1.52)), (-5.08, -0.14)),
    (0.0, ((-0.72, 0.02), (-0.29, -0.04)), (-5.13, -0.15)),  # increments in world
    (-2.96, ((0.57, 0.51), (0.42, -0.65)), (-5.12, -0.17)),
)
"""The three plans that it prints, each in the frame of reference in which it makes sense."""
_NEAR = 0.06
"""Metres from the goal, by odometry, at which a robot without a monitor has arrived."""


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Benchmark:
    """Measure the NAO in its scenes and in random worlds, with noise, on the work clock.

    The quick form takes 8 seeds a scene and 24 worlds, the full one all 1,000. `maps` is not used.
    """
    seeds = range(seed, seed + (8 if quick else 30))
    figures: dict[str, float | int | None] = {}
    reasons: dict[str, str] = {}
    figures["golden.max_error_m"] = golden_error()
    with ProcessPoolExecutor(2) as pool:
        lives: list[tuple[bool, float, float, int]] = []
        for name in SCENES:
            progress(f"scene {name}, {len(seeds)} seeds")
            found = list(pool.map(_scene, [(name, one) for one in seeds]))
            figures[f"scenarios.{name}"] = float(np.mean([reached for reached, *_ in found]))
            lives += found if name != "moving_target" else []
        figures["scenarios.reached"] = min(figures[f"scenarios.{name}"] or 0.0 for name in SCENES)
        ended = [(odometry, true) for reached, odometry, true, _ in lives if reached]
        figures["final_error.median_m"] = float(np.median([odometry for odometry, _ in ended]))
        figures["final_error.p95_m"] = float(np.quantile([odometry for odometry, _ in ended], 0.95))
        figures["final_error.true_median_m"] = float(np.median([true for _, true in ended]))
        count = 1000 if full else 24 if quick else 100
        progress(f"{count} worlds, monitor on and off")
        worlds = list(pool.map(_world, range(seed, seed + count)))
    figures["worlds.monitored_success"] = float(np.mean([on for on, _ in worlds]))
    figures["worlds.unmonitored_success"] = float(np.mean([off for _, off in worlds]))
    _connection(figures, reasons, seed, progress)
    figures["oracle.within_cm"] = None
    reasons["oracle.within_cm"] = "needs pybullet, which is a test of its own"
    settings = {"seeds": len(seeds), "worlds": count, "not_measured": reasons}
    return Benchmark("nao", figures, settings, seed)


def golden_error() -> float:
    """How far the plans that the paper prints end from where it says, in metres."""
    errors: list[float] = []
    for heading, walks, expected in PRINTED:
        world = plan_world(expected, pose=(*START, heading), posture="Stand", body=Body())
        led = trajectory([Action("walk", *walk) for walk in walks], world)[-1]
        errors.append(math.dist((led.x, led.y), expected))
    return max(errors)


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


@cache
def _briefing() -> NaoBriefing:
    return brief()


def _scene(task: tuple[str, int]) -> tuple[bool, float, float, int]:
    """Whether a scene's goal was reached, how far from it by odometry and truly, and the falls."""
    name, seed = task
    file = Path(str(files("experiments") / "data" / "scenes" / f"{name}.toml"))
    return _lived(_briefing(), read_scene(file, seed=seed))


def _lived(briefing: NaoBriefing, scene: Scene) -> tuple[bool, float, float, int]:
    robot = briefing.robot(scene)
    report = briefing.live(robot, scene.seed)
    body = robot.body
    assert isinstance(body, SimulatedNao)
    true = math.dist(body.true_pose_in_world[:2], body.goal_in_world)
    return report.ending is Ending.REACHED, robot.apart(), true, body.falls


def _world(seed: int) -> tuple[bool, bool]:
    """Whether a NAO arrives in a random world, with the monitor and without it."""
    scene = random_world(seed)
    reached, *_ = _lived(_briefing(), scene)
    _, apart, _, _ = _lived(_briefing().unmonitored(), scene)
    return reached, apart <= _NEAR


def _connection(figures: dict, reasons: dict, seed: int, progress: Callable[[str], None]) -> None:
    keys = ("lockstep.identical", "faults.handled")
    if importlib.util.find_spec("qi") is None:
        for key in keys:
            figures[key], reasons[key] = None, "qi is not installed (extra nao)"
        return
    from experiments.benchmarks import nao_failures

    progress("lock-step over libqi, and the table of faults")
    figures["lockstep.identical"] = int(nao_failures.lockstep_identical(seed))
    handled: Iterable[bool] = nao_failures.failures(seed).values()
    figures["faults.handled"] = float(np.mean(list(handled)))
