"""Tours through several goals: no order is shorter, and what cannot be visited is said."""

from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from planners import route
from planners.touring import MOST_GOALS, shortest_tour

OPEN = np.ones((12, 12), np.uint8)
places = st.tuples(st.integers(0, 11), st.integers(0, 11))


def walls(seed: int, share: float = 0.2) -> np.ndarray:
    return np.where(np.random.default_rng(seed).random((12, 12)) < share, 255, 1).astype(np.uint8)


@given(st.integers(0, 10_000), st.lists(places, min_size=2, max_size=5, unique=True))
def test_no_order_of_the_goals_is_shorter(seed, cells):
    cost = walls(seed)
    for cell in cells:
        cost[cell] = 1
    start, *goals = cells
    tour = shortest_tour(cost, start, goals)
    ways = {(a, b): route(cost, a, b) for a in cells for b in cells if a != b}
    if any(ways[start, goal] is None for goal in goals):
        assert tour is None
        return
    orders = [(start, *order) for order in permutations(goals)]
    lengths = [sum(ways[pair].length for pair in pairwise(order)) for order in orders]
    assert tour.length == pytest.approx(min(lengths))
    assert set(tour.goals) == set(goals)
    assert tuple(tour.first.cells[-1]) == tour.goals[0]


def test_goals_on_a_line_are_visited_one_after_the_other():
    tour = shortest_tour(OPEN, (0, 0), [(0, 9), (0, 2), (0, 6)])
    assert tour.goals == ((0, 2), (0, 6), (0, 9))
    assert tour.length == 9.0


def test_only_ways_that_a_best_order_uses_are_searched_for():
    goals = [(0, 9), (0, 2), (0, 6)]
    line = [route(OPEN, *pair).expansions for pair in pairwise([(0, 0), (0, 2), (0, 6), (0, 9)])]
    assert shortest_tour(OPEN, (0, 0), goals).expansions == sum(line)


def test_one_goal_is_a_way():
    assert shortest_tour(OPEN, (0, 0), [(3, 0)]).beyond == 0.0


@pytest.mark.parametrize("count", [0, MOST_GOALS + 1])
def test_no_goal_and_too_many_are_refused(count):
    with pytest.raises(AnytimeError, match="it takes 1 to 8"):
        shortest_tour(OPEN, (0, 0), [(index, 5) for index in range(count)])
