"""What a NAO thinks with: it listens to its sonars and goes on improving its plan. [PRP16] §4."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import anytime
import compiler
from planners.nao import Body
from planners.nao_plan import MOST_OBSTACLES, plan, plan_world
from planners.query import Operators, Query, Solution
from sensing.sonar import Surroundings
from sensing.sonar_map import Recorded, SonarMap, listenings, obstacles, sonar_map

GRAIN = 4
"""Generations between two looks at the robot."""

WORTH = 1e-4
"""Metres by which a plan must be better to be registered."""


@dataclass(frozen=True)
class Planning:
    """How a NAO's plans are sought, and how they are judged.

    operators, population: of the query. collision, effort: of `planners.nao_plan.plan_world`.
    """

    operators: Operators = field(default_factory=Operators)
    population: int = 60
    collision: str = "stops"
    effort: float = 0.005

    @classmethod
    def paper(cls) -> Planning:
        """The way of [PRP16] §2, §3. It prints no size of the population: of those tried, 4,000
        does what it tells, a plan after half a second, converged not then and after 3 s."""
        return cls(Operators.paper(), 4000, "paper")


@dataclass(frozen=True, eq=False)
class Errand:
    """Where a NAO is to go, and the search for its plan.

    search: gives the query; a robot's goes on from frame to frame. world: what a plan is simulated
    in now, given what was heard. attend: called every few generations, so that the body's next
    action begins when the last has ended.
    """

    search: Callable[[], Query]
    world: Callable[[SonarMap], Mapping[str, Any]]
    attend: Callable[[], None] = lambda: None


@dataclass(frozen=True, eq=False)
class ErrandProblem:
    """A goal behind obstacles that the sonars of a NAO tell of, and what really stands there."""

    name: str
    sonar: Recorded
    truth: Surroundings
    errand: Errand
    world: Mapping[str, Any]


def errands(rng: np.random.Generator, count: int = 30) -> Iterator[ErrandProblem]:
    """Problems to measure the program on: NAO stands before one to three discs, its goal is a metre
    and a half ahead."""
    for number, listening in enumerate(listenings(rng, count)):
        goal, pose = (1.5, 0.0), listening.sonar.readings[0].pose_in_world
        told = _discs([list(circle) for circle in listening.truth.circles], Body())
        truth = plan_world(goal, pose=pose, posture="Stand", obstacles=told)

        def world(heard: SonarMap, goal: Any = goal, pose: Any = pose) -> dict[str, Any]:
            discs = _discs(obstacles(heard).tolist(), Body())
            return plan_world(goal, pose=pose, posture="Stand", obstacles=discs)

        seed = int(rng.integers(2**62))
        errand = Errand(lambda truth=truth, seed=seed: new_query(truth, seed), world)
        yield ErrandProblem(f"errand {number}", listening.sonar, listening.truth, errand, truth)


def _discs(circles: list[list[float]], body: Body) -> list[tuple[float, float, float]]:
    """The nearest obstacles, grown by the robot's radius."""
    return [(x, y, r + body.radius) for x, y, r in circles[:MOST_OBSTACLES]]


def _true_cost(solution: Solution, problem: ErrandProblem) -> float:
    return max(0.0, plan.replay(solution.choices, problem.world))


@anytime.module(cost=_true_cost, problems=errands, name="find_plan")
def find_plan(errand: Errand, heard: SonarMap) -> Iterator[Solution | None]:
    """Improve the plan in the newest world; an evaluation is a unit of work."""
    query = errand.search()
    query.world.update(errand.world(heard))
    best = float("inf")
    while True:
        query.step(GRAIN)
        anytime.charge(GRAIN * query.size)
        errand.attend()
        found = query.value
        better = found < best - WORTH
        yield query.best if better else None
        best = found if better else best


@compiler.program
def improve(sonar, errand):
    """Listen, and plan with what was heard."""
    return find_plan(errand, sonar_map(sonar))


def new_query(world: Mapping[str, Any], seed: int, planning: Planning | None = None) -> Query:
    """The search of a mission."""
    planning = planning or Planning()
    return Query(
        plan, world, population=planning.population, seed=seed, operators=planning.operators
    )
