"""ARA*: bounded by its weight, better with each, the shortest at last."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime.errors import AnytimeError
from planners import Grid, ara, astar, weighted_astar
from sensing import clustered, maze, rooms, uniform

KINDS = (
    lambda rng: uniform((60, 75), 0.3, rng),
    lambda rng: clustered((60, 75), 0.3, rng),
    lambda rng: rooms((60, 75), rng),
    lambda rng: maze((60, 75), rng, corridor=2),
)


@given(st.integers(0, 2**32), st.sampled_from(KINDS), st.sampled_from([4, 8]))
@settings(max_examples=60)
def test_plans_keep_the_bound_of_their_weight_and_end_with_the_shortest(seed, kind, connectivity):
    rng = np.random.default_rng(seed)
    free = kind(rng)
    cells = np.argwhere(free)
    start, goal = (tuple(cells[i].tolist()) for i in rng.integers(len(cells), size=2))
    best = astar(free, start, goal, connectivity)
    taken = list(ara.steps(Grid.known(free), start, goal, connectivity=connectivity))
    plans = [step.plan for step in taken if step.plan is not None]
    if best is None:
        assert len(plans[-1].plan) == 0
        return
    lengths = [plan.length for plan in plans]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] == pytest.approx(best.length, rel=1e-4)
    assert lengths[0] <= ara.WEIGHTS[0] * best.length
    assert all(plan.estimate <= best.length / plan.length + 1e-4 for plan in plans)


def test_it_is_an_anytime_module():
    domain = (~uniform(64, 0.2, np.random.default_rng(1))).astype(np.float32)
    domain[0, 0] = domain[63, 63] = 0.0
    assert (
        anytime.run(ara.find_path, domain, (0, 0), (63, 63), seconds=60.0).status.name == "COMPLETE"
    )


def test_weights_must_fall():
    with pytest.raises(AnytimeError, match="must fall"):
        list(ara.steps(np.zeros((5, 5)), (0, 0), (4, 4), weights=(1.0, 2.0)))
    for weight in (0.5, float("inf"), float("nan"), "a"):
        with pytest.raises(AnytimeError, match="between 1 and 100"):
            list(ara.steps(np.zeros((5, 5)), (0, 0), (4, 4), weights=(weight,)))


@given(st.integers(0, 2**32), st.floats(1.0, 1.1))
@settings(max_examples=60)
def test_a_weight_is_a_promise_to_the_last_digit(seed, weight):
    rng = np.random.default_rng(seed)
    free = uniform((60, 75), 0.2, rng)
    cells = np.argwhere(free)
    start, goal = (tuple(cells[i].tolist()) for i in rng.integers(len(cells), size=2))
    best = astar(free, start, goal, 4)
    if best is None:
        return
    last = list(ara.steps(Grid.known(free), start, goal, weights=(weight,), connectivity=4))[-1]
    assert last.plan is not None
    assert last.plan.estimate <= best.length / max(last.plan.length, 1e-9) + 1e-9 or not best.length
    quick = weighted_astar(free, start, goal, weight, 4)
    assert quick is not None
    assert quick.length <= weight * best.length + 1e-9


def test_a_plan_on_a_map_that_has_changed_is_refused():
    rng = np.random.default_rng(0)
    grid = Grid.known(uniform(200, 0.2, rng))
    start, goal = (tuple(map(int, np.argwhere(grid.cost.reshape(200, 200))[at])) for at in (0, -1))
    planning = ara.steps(grid, start, goal)
    next(planning)
    grid.update(1, 1, rng.integers(0, 2, (190, 190)).astype(float))
    with pytest.raises(AnytimeError, match="the map has changed while a plan was made; plan anew"):
        next(planning)
