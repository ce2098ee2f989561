"""The pictures of [PRP16]: plans that are found, and what one is worth while it is executed."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from anytime.pictures import COLOURS
from experiments.reproduction.executions import (
    AFTER_STAND,
    END,
    MOST,
    STEP,
    ahead,
    obstacle_step,
    surprised,
)
from experiments.reproduction.pictures import STYLES, Picture, new_figure, save
from experiments.reproduction.searches import (
    AROUND,
    GOAL,
    INITIAL,
    LATE,
    MOVING_GOAL,
    REMOVED_EARLY,
    REMOVED_LATE,
    Search,
    printed_disc,
)
from experiments.reproduction.ways import OURS, PAPER

_DRAWS = 15
_SEARCHES = 5
_FOUND = (
    (AROUND, "An obstacle"),
    (MOVING_GOAL, "The goal moves, 10 cm/s"),
    (REMOVED_EARLY, "It goes after 0.5 s"),
    (REMOVED_LATE, "It goes after 3 s"),
)


def draw(folder: Path, seed: int) -> tuple[Picture, ...]:
    """Draw the plans of Fig. 1 and of the searches of §4, and the objective of Fig. 2."""
    return plans(folder, seed), objective(folder, seed)


def plans(folder: Path, seed: int) -> Picture:
    """Where the best plans lead at the end of each search, in both ways."""
    from matplotlib.patches import Circle

    figure, panels = new_figure(11, 2.6, columns=len(_FOUND))
    for axes, (scene, title) in zip(panels, _FOUND, strict=True):
        for place, (way, label) in enumerate(((PAPER, "the paper's operators"), (OURS, "ours"))):
            for draw in range(_SEARCHES):
                search = Search(seed + draw, way, scene).until(2 * LATE)
                poses = search.poses()
                style: dict[str, Any] = {"color": COLOURS[place], "linestyle": STYLES[place]}
                xs, ys = [pose.x for pose in poses], [pose.y for pose in poses]
                axes.plot(xs, ys, linewidth=1.0, alpha=0.7, label="" if draw else label, **style)
        x, y, radius = printed_disc()
        gone = scene.vanishes < math.inf
        disc = {"facecolor": "none" if gone else "0.75", "linestyle": ":" if gone else "-"}
        axes.add_patch(Circle((x, y), radius, edgecolor="0.4", **disc))
        goal = GOAL[0] + scene.moves * 2 * LATE
        axes.plot(goal, 0.0, "P", color=COLOURS[2], markersize=8)
        axes.set(title=title, xlabel="ahead [m]", ylim=(-0.6, 0.6), xlim=(-0.15, 1.8))
        axes.set_aspect("equal")
    panels[0].set_ylabel("aside [m]")
    panels[2].legend(frameon=False, loc="lower center", fontsize=8)
    caption = (
        f"[PRP16] Fig. 1 and §4: where the best plan leads after {2 * LATE:g} s of search, "
        f"{_SEARCHES} draws in each way. Cross: the goal; grey: an obstacle; dotted: one that has "
        "gone. The robot sits at (0, 0)."
    )
    return save(figure, folder, "nao", "plans", caption)


def objective(folder: Path, seed: int) -> Picture:
    """What a plan in execution is worth: with the drift of standing up unknown and learnt, and when
    an obstacle appears, by the paper's rule and by ours.

    Of a few draws, each that which is the median in the paper's way.
    """
    ahead_seed, surprised_seed = (_median(claim, seed) for claim in (_end, _step))
    figure, (runs, steps) = new_figure(10, 3.8, columns=2)
    for way, label, style in ((PAPER, "drift unknown", "-"), (OURS, "drift learnt", "--")):
        run = ahead(ahead_seed, way)
        colour = COLOURS[0 if way is PAPER else 1]
        runs.plot(run.times, run.objective["paper"], style, color=colour, label=label)
        runs.plot(run.times[run.stood], run.objective["paper"][run.stood], "o", color=colour)
    levels = {"before": INITIAL, "after Stand": AFTER_STAND, "at the end": END, "never above": MOST}
    for name, level in levels.items():
        runs.axhline(level, color="0.6", linewidth=0.8, linestyle=":")
        runs.annotate(f"{name} {level}", (0.0, level), va="bottom", fontsize=8, color="0.35")
    runs.set(title="A plan in execution (o: it stands)", ylim=(0, None))
    run = surprised(surprised_seed)
    for rule, label, style in (
        ("paper", "at the obstacle's place (paper)", "-"),
        ("stops", "where it touches, and a fall (ours)", "--"),
    ):
        colour = COLOURS[0 if rule == "paper" else 1]
        steps.plot(run.times, run.objective[rule], style, color=colour, label=label)
    before = float(run.objective["paper"][run.seen - 1])
    steps.axhline(before + STEP, color="0.6", linewidth=0.8, linestyle=":")
    steps.annotate(
        f"the paper's step +{STEP}", (0.0, before + STEP), va="bottom", fontsize=8, color="0.35"
    )
    highest = max(float(values.max()) for values in run.objective.values())
    steps.set(title="An obstacle appears", ylim=(0, 1.35 * max(highest, before + STEP)))
    for axes in (runs, steps):
        axes.set(xlabel="time since it began [s]", ylabel="objective [m]")
    runs.legend(frameon=False, loc="lower right")
    steps.legend(frameon=False, loc="upper left")
    caption = (
        "[PRP16] §4 and Fig. 2, the objective of a plan in execution: standing up turns the robot, "
        f"and an obstacle appears. Of {_DRAWS} draws each, the one in the middle."
    )
    return save(figure, folder, "nao", "objective", caption)


def _median(figure: Callable[[int], float], seed: int) -> int:
    """The seed whose figure is in the middle."""
    return sorted(range(seed, seed + _DRAWS), key=figure)[_DRAWS // 2]


def _end(seed: int) -> float:
    """What the plan is worth at its end."""
    return float(ahead(seed, PAPER).objective["paper"][-1])


def _step(seed: int) -> float:
    """By how much the obstacle raises it."""
    return obstacle_step(seed, PAPER)[0]
