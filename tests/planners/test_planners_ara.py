"""ARA*: bounded by its weight, better with each, the shortest at last."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime.errors import AnytimeError
from planners import Grid, ara, astar
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
