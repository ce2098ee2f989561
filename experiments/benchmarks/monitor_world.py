"""The product's policies in the simulated world: vision, planner and robot as they are, profiles
as measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from experiments import shipped
from experiments.comparing import bootstrap, share_of_first
from experiments.hindsight import hindsight
from experiments.racing import race
from monitor.choosing import Chosen, tuned_division
from monitor.missions import Value
from monitor.robots.briefing import QUICK as BRIEF
from monitor.robots.briefing import Briefing, Effort, brief
from monitor.robots.grid_missions import GridMission, read_mission

Floats = NDArray[np.float64]
VALUES = (
    Value("linear", 100.0, 300.0),
    Value("soft", 100.0, 85.0),
    Value("hard", 100.0, 110.0),
)
POLICIES = ("optimal", "table", "expected", "paper", "fixed")
SHORTEST = 120.0  # cells between the start and goal of a pair


@dataclass(frozen=True)
class Size:
    """missions: of each policy in a cell. further: of the product's policy alone, to hold its
    promise against. pairs: of start and goal in the cell of many. raced: whether the fixed division
    is raced, besides being tuned on the missions of calibration. hindsight: seeds for which it is
    searched, each with so many candidates. effort: of a briefing, unless it is the usual one."""

    missions: int
    further: int
    pairs: int
    raced: bool
    hindsight: int
    candidates: int = 300
    effort: Effort | None = None


STANDARD = Size(missions=200, further=300, pairs=5, raced=True, hindsight=3)
QUICK = Size(missions=30, further=0, pairs=1, raced=False, hindsight=0, effort=BRIEF)
CELLS = [(value.kind, many) for many in (False, True) for value in VALUES]


@dataclass(frozen=True)
class Cell:
    """Net values on the same seeds by policy; of the product's on these and on further ones, and
    what it promised for each; hindsight's net values for the first of them."""

    nets: dict[str, Floats]
    achieved: Floats
    promised: Floats
    hindsight: Floats
    chosen: tuple[str, ...]


def live_cell(kind: str, many: bool, size: Size, seed: int) -> Cell:
    """Live a cell: a kind of task value, with one or many pairs of start and goal."""
    value = next(value for value in VALUES if value.kind == kind)
    grid = read_mission(shipped.mission_path())
    grid = replace(grid, mission=replace(grid.mission, value=value))
    grids = _pairs(grid, size.pairs, seed) if many else [grid]
    parts = [_live(pair, seed, len(grids), size) for pair in grids]
    return Cell(
        {name: np.concatenate([part.nets[name] for part in parts]) for name in POLICIES},
        np.concatenate([part.achieved for part in parts]),
        np.concatenate([part.promised for part in parts]),
        np.concatenate([part.hindsight for part in parts]),
        tuple(name for part in parts for name in part.chosen),
    )


def _live(grid: GridMission, seed: int, pairs: int, size: Size) -> Cell:
    """Live the share of one of so many pairs."""
    each, further = -(-size.missions // pairs), -(-size.further // pairs)
    first = seed * (each + further)
    seeds = range(first, first + each)
    briefing = _with_fixed(
        brief(grid, shipped.profiles(), size.effort), raced=size.raced and pairs == 1
    )
    optimal = briefing.monitor("optimal")
    assert isinstance(optimal.policy, Chosen)
    monitors = {"optimal": optimal, "paper": briefing.monitor("paper")}
    monitors["fixed"] = briefing.monitor("fixed")
    for name in ("table", "expected"):  # as the choice was among, made once
        monitors[name] = replace(optimal, policy=optimal.policy.policies[name], name=name)
    reports = {name: [briefing.live(monitors[name], seed) for seed in seeds] for name in POLICIES}
    known = [
        hindsight(briefing, seed, [lived[index] for lived in reports.values()], size.candidates)
        for index, seed in enumerate(seeds[: size.hindsight if pairs == 1 else 0])
    ]
    nets = {name: np.array([report.net for report in lived]) for name, lived in reports.items()}
    more = [briefing.live(optimal, seed) for seed in range(first + each, first + each + further)]
    lived = [*reports["optimal"], *more]
    return Cell(
        nets,
        np.array([report.net for report in lived]),
        np.array([report.promised for report in lived]),
        np.array(known),
        (optimal.policy.verdict.name,),
    )


def _with_fixed(briefing: Briefing, raced: bool) -> Briefing:
    """With the fixed division that is hardest to beat: raced, else tuned by missions of
    calibration."""
    mission = briefing.grid.mission
    if raced:
        best = race(briefing)
        fixed = {"see": best.see, "find_path": best.find_path, "speed": best.speed}
    else:
        tuned = tuned_division(briefing.program, mission, briefing.lived)
        if tuned is None:
            raise AnytimeError(f"no mission of {mission.name!r} reached its goal")
        fixed = {**tuned.decision.shares, "speed": tuned.decision.speed}
    grid = replace(briefing.grid, mission=replace(mission, fixed=fixed))
    return replace(briefing, grid=grid)


def _pairs(grid: GridMission, count: int, seed: int) -> list[GridMission]:
    """The mission between other places of its floor, the task value stretched with the way."""
    rng = np.random.default_rng([seed, 4])
    cells = np.argwhere(grid.scene.free)
    own = grid.scene.optimal
    found: list[GridMission] = []
    while len(found) < count:
        start, goal = (
            (int(row), int(column)) for row, column in cells[rng.integers(len(cells), size=2)]
        )
        scene = replace(grid.scene, start=start, goal=goal)
        if not SHORTEST <= scene.optimal < np.inf:
            continue
        value = grid.mission.value
        stretched = replace(value, seconds=value.seconds * scene.optimal / own)
        found.append(replace(grid, scene=scene, mission=replace(grid.mission, value=stretched)))
    return found


def world_figures(
    cells: Mapping[tuple[str, bool], Cell], size: Size
) -> tuple[dict[str, float | int | None], dict[str, object]]:
    """Figures under `world.`, `promise_error`, and the settings; cells: of `CELLS`.

    A gap is what a policy's mean lacks to that of the best policy of the cell, as a share of it;
    `world.gap.POLICY` is the greatest over the cells. A margin is over the fixed division, in the
    cell with one pair; those with many are under `world.CELL`.
    """
    figures: dict[str, float | int | None] = {}
    gaps: dict[str, list[float]] = {name: [] for name in POLICIES}
    errors: list[float] = []
    settings: dict[str, object] = {
        "missions_a_cell": size.missions,
        "missions_of_a_promise": size.missions + size.further,
        "pairs": size.pairs,
    }
    for (kind, many), cell in cells.items():
        name = f"{kind}_{'many' if many else 'one'}"
        figures |= _cell_figures(cell, f"world.{name}", gaps, errors)
        settings[f"{name}.chosen"] = list(cell.chosen)
        margin = bootstrap([cell.nets["optimal"], cell.nets["fixed"]], share_of_first)
        where = f"world.{name}.margin_fixed" if many else f"world.margin_fixed.{kind}"
        figures |= margin.under(where)
    for name, found in gaps.items():
        figures[f"world.gap.{name}"] = max(found)
    figures["promise_error"] = max(errors)
    figures["promise_error_mean"] = float(np.mean(errors))
    return figures, settings


def _cell_figures(
    cell: Cell, key: str, gaps: dict[str, list[float]], errors: list[float]
) -> dict[str, float | int | None]:
    figures: dict[str, float | int | None] = {}
    means = {name: float(nets.mean()) for name, nets in cell.nets.items()}
    best = max(means, key=lambda name: means[name])
    for name, nets in cell.nets.items():
        lost = bootstrap([cell.nets[best], nets], share_of_first)
        figures[f"{key}.value.{name}"] = means[name]
        figures |= lost.under(f"{key}.gap.{name}")
        gaps[name].append(lost.value)
    promised = float(cell.promised.mean())
    errors.append(abs(float(cell.achieved.mean()) - promised) / promised)
    figures[f"{key}.promised"] = promised
    figures[f"{key}.promise_error"] = errors[-1]
    # What the mean of so many missions is off in any case, nineteen times of twenty.
    chance = 1.96 * float(cell.achieved.std()) / np.sqrt(len(cell.achieved))
    figures[f"{key}.promise_error_by_chance"] = float(chance) / promised
    if len(cell.hindsight):
        figures[f"{key}.value.hindsight"] = float(cell.hindsight.mean())
        known = cell.nets["optimal"][: len(cell.hindsight)]
        figures |= bootstrap([cell.hindsight, known], share_of_first).under(f"{key}.gap_hindsight")
    return figures
