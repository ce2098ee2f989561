"""The paper's setting on floors of every kind: the compiler divides by what the floor is like."""

import numpy as np
import pytest

import compiler
from anytime import WorkClock, measure
from experiments.domains import MACHINE, anywhere, cross_anywhere, domain, floor_features
from sensing.vision import sense

EASY = {"density": 0.1, "clustering": 0.0, "distance": 95.0}
HARD = {"density": 0.15, "clustering": 0.6, "distance": 95.0}


@pytest.fixture(scope="module")
def library():
    problems = anywhere(np.random.default_rng(0), 24)
    return measure(cross_anywhere, problems, seconds=3.0, clock=lambda: WorkClock(MACHINE))


def test_an_easy_and_a_hard_floor_get_different_divisions(library):
    profile = library["plan_anywhere"]
    easy, hard = (
        compiler.compile(cross_anywhere, {**library, "plan_anywhere": profile.given(**floor)})
        for floor in (EASY, HARD)
    )
    budgets = np.arange(0.4, 2.01, 0.1)
    apart = [abs(easy.allocate(b).shares["see"] - hard.allocate(b).shares["see"]) for b in budgets]
    assert max(apart) >= 0.04


def test_features_are_those_of_the_floor_whatever_the_errors_of_sensing():
    for family in ("r10", "r30", "clustered"):
        problem = domain(family, 128, 0)
        for quality in (0.8, 0.9, 1.0):
            centre, rng = (64, 64), np.random.default_rng(1)
            sensed = sense(problem.free, centre, 128, quality, rng)
            found = floor_features(sensed, problem.start, problem.goal)
            assert abs(found["density"] - (~problem.free).mean()) < 0.1
            assert (found["clustering"] > 0.3) == (family == "clustered")
