"""Obstacle avoidance reaches every goal that can be reached, whatever plan it was given."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from planners import astar, blind_quality, blind_walk, length_of, walk
from sensing import clustered, connected, maze, rooms, uniform

NO_PLAN = np.zeros((0, 3), np.int32)

kinds = st.sampled_from(["uniform", "dense", "clustered", "rooms", "maze"])


def floor(kind, shape, rng):
    match kind:
        case "uniform":
            return uniform(shape, 0.2, rng)
        case "dense":
            return uniform(shape, 0.36, rng)
        case "clustered":
            return clustered(shape, 0.3, rng)
        case "rooms":
            return rooms(shape, rng)
    return maze(shape, rng, corridor=2)


@st.composite
def walks(draw):
    """A floor of any kind and shape, with two free cells and a plan that may be rubbish."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(8, 50)), draw(st.integers(8, 50)))
    free = floor(draw(kinds), shape, rng)
    free[rng.integers(shape[0]), rng.integers(shape[1])] = True
    cells = np.argwhere(free)
    start, goal = (tuple(cells[i].tolist()) for i in rng.integers(len(cells), size=2))
    count = draw(st.integers(0, 12))
    levels = rng.integers(0, 5, count)
    plan = np.stack([levels, rng.integers(-3, 60, count) >> levels, rng.integers(-3, 60, count)], 1)
    return free, start, goal, plan.astype(np.int32), rng


def assert_is_a_walk(free, cells):
    assert free[tuple(cells.T)].all()
    for (row, column), (r, c) in zip(cells[:-1].tolist(), cells[1:].tolist(), strict=True):
        assert max(abs(r - row), abs(c - column)) == 1
        assert free[row, c]
        assert free[r, column]


@given(walks())
@settings(max_examples=150, deadline=None)
def test_connected_means_reached_and_the_rest_is_named(query):
    free, start, goal, plan, _ = query
    walked = blind_walk(free, plan, start, goal)
    assert_is_a_walk(free, walked.cells)
    assert tuple(walked.cells[0]) == start
    assert walked.reached == connected(free, start, goal)
    assert walked.unreachable != walked.reached
    assert (tuple(walked.cells[-1]) == goal) == walked.reached
    assert walked.length == length_of(walked.cells)


@given(walks(), st.floats(0.0, 0.5))
@settings(max_examples=60, deadline=None)
def test_a_wrong_belief_misleads_but_never_stops_the_robot(query, error):
    free, start, goal, plan, rng = query
    believed = np.where(free ^ (rng.random(free.shape) < error), 1, rng.integers(2, 256))
    cost, touched = believed.astype(np.uint8), np.zeros(free.shape, bool)
    walked = walk(free, cost, touched, plan, start, goal)
    assert_is_a_walk(free, walked.cells)
    assert walked.reached == connected(free, start, goal)
    # What was touched is known for certain, and nothing else was touched than along the way.
    assert (cost[touched & free] == 1).all()
    assert (cost[touched & ~free] == 255).all()
    beside = np.zeros(free.shape, bool)
    for row, column in walked.cells.tolist():
        beside[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2] = True
    assert (touched == beside).all()


@given(walks(), st.floats(0.0, 40.0))
@settings(max_examples=60, deadline=None)
def test_a_leash_is_never_overrun(query, leash):
    free, start, goal, plan, _ = query
    cost, touched = np.ones(free.shape, np.uint8), np.zeros(free.shape, bool)
    walked = walk(free, cost, touched, plan, start, goal, leash=leash)
    assert walked.length <= leash + 1e-3
    if not walked.reached and not walked.unreachable:
        assert walked.length + math.sqrt(2) > leash - 1e-3


@given(walks())
@settings(max_examples=40, deadline=None)
def test_the_shortest_path_as_a_plan_is_walked_as_it_is(query):
    free, start, goal, _, _ = query
    best = astar(free, start, goal)
    if best is None or start == goal:
        return
    plan = np.pad(best.cells, ((0, 0), (1, 0)))
    walked = blind_walk(free, plan, start, goal)
    assert walked.cells.tolist() == best.cells.tolist()
    assert blind_quality(free, plan, start, goal, best.length) == 1.0


def test_an_unreachable_goal_has_no_quality():
    free = np.ones((5, 5), bool)
    free[:, 2] = False
    assert blind_quality(free, NO_PLAN, (0, 0), (0, 4), 4.0) == 0.0
    assert blind_quality(free, NO_PLAN, (0, 0), (0, 0), 0.0) == 1.0


def test_mistakes_are_named():
    free = np.ones((5, 5), bool)
    cost, touched = np.ones((5, 5), np.uint8), np.zeros((5, 5), bool)
    with pytest.raises(AnytimeError, match="cost is"):
        walk(free, cost[::2], touched, NO_PLAN, (0, 0), (1, 1))
    with pytest.raises(AnytimeError, match="the plan is"):
        walk(free, cost, touched, NO_PLAN[:, :2], (0, 0), (1, 1))
    with pytest.raises(AnytimeError, match="leash is -1 cells"):
        walk(free, cost, touched, NO_PLAN, (0, 0), (1, 1), leash=-1)
    free[0, 0] = False
    with pytest.raises(AnytimeError, match=r"start cell \(0, 0\) is blocked"):
        walk(free, cost, touched, NO_PLAN, (0, 0), (1, 1))
