"""The search that improves a way: any norm, any interruptions, and never a worse way."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planners import astar, route
from planners.frontier import way_cost
from planners.improving import (
    COUNT,
    DONE,
    GAIN,
    MEETING,
    UPPER,
    begin,
    new_run,
    reweigh,
    search,
)  # fmt: skip
from planners.norms import expected_norm, least_norm
from planners.search import SPAN
from planners.way_in_hand import take_up
from sensing import uniform


@st.composite
def queries(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(2, 60)), draw(st.integers(2, 60)))
    free = uniform(shape, draw(st.floats(0.0, 0.4)), rng)
    free[0, 0] = free[-1, -1] = True
    return free


def found(cost, wall, columns, grain, scales=()):
    """Cost of the way from the first to the last cell, or None; searched `grain` by `grain`, by the
    exact norm or by the expected one, in two scales."""
    run, goal, again = new_run(cost.size // columns, columns), cost.size - 1, scales[1:]
    if scales:
        expected_norm(0.3, scales[0], True, run.norm)
    else:
        least_norm(True, run.norm)
    begin(cost, columns, 0, goal, SPAN, not scales, run)
    while search(cost, wall, columns, goal, True, run, grain)[0] != DONE:
        for scale in again:
            expected_norm(0.3, scale, True, run.norm)
            reweigh(columns, goal, run)
        again = ()
    if run.state[MEETING] < 0:
        return None
    told = int(run.state[UPPER] - run.state[GAIN])
    take_up(cost, wall, columns, 0, True, run)
    walked = int(run.state[UPPER])
    assert walked <= told
    assert walked == way_cost(cost, wall, columns, run.path, 0, run.state[COUNT] - 1)
    return walked


@given(queries(), st.integers(1, 200))
@settings(max_examples=60)
def test_with_an_exact_norm_the_way_is_the_shortest_however_often_it_is_interrupted(free, grain):
    best = astar(free, (0, 0), (free.shape[0] - 1, free.shape[1] - 1))
    cost = np.ascontiguousarray(free).view(np.uint8).reshape(-1)
    way = found(cost, 0, free.shape[1], grain)
    assert way == (None if best is None else best.cost)


@given(queries(), st.integers(1, 50), st.floats(1.0, 3.0), st.floats(1.0, 8.0))
@settings(max_examples=60)
def test_any_norm_finds_a_way_where_there_is_one(free, grain, scale, later):
    best = astar(free, (0, 0), (free.shape[0] - 1, free.shape[1] - 1))
    cost = np.ascontiguousarray(free).view(np.uint8).reshape(-1)
    way = found(cost, 0, free.shape[1], grain, (scale, scale * later))
    assert (way is None) == (best is None)
    assert best is None or (way is not None and best.cost <= way)


@given(st.integers(0, 2**32), st.integers(1, 300))
@settings(max_examples=40)
def test_cells_that_are_dear_do_not_overtake_each_other_in_the_ring(seed, grain):
    rng = np.random.default_rng(seed)
    cost = rng.choice(np.array([1, 1, 1, 7, 250, 255], np.uint8), (30, 40))
    cost[0, 0] = cost[-1, -1] = 1
    best = route(cost, (0, 0), (29, 39))
    way = found(cost.reshape(-1), 255, 40, grain)
    assert way == (None if best is None else best.cost)
