"""A query as an anytime module: what it registers, what it charges, and its conditional profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import anytime
import compiler
from anytime import Deadline, Machine, WorkClock
from planners import query
from planners.nao_plan import plan, plan_world

MACHINE = Machine("slow").with_rate("look", 0.05).with_rate("find_plan", 1e-5)


@dataclass(frozen=True)
class Errand:
    goal: tuple[float, float]
    truth: tuple[float, float, float]
    looks: list[tuple[float, float, float]]


def errands(count: int) -> list[Errand]:
    rng = np.random.default_rng(1)
    made = []
    for _ in range(count):
        x, y = rng.uniform(0.4, 0.6), rng.uniform(-0.1, 0.1)
        looks = [(x + rng.normal(0, s), y + rng.normal(0, s), 0.2) for s in (0.15, 0.05, 0.0)]
        made.append(Errand((1.0, 0.0), (x, y, 0.2), looks))
    return made


@anytime.module(quality=lambda disc, errand: 1 - min(1.0, 4 * abs(disc[0] - errand.truth[0])))
def look(looks):
    yield from looks


def world(obstacle, goal):
    return plan_world(goal, obstacles=[obstacle])


def worth(solution, errand):
    cost = plan.replay(solution.choices, world(errand.truth, errand.goal))
    return float(np.clip((1.0 - cost) / 0.89, 0.0, 1.0))


find_plan = query.module(plan, world, quality=worth)


@compiler.program
def go(looks, goal):
    return find_plan(look(looks), goal)


def test_each_better_solution_is_registered_and_each_evaluation_charged():
    clock = WorkClock(MACHINE)
    kept = []
    result = anytime.run(
        find_plan,
        *((0.5, 0.0, 0.2), (1.0, 0.0)),
        deadline=Deadline.after(0.2, clock),
        on_result=lambda value, change: kept.append((value.value, change.work)),
    )
    values, work = zip(*kept, strict=True)
    assert list(values) == sorted(values, reverse=True)
    assert all(amount % 90 == 0 for amount in work)
    assert result.value.value == values[-1]
    assert result.work <= 0.2 / 1e-5 + 90


def test_its_profile_depends_on_the_map_and_may_fall_on_a_wrong_one():
    library = anytime.measure(go, errands(12), seconds=0.3, clock=lambda: WorkClock(MACHINE))
    profile = library["find_plan"]
    times = [0.01, 0.05, 0.1, 0.3]
    exact, wrong = profile.given(obstacle=1.0), profile.given(obstacle=0.6)
    assert exact.mean(0.3) > 0.95
    assert exact.quantile(0.1, 0.3) > 0.9
    assert wrong.mean(times, as_measured=True)[-1] < exact.mean(times)[-1]
    assert min(np.diff(wrong.mean(times))) >= 0
    assert max(wrong.mean(times, as_measured=True)) >= wrong.mean(times, as_measured=True)[-1]
    compiled = compiler.compile(go, library)
    assert sum(compiled.allocate(0.25).shares.values()) <= 0.25 + 1e-9
