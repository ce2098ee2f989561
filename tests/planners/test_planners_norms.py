"""What a way costs among independent obstacles: no less than on an empty floor, more by density."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners import astar
from planners.improving import estimated
from planners.norms import expected_norm, least_norm
from sensing import nearest_free, uniform

DENSITIES = st.floats(0.0, 0.6)
DISTANCES = st.integers(-2000, 2000)


def least(rows, columns, diagonals):
    norm = np.zeros(6, np.int64)
    least_norm(diagonals, norm)
    return int(estimated(rows, columns, norm))


def expected(rows, columns, density, diagonals=True):
    norm = np.zeros(6, np.int64)
    expected_norm(density, 1.0, diagonals, norm)
    return int(estimated(rows, columns, norm))


@given(DENSITIES, DISTANCES, DISTANCES, st.booleans())
def test_a_way_among_obstacles_costs_no_less_than_on_an_empty_floor(p, rows, columns, diagonals):
    slack = 2 * (abs(rows) + abs(columns))  # planes are rounded
    empty = least(rows, columns, diagonals)
    assert expected(rows, columns, p, diagonals) >= empty - slack
    assert empty == least(columns, -rows, diagonals)


@given(DENSITIES, DENSITIES, DISTANCES, DISTANCES)
def test_the_denser_the_floor_the_dearer_the_way(one, other, rows, columns):
    sparse, dense = (expected(rows, columns, p) for p in sorted((one, other)))
    assert dense >= sparse - 2 * (abs(rows) + abs(columns))


@pytest.mark.parametrize("density", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_ways_cost_what_the_norm_expects(density, slope):
    rng, ratios = np.random.default_rng(7), []
    for _ in range(6):
        free = uniform((320, 320), density, rng)
        start, goal = nearest_free(free, (20, 20)), nearest_free(free, (300, 20 + int(280 * slope)))
        found = astar(free, start, goal)
        if found is not None:
            down, across = goal[0] - start[0], goal[1] - start[1]
            ratios.append(found.cost / expected(down, across, density))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.025)
