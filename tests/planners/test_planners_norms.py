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


def cost(rows, columns, norm):
    return int(estimated(rows, columns, np.array(norm)))


@given(DENSITIES, DISTANCES, DISTANCES, st.booleans())
def test_a_way_among_obstacles_costs_no_less_than_on_an_empty_floor(p, rows, columns, diagonals):
    least = cost(rows, columns, least_norm(diagonals))
    slack = 2 * (abs(rows) + abs(columns))  # planes are rounded
    assert cost(rows, columns, expected_norm(p, 1.0, diagonals)) >= least - slack
    assert least == cost(columns, -rows, least_norm(diagonals))


@given(DENSITIES, DENSITIES, DISTANCES, DISTANCES)
def test_the_denser_the_floor_the_dearer_the_way(one, other, rows, columns):
    sparse, dense = (cost(rows, columns, expected_norm(p, 1.0, True)) for p in sorted((one, other)))
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
            ratios.append(found.cost / cost(down, across, expected_norm(density, 1.0, True)))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.025)
