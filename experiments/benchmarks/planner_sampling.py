"""OMPL's sampling planners as anytime modules, on the same floors."""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import anytime
from anytime import Module
from experiments.benchmarks.figures import Figures, ratio_interval
from planners import astar
from planners.path_finding import Cell
from sensing import instance

SAMPLERS = ("RRTstar", "BITstar")
TIMES = 100  # how much more time than our A* they get
_SLICE = 0.01  # seconds of OMPL between two looks at its solution
_FLOORS = (("clustered", 128), ("r20", 128))
_INSTANCES = 3
_RESOLUTION = 0.2  # cells between two points of a motion that are checked


def sampling_module(name: str) -> Module:
    """A planner of OMPL as an anytime module: its result is the length of its way, in cells.

    It moves a point in the plane at any angle, so it may be shorter than ways over cells are.
    """

    @anytime.module(name=name.lower())
    def plan(free: NDArray[np.bool_], start: Cell, goal: Cell) -> Iterator[float | None]:
        base = importlib.import_module("ompl.base")
        geometric = importlib.import_module("ompl.geometric")
        importlib.import_module("ompl.util").noOutputHandler()  # it would write to stdout
        rows, columns = free.shape
        space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
        bounds.setLow(0.0)
        bounds.setHigh(float(max(rows, columns)))
        space.setBounds(bounds)
        information = base.SpaceInformation(space)

        def valid(state: object) -> bool:
            row, column = int(state[0]), int(state[1])  # type: ignore[index]
            return 0 <= row < rows and 0 <= column < columns and bool(free[row, column])

        information.setStateValidityChecker(valid)
        information.setStateValidityCheckingResolution(_RESOLUTION / np.hypot(rows, columns))
        information.setup()
        ends = [space.allocState(), space.allocState()]
        for state, cell in zip(ends, (start, goal), strict=True):
            state[0], state[1] = cell[0] + 0.5, cell[1] + 0.5
        problem = base.ProblemDefinition(information)
        problem.setStartAndGoalStates(*ends, 0.5)
        problem.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
        planner = getattr(geometric, name)(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        while True:
            planner.solve(_SLICE)
            path = problem.getSolutionPath() if problem.hasExactSolution() else None
            yield None if path is None else float(path.length())

    return plan


def sampled(seed: int) -> tuple[Figures, dict[str, str]]:
    """(figures, what is not measured): how many floors they solve in 100 times our A*'s time (at
    least 0.1 s), and the mean quality of the ways then, no way counting 0."""
    keys = [
        f"sampling.{name.lower()}.{what}" for name in SAMPLERS for what in ("solved", "quality")
    ]
    if importlib.util.find_spec("ompl") is None:
        reason = "ompl is not installed: pip install 'anytime-robots[bench]'"
        return dict.fromkeys(keys), dict.fromkeys(keys, reason)
    figures: Figures = {}
    for name in SAMPLERS:
        module, qualities = sampling_module(name), []
        for family, size in _FLOORS:
            for index in range(_INSTANCES):
                free, start, goal = instance(family, size, index, seed)
                begin = time.perf_counter()
                best = astar(free, start, goal)
                seconds = max(0.1, TIMES * (time.perf_counter() - begin))
                assert best is not None
                found = anytime.run(module, free, start, goal, seconds=seconds)
                qualities.append(best.length / found.value if found else 0.0)
        ones = np.ones(len(qualities))
        figures[f"sampling.{name.lower()}.solved"] = float(np.mean(np.array(qualities) > 0))
        figures |= ratio_interval(f"sampling.{name.lower()}.quality", qualities, ones)
    return figures, {}
