"""[PRP16] in motion: plans that are searched for in a world that changes, and a robot that executes
its plan while it is still being improved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from experiments.reproduction.animations import (
    Animated,
    Animation,
    Disc,
    Moment,
    lines,
    places,
    save,
)
from experiments.reproduction.missions import live, lived, second_run
from experiments.reproduction.searches import (
    APPEARS,
    AROUND,
    LATE,
    MOVING_GOAL,
    REMOVED_EARLY,
    REMOVED_LATE,
    Scene,
    Search,
)
from experiments.reproduction.ways import OURS, PAPER
from experiments.shipped import DATA
from monitor.reports import Report
from monitor.robots import nao_scenes

_TICK = 0.1  # seconds of search between two moments
SEARCHES = (
    ("around", AROUND, "Fig. 1: an obstacle in the way"),
    ("moving", MOVING_GOAL, "The goal moves, 10 cm/s"),
    ("removed-early", REMOVED_EARLY, "The obstacle goes after 0.5 s"),
    ("removed-late", REMOVED_LATE, "The obstacle goes after 3 s"),
    ("appears", APPEARS, "An obstacle appears after 0.5 s"),
)
"""By name: what changes in the world, and its title."""
_BESIDE = 0.35  # metres round what is shown


def animate(folder: Path, seed: int) -> tuple[Animated, ...]:
    """The searches of §4, in the paper's way and in ours; and missions: that of Fig. 1, the second
    run in both ways, and one with a fall."""
    searched = [search(folder, seed, *each) for each in SEARCHES]
    sits, falls = (shipped(name, seed) for name in ("sitting", "fall"))
    second = second_run(seed)
    return (
        *searched,
        mission(folder, "walks", sits, live(sits, OURS)[1], "Fig. 1: the robot walks"),
        mission(folder, "second-paper", second, lived(seed, PAPER)[1], "Second run, paper's way"),
        mission(folder, "second-ours", second, lived(seed, OURS)[1], "Second run, our way"),
        mission(folder, "falls", falls, live(falls, OURS)[1], "A fall"),
    )


def shipped(name: str, seed: int) -> nao_scenes.Scene:
    """A scene that ships, with another seed."""
    return nao_scenes.read_scene(DATA / "scenes" / f"{name}.toml", seed=seed)


def search(folder: Path, seed: int, name: str, scene: Scene, title: str) -> Animated:
    """Where the best plan so far leads, in both ways, while the world changes."""
    searches = [Search(seed, way, scene) for way in (PAPER, OURS)]
    moments: list[Moment] = []
    while not moments or moments[-1].at < 2 * LATE:
        at = _TICK * (1 + len(moments))
        for each in searches:
            each.until(at)
        there = searches[0].query.world
        discs = there["obstacles"][: there["obstacle_count"]].tolist()
        found = tuple(places((pose.x, pose.y) for pose in each.poses()) for each in searches)
        moments.append(
            Moment(
                round(at, 2),
                found,
                (round(float(there["goal_x"]), 4), float(there["goal_y"])),
                tuple((x, y, round(r, 4)) for x, y, r in discs),
            )
        )
    shown = Animation(
        title,
        "m",
        "s of search",
        (-0.3, -0.6, 1.8, 0.6),
        lines("the paper's operators", "ours"),
        tuple(moments),
    )
    caption = (
        f"{title}: where the best plan so far leads, seed {seed}. The robot sits at (0, 0); the "
        "obstacle is as large as the plans that the paper prints allow."
    )
    return save(shown, folder, "nao", f"search-{name}", caption)


def mission(
    folder: Path, name: str, scene: nao_scenes.Scene, report: Report, title: str
) -> Animated:
    """A mission, moment by moment: the ends of its frames, and what happened in each."""
    moments: list[Moment] = []
    walked: list[Sequence[float]] = []
    for frame in report.frames:
        motion = frame.story["motion"]
        walked += motion["track"]
        happened = [what for _, what in motion["events"]]
        taken = [one for one in motion["comparisons"] if one["taken"]]
        if taken:
            happened.append("begins a plan" if taken[-1]["idle"] else "switches to a better plan")
        x, y, heading = motion["track"][-1]
        moments.append(
            Moment(
                round(frame.ended, 2),
                (places(motion["track"]), places(motion["plan"])),
                _rounded(motion["goal"]),
                tuple(_there(scene, frame.ended)),
                tuple((round(x, 3), round(y, 3), round(r, 3)) for x, y, r in motion["discs"]),
                robot=(round(x, 4), round(y, 4), round(heading, 3), motion["radius"]),
                said=", ".join(happened),
            )
        )
    shown = Animation(
        title,
        "m",
        "s of mission",
        _box([*walked, *(moment.goal for moment in moments if moment.goal)]),
        lines("walked", "plan in execution", growing="walked"),
        tuple(moments),
    )
    caption = (
        f"{title}, seed {scene.seed}: {report.ending.value} after {report.seconds:.1f} s. Filled: "
        "obstacles; rings: what is believed of them."
    )
    return save(shown, folder, "nao", f"mission-{name}", caption)


def _there(scene: nao_scenes.Scene, time: float) -> list[Disc]:
    """The scene's round obstacles at a time."""
    return [
        (*_rounded(obstacle.at), obstacle.radius)
        for obstacle in scene.obstacles
        if obstacle.radius is not None and obstacle.appears <= time < obstacle.vanishes
    ]


def _rounded(place: Sequence[float]) -> tuple[float, float]:
    return round(float(place[0]), 4), round(float(place[1]), 4)


def _box(points: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """All that is shown, and a little beside it."""
    xs, ys = ([point[axis] for point in points] for axis in (0, 1))
    sides = min(xs) - _BESIDE, min(ys) - _BESIDE, max(xs) + _BESIDE, max(ys) + _BESIDE
    left, lower, right, upper = (math.floor(10 * side) / 10 for side in sides)
    return left, lower, right, upper
