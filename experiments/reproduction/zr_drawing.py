"""The figures of [ZR93], drawn from our own runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anytime.pictures import COLOURS
from experiments.domains import MACHINE
from experiments.reproduction.abstraction import (
    FAMILY,
    FLOORS,
    IMPERFECT,
    SIZE,
    Course,
    course,
    median_floor,
    mixed,
)
from experiments.reproduction.dividing import DOMAINS, SECONDS, VISION, divided
from experiments.reproduction.looking import qualities
from experiments.reproduction.pictures import Picture, curve, new_figure, save
from experiments.reproduction.ways import OURS, PAPER
from planners import textbook_astar
from planners.avoidance import blind_walk
from planners.multipath import MultiPath

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LIBRARIES = 5  # of Fig. 7 and 8, each of as many domains as a draw has
_TITLES = ("Level 3", "Levels 1 and 0")
_WAYS = ((PAPER, "the paper's planner"), (OURS, "ours"))


def draw(folder: Path, seed: int) -> tuple[Picture, ...]:
    """Draw Fig. 2 and 4 to 8 of the paper."""
    return (
        _vision(folder, seed),
        _plans(folder, seed),
        _planner(folder, seed),
        _noisy_plans(folder, seed),
        *_profiles(folder, seed),
    )


def _vision(folder: Path, seed: int) -> Picture:
    figure, (axes,) = new_figure(5.2, 3.4)
    for place, (way, label) in enumerate(((PAPER, "the paper's sensor"), (OURS, "camera"))):
        seen = np.array([qualities(one, way.device) for one in range(seed, seed + FLOORS)])
        times = MACHINE.seconds("see", 1.0) * np.arange(1, seen.shape[1] + 1)
        there = ~np.isnan(seen[0])
        curve(axes, place, times[there], seen[:, there], label)
        axes.plot(times[there][0], seen[:, there][:, 0].mean(), "o", color=COLOURS[place])
    axes.set(xlabel="run-time [s]", ylabel="quality of vision", xlim=(0, None), ylim=(0.5, 1.005))
    axes.legend(frameon=False, loc="lower right")
    caption = (
        f"Fig. 2, the profile of vision: share of cells told rightly, mean of {FLOORS} looks with "
        "its 95 % interval. o: Ta, before which there is no description."
    )
    return save(figure, folder, "zr", "fig2-vision", caption)


def _plans(folder: Path, seed: int) -> Picture:
    index = median_floor(seed)
    found = course(index, PAPER)
    place = mixed(found)
    figure, panels = new_figure(8.4, 4.5, columns=2)
    chosen = (0, place if place is not None else len(found.plans) - 1)
    for axes, at, title in zip(panels, chosen, _TITLES, strict=True):
        _on_map(axes, found, at, title)
    caption = (
        "Fig. 4, plans with perfect vision: cells of the plan (broken squares) and the way that a "
        f"robot walks that knows nothing but the plan. Of {FLOORS} floors, the one whose level 3 "
        "plan is the median."
    )
    return save(figure, folder, "zr", "fig4-plans", caption)


def _noisy_plans(folder: Path, seed: int) -> Picture:
    found = course(median_floor(seed), PAPER, IMPERFECT)
    place = mixed(found)
    figure, panels = new_figure(8.4, 4.5, columns=2)
    chosen = (0, place if place is not None else len(found.plans) - 1)
    for axes, at, title in zip(panels, chosen, _TITLES, strict=True):
        _on_map(axes, found, at, title)
    caption = (
        f"Fig. 6, plans on the same floor, seen with a quality of {IMPERFECT.vision:g}. Drawn is "
        "the true floor, on which the robot walks."
    )
    return save(figure, folder, "zr", "fig6-noisy-plans", caption)


def _on_map(axes: Axes, found: Course, place: int, title: str) -> None:
    from matplotlib.patches import Rectangle

    plan: MultiPath = found.plans[place]
    axes.imshow(~found.free, cmap="Greys", vmax=2.2, interpolation="nearest", origin="lower")
    for level, row, column in plan.plan.tolist():
        side = 1 << level
        corner = (column * side - 0.5, row * side - 0.5)
        edge: dict[str, Any] = {"edgecolor": COLOURS[0], "linestyle": "--", "linewidth": 0.9}
        if not level:
            edge = {"edgecolor": "none", "facecolor": COLOURS[0], "alpha": 0.55}
        axes.add_patch(Rectangle(corner, side, side, **{"fill": not level, **edge}))
    walked = blind_walk(found.free, plan.plan, found.start, found.goal).cells
    axes.plot(walked[:, 1], walked[:, 0], color=COLOURS[3], linewidth=1.6)
    axes.set(title=f"{title}: quality {found.quality[place]:.3f}", xlabel="column [cells]")
    axes.set_ylabel("row [cells]")


def _planner(folder: Path, seed: int) -> Picture:
    shares = np.linspace(0.0, 1.2, 241)
    figure, (axes,) = new_figure(5.2, 3.4)
    for place, (way, label) in enumerate(_WAYS):
        samples = [_by_share(course(one, way), shares) for one in range(seed, seed + FLOORS)]
        curve(axes, place, shares, np.array(samples), label)
    axes.plot(0.27, 0.93, "D", color="black", markersize=5, label="printed: 0.93 at 27 %")
    axes.set(xlabel="expansions / those of A*", ylabel="expected quality of the plan")
    axes.set(xlim=(0, 1.2), ylim=(0.5, 1.005))
    axes.legend(frameon=False, loc="lower right")
    caption = (
        f"Fig. 5, the planner's profile with perfect vision: mean of {FLOORS} floors of {SIZE} × "
        f"{SIZE} cells, {int(FAMILY[1:])} % blocked, with its 95 % interval; no plan counts 0."
    )
    return save(figure, folder, "zr", "fig5-planner", caption)


def _by_share(found: Course, shares: np.ndarray) -> list[float]:
    textbook = textbook_astar(found.free, found.start, found.goal)
    assert textbook is not None  # instances are connected
    return [found.best(share * textbook.expansions) for share in shares.tolist()]


def _profiles(folder: Path, seed: int) -> tuple[Picture, Picture]:
    times = np.linspace(0.0, 0.6 * SECONDS, 181)
    libraries = [divided(one, PAPER) for one in range(seed, seed + _LIBRARIES)]
    conditional, (axes,) = new_figure(5.2, 3.4)
    curves = np.array([found.curves(times) for found in libraries])
    for place, quality in enumerate(VISION):
        curve(axes, place, times, curves[:, place], f"vision {quality:g}")
    axes.set(xlabel="run-time of planning [s]", ylabel="expected quality of the plan")
    axes.set(xlim=(0, times[-1]), ylim=(0.6, 1.0))
    axes.legend(frameon=False, loc="lower right", reverse=True)
    many = f"mean of {_LIBRARIES} samples of {DOMAINS} domains, with its 95 % interval"
    first = save(
        conditional,
        folder,
        "zr",
        "fig7-conditional",
        f"Fig. 7, the conditional profile of the planner, by the quality of vision: {many}.",
    )
    compiled, (axes,) = new_figure(5.2, 3.4)
    longest = min(float(found.budgets[-1]) for found in libraries)
    budgets = np.linspace(0.0, longest, 200)
    drawn: Sequence[tuple[str, list[np.ndarray]]] = (
        ("compiled", [np.interp(budgets, f.budgets, f.divided(), left=0.0) for f in libraries]),
        ("MIN", [np.interp(budgets, f.budgets, f.pinned()[0], left=0.0) for f in libraries]),
        ("MAX", [np.interp(budgets, f.budgets, f.pinned()[1], left=0.0) for f in libraries]),
    )
    for place, (label, samples) in enumerate(drawn):
        curve(axes, place, budgets, np.array(samples), label)
    axes.set(xlabel="run-time of vision and planning [s]", ylabel="expected quality of the plan")
    axes.set(xlim=(0, longest), ylim=(0.0, 1.0))
    axes.legend(frameon=False, loc="lower right")
    caption = f"Fig. 8, vision and planning compiled, and with vision pinned to Ta and Tb: {many}."
    return first, save(compiled, folder, "zr", "fig8-compiled", caption)
