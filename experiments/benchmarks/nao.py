"""NAO's figures: the paper's scenes, its printed plans, faults, and worlds with the monitor off."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from importlib.resources import files
from itertools import pairwise, takewhile
from pathlib import Path

import numpy as np

from anytime.executors import processes
from experiments.benchmarks import nao_oracle, nao_worlds, replanning
from experiments.benchmarks.figures import Benchmark, share_interval
from experiments.benchmarks.nao_worlds import Life, Outcome, briefing, lived, outcome
from monitor.robots.nao_scenes import read_scene
from planners.nao import STANDING, Body
from planners.nao_plan import Action, actions_of, plan, plan_world, trajectory
from planners.query import Query

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


_EVALUATIONS = 200_000  # two seconds of the reference machine
_ARRIVED = 0.02  # metres from the goal at which a plan ends there


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Benchmark:
    """Measure the NAO in its scenes and in random worlds, with noise, on the work clock.

    30 seeds a scene and 1,000 worlds; the quick form takes 60 of them. `full` and `maps` are not
    used.
    """
    seeds = range(seed, seed + 30)
    figures: dict[str, float | int | None] = {}
    reasons: dict[str, str] = {}
    figures["golden.max_error_m"] = golden_error()
    with processes(2) as pool:
        shortest = list(pool.map(_goes_round, seeds))
        figures |= share_interval("plan.stands_and_goes_round", shortest)
        _scenes(figures, pool, seeds, progress)
        count = nao_worlds.EXPLAINED if quick else 1000
        worlds: list[Outcome] = []
        explained = [number < nao_worlds.EXPLAINED for number in range(count)]
        for found in pool.map(outcome, range(seed, seed + count), explained):
            if len(worlds) % 100 == 0:
                progress(f"worlds {len(worlds)} to {min(len(worlds) + 100, count)} of {count}")
            worlds.append(found)
    figures |= nao_worlds.figures(worlds)
    _connection(figures, reasons, seed, progress)
    _oracle(figures, reasons, range(seed, seed + 40), progress)
    settings = {
        "seeds": len(seeds),
        "worlds": count,
        "worlds_explained": nao_worlds.EXPLAINED,
        "not_measured": reasons,
    }
    return Benchmark("nao", figures, settings, seed)


def _scenes(
    figures: dict[str, float | int | None],
    pool: Executor,
    seeds: Sequence[int],
    progress: Callable[[str], None],
) -> None:
    """How often each scene's goal was reached, and how far from it the missions ended."""
    ended: list[Life] = []
    for name in SCENES:
        progress(f"scene {name}, {len(seeds)} seeds")
        lives = list(pool.map(_scene, [(name, one) for one in seeds]))
        figures |= share_interval(f"scenarios.{name}", [life.reached for life in lives])
        # a goal that moves is met on its way, so there is no place where one should have ended
        ended += lives if name != "moving_target" else []
    worst = min(SCENES, key=lambda name: figures[f"scenarios.{name}"] or 0.0)
    for end in ("", "_low", "_high"):
        figures[f"scenarios.reached{end}"] = figures[f"scenarios.{worst}{end}"]
    apart = [life.apart for life in ended]
    figures["final_error.median_m"] = float(np.median(apart))
    figures["final_error.p95_m"] = float(np.quantile(apart, 0.95))
    figures["final_error.true_median_m"] = float(np.median([life.truly_apart for life in ended]))


def golden_error() -> float:
    """How far the plans that the paper prints end from where it says, in metres."""
    errors: list[float] = []
    for heading, walks, expected in PRINTED:
        world = plan_world(expected, pose=(*START, heading), posture="Stand", body=Body())
        led = trajectory([Action("walk", *walk) for walk in walks], world)[-1]
        errors.append(math.dist((led.x, led.y), expected))
    return max(errors)


def _goes_round(seed: int) -> bool:
    """[PRP16] Fig. 1: from sitting, with an obstacle in front, the plan stands up first and goes
    round it to the goal, within 3 % of the shortest detour."""
    world = plan_world(replanning.GOAL, obstacles=[replanning.OBSTACLE])
    found = Query(plan, world, seed=seed).run(evaluations=_EVALUATIONS)
    actions = actions_of(found.choices)
    led = trajectory(actions, world)
    # By way of crouching it is quicker, so a plan may take several postures until it stands.
    rising = list(takewhile(lambda action: action.name == "posture", actions))
    stands = bool(rising) and int(rising[-1].ahead) in STANDING
    arrives = math.dist((led[-1].x, led[-1].y), replanning.GOAL) <= _ARRIVED
    # Who touches something crouches.
    upright = all(pose.posture in STANDING for pose in led[len(rising) :])
    way = sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(led))
    shortest = replanning.detour((0.0, 0.0), replanning.GOAL, replanning.OBSTACLE)
    return stands and arrives and upright and way <= 1.03 * shortest


def _scene(task: tuple[str, int]) -> Life:
    name, seed = task
    file = Path(str(files("experiments") / "data" / "scenes" / f"{name}.toml"))
    return lived(briefing(), read_scene(file, seed=seed))


def _oracle(
    figures: dict, reasons: dict, seeds: Sequence[int], progress: Callable[[str], None]
) -> None:
    if not nao_oracle.available():
        figures["oracle.within_cm"] = None
        reasons["oracle.within_cm"] = nao_oracle.MISSING
        return
    progress(f"{len(seeds)} worlds beside Bullet's")
    figures |= nao_oracle.figures(seeds)


def _connection(figures: dict, reasons: dict, seed: int, progress: Callable[[str], None]) -> None:
    keys = ("lockstep.identical", "faults.handled")
    if importlib.util.find_spec("qi") is None:
        for key in keys:
            figures[key], reasons[key] = None, "qi is not installed (extra nao)"
        return
    from experiments.benchmarks import nao_failures, nao_lockstep

    progress("lock-step over libqi, and the table of faults")
    figures["lockstep.identical"] = int(nao_lockstep.lockstep_identical(seed))
    handled: Iterable[bool] = nao_failures.failures(seed).values()
    figures["faults.handled"] = float(np.mean(list(handled)))
