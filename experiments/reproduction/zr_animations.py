"""[ZR93] in motion: a plan across a floor that is refined, and what a robot would make of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.reproduction.abstraction import FLOORS, SIZE, course, median_floor
from experiments.reproduction.animations import (
    Animated,
    Animation,
    Moment,
    bits,
    lines,
    places,
    save,
)
from experiments.reproduction.ways import OURS, PAPER
from planners.avoidance import blind_walk

_MOST = 90  # moments


def animate(folder: Path, seed: int) -> tuple[Animated, ...]:
    """The planning of Fig. 4, plan by plan, in the paper's way and in ours."""
    index = median_floor(seed)
    papers, ours = (course(index, way) for way in (PAPER, OURS))
    works = np.unique(np.concatenate([papers.work, ours.work]))
    if len(works) > _MOST:
        works = works[np.unique(np.linspace(0, len(works) - 1, _MOST).astype(int))]
    moments: list[Moment] = []
    for work in works.tolist():
        walked, way, squares, said = (), (), (), ""
        there = int(np.searchsorted(papers.work, work, side="right"))
        if there:
            plan = papers.plans[there - 1].plan
            walk = blind_walk(papers.free, plan, papers.start, papers.goal).cells
            walked = places((column + 0.5, row + 0.5) for row, column in walk.tolist())
            squares = tuple(
                (column << level, row << level, 1 << level) for level, row, column in plan.tolist()
            )
            said = f"paper's {papers.quality[there - 1]:.3f}"
        found = int(np.searchsorted(ours.work, work, side="right"))
        if found:
            cells = ours.plans[found - 1].plan[:, 1:].tolist()
            way = places((column + 0.5, row + 0.5) for row, column in cells)
            said += f"{', ' * bool(said)}ours {ours.quality[found - 1]:.3f}"
        goal = (papers.goal[1] + 0.5, papers.goal[0] + 0.5)
        moments.append(Moment(round(work), (walked, way), goal, squares=squares, said=said))
    shown = Animation(
        "Fig. 4: a plan is refined",
        "cells",
        "expansions",
        (0, 0, SIZE, SIZE),
        lines("walked by the paper's plan", "our way"),
        tuple(moments),
        bits(~papers.free),
    )
    caption = (
        "Fig. 4, plan by plan: squares are the cells of the paper's plan, on whatever level, the "
        "blue line what a robot walks that knows nothing else; and the way of our planner after "
        f"the same work. Of {FLOORS} floors, the one whose first plan is the median."
    )
    return (save(shown, folder, "zr", "plans", caption),)
