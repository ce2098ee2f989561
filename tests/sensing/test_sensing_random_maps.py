"""Random floors: each family is what it is called, and every problem can be solved."""

import hashlib
from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from anytime.errors import AnytimeError
from sensing import (
    FAMILIES,
    clustered,
    connected,
    corner_to_corner,
    instance,
    maze,
    rooms,
    uniform,
)


def reachable_by_walking(free, start):
    """Breadth-first, 8-connected; a diagonal needs both orthogonal neighbours free."""
    rows, columns = free.shape

    def open_at(row, column):
        return 0 <= row < rows and 0 <= column < columns and free[row, column]

    seen, queue = {start}, deque([start])
    while queue:
        row, column = queue.popleft()
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                near = (row + down, column + right)
                if near in seen or not open_at(*near):
                    continue
                if open_at(row + down, column) and open_at(row, column + right):
                    seen.add(near)
                    queue.append(near)
    return seen


@given(st.integers(0, 2**32), st.floats(0, 0.6), st.integers(2, 12))
def test_connected_is_what_a_robot_can_walk(seed, density, size):
    free = uniform(size, density, np.random.default_rng(seed))
    cells = [(int(row), int(column)) for row, column in np.argwhere(free)]
    if not cells:
        return
    start = cells[seed % len(cells)]
    seen = reachable_by_walking(free, start)
    assert all(connected(free, start, goal) == (goal in seen) for goal in cells)


def test_a_blocked_cell_is_connected_to_nothing():
    free = np.array([[True, False]])
    assert connected(free, (0, 0), (0, 0))
    assert not connected(free, (0, 0), (0, 1))


@given(st.integers(0, 1000), st.floats(0.01, 0.99))
def test_uniform_floors_have_the_density_asked_for(seed, density):
    free = uniform((64, 80), density, np.random.default_rng(seed))
    assert free.shape == (64, 80)
    deviation = (density * (1 - density) / free.size) ** 0.5
    assert abs(1 - free.mean() - density) <= 6 * deviation


@pytest.mark.parametrize("density", [0.0, 0.3, 1.0])
def test_clustered_floors_have_exactly_the_density_asked_for(density):
    free = clustered(128, density, np.random.default_rng(0))
    assert 1 - free.mean() == pytest.approx(density, abs=1e-4)


def test_clustered_obstacles_hang_together():
    free = clustered(128, 0.3, np.random.default_rng(0))
    scattered = uniform(128, 0.3, np.random.default_rng(0))
    assert 8 * ndimage.label(~free)[1] < ndimage.label(~scattered)[1]


def test_rooms_are_sixteen_cells_and_four_of_five_walls_have_a_door():
    free = rooms(17 * 40 - 1, np.random.default_rng(0))
    assert not free[16::17, 16::17].any()
    inside = free.copy()
    inside[16::17, :] = True
    inside[:, 16::17] = True
    assert inside.all()
    walls = np.pad(free, (0, 1))[16::17, :].reshape(40, 40, 17)[:-1]
    doors = walls.sum(axis=2)
    assert set(np.unique(doors)) == {0, 1}
    assert doors.mean() == pytest.approx(0.8, abs=0.05)


def test_a_maze_is_perfect_with_corridors_of_three():
    free = maze(63, np.random.default_rng(0))
    places = free[1::4, 1::4]
    assert places.shape == (16, 16)
    assert places.all()
    passages = free[3::4, 1::4].sum() + free[1::4, 3::4].sum()
    assert passages == places.size - 1  # a tree
    assert ndimage.label(free)[1] == 1
    assert not free[3::4, 3::4].any()


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 100))
def test_a_maze_of_any_size_hangs_together(rows, columns, seed):
    corridor = min(3, rows, columns)
    free = maze((rows, columns), np.random.default_rng(seed), corridor=corridor)
    assert free.shape == (rows, columns)
    assert ndimage.label(free)[1] == 1


@pytest.mark.parametrize("family", FAMILIES)
def test_every_problem_leads_from_corner_to_corner(family):
    for index in range(3):
        free, start, goal = instance(family, 48, index)
        assert (start, goal) == corner_to_corner(free)
        assert goal in reachable_by_walking(free, start)


@pytest.mark.parametrize(
    ("family", "density", "slack"),
    [
        ("r10", 0.1, 0.02),
        ("r20", 0.2, 0.02),
        ("r30", 0.3, 0.02),
        ("r35", 0.35, 0.02),
        ("clustered", 0.3, 1e-3),
        ("rooms", 0.107, 0.01),
        ("maze", 0.25, 0.01),
    ],
)
def test_the_densities_are_those_of_the_families(family, density, slack):
    blocked = [1 - instance(family, 128, index)[0].mean() for index in range(5)]
    assert np.mean(blocked) == pytest.approx(density, abs=slack)


def test_a_problem_is_the_same_in_every_process():
    content = b"".join(
        instance(family, 32, index, seed)[0].tobytes()
        for family in ("r20", "rooms", "maze")
        for index in range(2)
        for seed in range(2)
    )
    assert hashlib.blake2b(content, digest_size=8).hexdigest() == "4156e270ea6e0acb"


def test_problems_differ_by_index_and_seed():
    first = instance("r20", 32, 0)[0]
    assert not np.array_equal(first, instance("r20", 32, 1)[0])
    assert not np.array_equal(first, instance("r20", 32, 0, seed=1)[0])


def test_what_is_no_family_is_refused():
    with pytest.raises(AnytimeError, match="'forest': it must be one of r10"):
        instance("forest", 32, 0)
    with pytest.raises(AnytimeError, match="none with a path"):
        instance("r90", 32, 0)
    with pytest.raises(AnytimeError, match="share from 0 to 1"):
        uniform(8, 1.5, np.random.default_rng(0))
    with pytest.raises(AnytimeError, match="at least one row"):
        uniform(0, 0.5, np.random.default_rng(0))
