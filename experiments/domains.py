"""The paper's setting: look at a whole random domain, then plan across it. [ZR93] §3, §4.

With the paper's planner on the paper's floors, and with ours on floors of every kind.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import anytime
import compiler
from anytime import Machine
from planners import atp, paper_atp
from planners.avoidance import blind_quality
from planners.multipath import MultiPath
from planners.path_finding import Cell, astar
from sensing import SensedMap, instance
from sensing.vision import Sensor, Vision, see

# Seconds per exposure and per expansion at which seeing well costs about as much as planning well.
MACHINE = (
    Machine("paper")
    .with_rate("see", 0.02)
    .with_rate("plan_across", 0.001)
    .with_rate("plan_anywhere", 0.0002)
)


@dataclass(frozen=True, eq=False)
class Domain:
    """A random domain with its sensor. optimal: length of the shortest way, in cells."""

    name: str
    sensor: Sensor
    start: Cell
    goal: Cell
    optimal: float

    @property
    def free(self) -> NDArray[np.bool_]:
        return self.sensor.free


def domain(
    family: str, size: int, index: int, seed: int = 0, vision: Vision | None = None
) -> Domain:
    """The domain of this family and index, corner to corner; the sensor reaches everywhere."""
    free, start, goal = instance(family, size, index, seed)
    way = astar(free, start, goal)
    assert way is not None  # instances are connected
    sensor = Sensor(free, (size // 2, size // 2), size, Vision())
    return Domain(f"{family}/{size}/{seed}/{index}", sensor, start, goal, way.length)


def probabilities(sensed: SensedMap, shape: tuple[int, int]) -> NDArray[np.float32]:
    """The probability that each cell is blocked, after one look; .5 where nothing was seen."""
    domain = np.full(shape, 0.5, np.float32)
    wrong = np.float32(1.0 - sensed.quality)
    seen = np.where(sensed.blocked, np.float32(1.0) - wrong, wrong)
    # A look is evidence and not proof: only a touched obstacle is certain.
    seen = np.minimum(seen, np.float32(0.999))
    np.copyto(domain[sensed.slices], seen, where=sensed.inside)
    return domain


@anytime.module(
    quality=lambda plan, problem: blind_quality(
        problem.free, plan.plan, problem.start, problem.goal, problem.optimal
    ),
    estimate=lambda plan: plan.estimate,
)
def plan_across(sensed: SensedMap, start: Cell, goal: Cell) -> Iterator[MultiPath | None]:
    """ATP on what was seen of the whole domain."""
    height, width = sensed.blocked.shape
    for step in paper_atp.steps(probabilities(sensed, (height, width)), start, goal):
        anytime.charge(step.work)
        yield step.plan


@compiler.program
def cross(sensor, start, goal):
    """(find-path Start Goal (get-domain-description Sensor))"""
    return plan_across(see(sensor), start, goal)


KINDS = ("r10", "r30", "rooms", "clustered")
"""Floors of `anywhere`, easy and hard."""


def anywhere(rng: np.random.Generator, count: int = 40) -> Iterator[Domain]:
    """Domains of every kind in turn, 96 cells wide."""
    seed = int(rng.integers(2**31))
    for number in range(count):
        yield domain(KINDS[number % len(KINDS)], 96, number, seed)


def floor_features(sensed: SensedMap, start: Cell, goal: Cell) -> dict[str, float]:
    """Density and clustering of the floor behind the errors of sensing, and the distance.

    With a share e of cells wrong, independently, the density p is seen as e + (1 - 2e) p, and the
    covariance of neighbours (1 - 2e)² times too small.
    """
    found = atp.features_of(sensed.blocked.astype(np.float32) * 0.99, start, goal)
    clear = max(2.0 * sensed.quality - 1.0, 0.1)
    seen = found["density"]
    density = float(np.clip((seen - (1.0 - sensed.quality)) / clear, 0.01, 0.99))
    shrunk = seen * (1.0 - seen) / (clear**2 * density * (1.0 - density))
    clustering = min(1.0, found["clustering"] * shrunk)
    return {"density": density, "clustering": clustering, "distance": found["distance"]}


@anytime.module(
    quality=lambda plan, problem: blind_quality(
        problem.free, plan.plan, problem.start, problem.goal, problem.optimal
    ),
    estimate=lambda plan: plan.estimate,
    features=floor_features,
)
def plan_anywhere(sensed: SensedMap, start: Cell, goal: Cell) -> Iterator[MultiPath | None]:
    """Our planner on what was seen; its profile is conditioned on what kind of floor that is."""
    for step in atp.steps(probabilities(sensed, sensed.blocked.shape), start, goal):
        anytime.charge(step.work)
        yield step.plan


@compiler.program
def cross_anywhere(sensor, start, goal):
    """Look, then plan, on a floor of any kind."""
    return plan_anywhere(see(sensor), start, goal)
