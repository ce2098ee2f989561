"""What a knob is worth: weighted A* with its weight set for each budget, or kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime import Machine, Module, WorkClock, measure
from compiler import CompiledProgram, compile
from experiments.comparing import bootstrap
from planners.path_finding import Cell, astar
from planners.weighted import find_path
from sensing.random_maps import corner_to_corner, uniform

SIDE, DENSITY, FLOORS = 96, 0.3, 60
RATE = 1e-4  # seconds a node expansion
BUDGETS = np.geomspace(0.02, 0.6, 12)


@dataclass(frozen=True, eq=False)
class Floor:
    """A floor and a way across it, in cells."""

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    shortest: float


def knob_figures(seed: int) -> dict[str, float | int | None]:
    """Figures under `knob.`: mean quality over budgets on floors never seen, of the program with
    the knob and of the best weight kept for all budgets; the difference, paired, with interval.
    """
    known, unseen = (_floors(np.random.default_rng([seed, 6, part])) for part in (0, 1))
    library = measure(find_path, known, seconds=10.0, clock=_clock)

    def lived(module: Module) -> NDArray[np.float64]:
        program = compile(module, library)
        return np.array([_achieved(program, floor) for floor in unseen])

    values = lived(find_path)
    kept = {setting.chosen["weight"]: lived(setting) for setting in find_path.settings()}
    best = max(kept, key=lambda weight: float(kept[weight].mean()))
    margin = bootstrap([values, kept[best]], lambda ours, theirs: ours - theirs)
    return {
        "knob.value": float(values.mean()),
        "knob.best_kept": float(kept[best].mean()),
        "knob.best_weight": best,
        **margin.under("knob.margin"),
    }


def _clock() -> WorkClock:
    return WorkClock(Machine("bench").with_rate("find_path", RATE))


def _floors(rng: np.random.Generator) -> list[Floor]:
    found: list[Floor] = []
    while len(found) < FLOORS:
        free = uniform(SIDE, DENSITY, rng)
        start, goal = corner_to_corner(free)
        way = astar(free, start, goal)
        if way is not None:
            found.append(Floor(free, start, goal, way.length))
    return found


def _achieved(program: CompiledProgram, floor: Floor) -> float:
    """Mean over budgets of shortest / found; a way that comes too late counts nothing."""
    found = []
    for budget in BUDGETS.tolist():
        run = program.run(
            budget, clock=_clock(), free=floor.free, start=floor.start, goal=floor.goal
        )
        there = run and run.elapsed <= budget
        found.append(floor.shortest / run.value.length if there else 0.0)
    return float(np.mean(found))
