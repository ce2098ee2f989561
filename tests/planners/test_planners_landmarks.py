"""Landmarks: each query on a map that was asked about before makes one, and has a way at once."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners import Grid, astar, steps
from planners.blocks import UNKNOWN, part, region_of
from planners.landmarks import Landmarks, known_way
from planners.path_finding import index_of
from planners.region_search import MARKS, likely_way
from sensing import connected, instance, maze
from tests.planners.test_planners_atp import floors, is_a_way, plans_of


def soft(grid):
    return grid.cost, grid.wall, grid.dearest, grid.shape[1]


def asked_from(grid, start, times=1):
    """Grow a grid's landmarks as so many queries from a cell would, whose block is looked at."""
    list(steps(grid, start, start))
    node = index_of(start, grid.shape, "start")
    look_at(grid, start)
    for _ in range(times):
        list(grid.landmarks.grow(soft(grid), node, grid.regions))


def look_at(grid, cell):
    row, column = cell
    block = row // 8 * -(-grid.shape[1] // 8) + column // 8
    if grid.regions.count[block] == UNKNOWN:
        part(*soft(grid), block, grid.regions)


def way_between(grid, start, goal, connectivity=8):
    path = np.zeros(grid.cost.size + 1, np.int32)
    count, cost, _ = known_way(
        *soft(grid), *(index_of(cell, grid.shape, "cell") for cell in (start, goal)),
        connectivity == 8, grid.regions, grid.landmarks.tables, path,
    )  # fmt: skip
    return path[:count], cost


@given(floors(largest=90), st.sampled_from([4, 8]))
@settings(max_examples=60)
def test_two_cells_that_hang_together_have_a_known_way_and_others_none(floor, connectivity):
    free, start, goal = floor
    grid = Grid.known(free)
    asked_from(grid, start, MARKS + 1)
    look_at(grid, goal)
    path, cost = way_between(grid, start, goal, connectivity)
    assert (len(path) > 0) == connected(free, start, goal)
    if len(path):
        cells = np.stack([path // free.shape[1], path % free.shape[1]], axis=1)
        plan = type("Plan", (), {"plan": np.insert(cells, 0, 0, axis=1)})
        assert is_a_way(free, plan, start, goal, connectivity)
        best = astar(free, start, goal, connectivity)
        assert cost >= best.cost - 1e-9


@given(floors(largest=90))
@settings(max_examples=40)
def test_what_landmarks_say_of_a_way_is_seldom_much_more_than_it_is(floor):
    free, start, goal = floor
    grid = Grid.known(free)
    asked_from(grid, start, MARKS + 1)
    best = astar(free, start, goal)
    if best is None:
        return
    look_at(grid, goal)
    first, last = (
        region_of(free.shape[1], index_of(cell, grid.shape, "cell"), grid.regions)
        for cell in (start, goal)
    )
    assert likely_way(grid.landmarks.tables.far, first, last) <= 1.2 * best.cost + 160_000


@given(floors(largest=150), st.sampled_from([4, 8]), st.integers(0, 2**32))
@settings(max_examples=25)
def test_a_map_asked_about_again_has_ways_that_get_shorter_up_to_the_shortest(
    floor, connectivity, seed
):
    free, start, goal = floor
    grid, cells, rng = Grid.known(free), np.argwhere(free), np.random.default_rng(seed)
    for one, other in rng.integers(len(cells), size=(4, 2)):
        list(steps(grid, tuple(cells[one]), tuple(cells[other])))
    plans = plans_of(steps(grid, start, goal, connectivity=connectivity))
    best = astar(free, start, goal, connectivity)
    if best is None:
        assert math.isinf(plans[-1].length)
        return
    lengths = [plan.length for plan in plans]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] == pytest.approx(best.length, rel=1e-4)
    assert all(is_a_way(free, plan, start, goal, connectivity) for plan in plans)


def test_a_map_asked_about_again_has_its_first_plan_for_a_fraction_of_the_work():
    free, start, goal = instance("rooms", 256, 2)
    grid, best = Grid.known(free), astar(free, start, goal)

    def until_a_plan():
        spent = 0.0
        for step in steps(grid, start, goal):
            spent += step.work
            if step.plan is not None:
                return spent, best.length / step.plan.length
        raise AssertionError("no plan at all")

    first, _ = until_a_plan()
    cells = np.argwhere(free)
    for one, other in np.random.default_rng(0).integers(len(cells), size=(8, 2)):
        list(steps(grid, tuple(cells[one]), tuple(cells[other])))
    later, quality = until_a_plan()
    assert later < 0.5 * first
    assert quality > 0.8


def test_the_first_query_learns_nothing_and_each_later_one_a_landmark():
    free = maze((80, 90), np.random.default_rng(0), corridor=2)
    grid, start = Grid.known(free), tuple(np.argwhere(free)[0])
    for made in (0, 1, 2):
        asked_from(grid, start)
        assert grid.landmarks.tables.made[0] == made
    asked_from(grid, start, 2 * MARKS)
    assert grid.landmarks.tables.made[0] == MARKS


def test_a_landmark_that_a_query_could_not_complete_is_completed_by_the_next():
    free = np.ones((400, 400), bool)
    free[::9, 1:] = False
    free[4::9, :-1] = False
    grid, node = Grid.known(free), 400
    asked_from(grid, (1, 0))
    begun = grid.landmarks.grow(soft(grid), node, grid.regions)
    next(begun)
    assert not list(grid.landmarks.grow(soft(grid), node, grid.regions))  # it is being made
    begun.close()
    assert grid.landmarks.tables.made[0] == 0
    list(grid.landmarks.grow(soft(grid), node, grid.regions))
    assert grid.landmarks.tables.made[0] == 1
    at_once = Landmarks(*grid.shape)
    for _ in range(2):
        list(at_once.grow(soft(grid), node, grid.regions))
    assert (at_once.tables.far == grid.landmarks.tables.far).all()


def test_a_part_of_the_map_that_no_landmark_reaches_gets_the_next():
    free = np.ones((64, 64), bool)
    free[:, 30] = False
    grid = Grid.known(free)
    asked_from(grid, (5, 5), 3)
    asked_from(grid, (5, 60))
    look_at(grid, (60, 40))
    path, _ = way_between(grid, (5, 60), (60, 40))
    assert len(path) > 0


def test_a_map_that_changes_forgets_its_landmarks():
    grid = Grid(np.zeros((40, 40), np.float32))
    asked_from(grid, (0, 0), 4)
    assert grid.landmarks.tables.made[0] > 0
    grid.update(3, 3, np.ones((2, 2), np.float32))
    assert grid.landmarks.tables.made[0] == 0
