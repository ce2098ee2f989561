"""A* finds shortest paths, says when there is none, and repeats itself to the byte."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from anytime.errors import AnytimeError
from planners import astar, length_of, route, textbook_astar, weighted_astar
from planners.search import bucket_search
from sensing import OPTIMUM_TOLERANCE, map_folder, read_map, read_scenarios, uniform

STRAIGHT, DIAGONAL = 10_000, 14_142

costs = hnp.arrays(
    np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([1, 2, 255])
)


def steps_from(cost, row, column, connectivity):
    """Every legal step out of a cell, as the definition has it."""
    rows, columns = cost.shape
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            r, c = row + down, column + across
            if (down, across) == (0, 0) or not (0 <= r < rows and 0 <= c < columns):
                continue
            if down and across and connectivity == 4:
                continue
            swept = [cost[r, c]]
            if down and across:
                swept += [cost[row, c], cost[r, column]]
            if 255 not in swept:
                yield (r, c), (DIAGONAL if down and across else STRAIGHT) * int(max(swept))


def cheapest(cost, start, goal, connectivity=8):
    """The optimum by scipy's Dijkstra, None without a path."""
    columns, edges = cost.shape[1], []
    for row, column in np.argwhere(cost != 255).tolist():
        for (r, c), step in steps_from(cost, row, column, connectivity):
            edges.append((row * columns + column, r * columns + c, step))
    if start == goal:
        return 0
    if not edges:
        return None
    origin, end, weight = np.array(edges).T
    graph = coo_array((weight.astype(float), (origin, end)), shape=(cost.size, cost.size)).tocsr()
    best = dijkstra(graph, indices=start[0] * columns + start[1])[goal[0] * columns + goal[1]]
    return None if np.isinf(best) else round(best)


def cost_along(cost, cells, connectivity=8):
    total = 0
    for (row, column), there in zip(cells.tolist()[:-1], cells.tolist()[1:], strict=True):
        total += dict(steps_from(cost, row, column, connectivity))[tuple(there)]
    return total


@st.composite
def queries(draw):
    cost = draw(costs)
    passable = np.argwhere(cost != 255).tolist() or [[0, 0]]
    cost[tuple(passable[0])] = min(cost[tuple(passable[0])], 2)
    start, goal = draw(st.sampled_from(passable)), draw(st.sampled_from(passable))
    return cost, tuple(start), tuple(goal)


@given(queries(), st.sampled_from([4, 8]))
@settings(max_examples=150, deadline=None)
def test_every_search_finds_the_optimum_that_dijkstra_finds(query, connectivity):
    cost, start, goal = query
    free = cost != 255
    hard = np.where(free, 1, 255).astype(np.uint8)
    best = cheapest(hard, start, goal, connectivity)
    for search in (astar, textbook_astar):
        found = search(free, start, goal, connectivity)
        if best is None:
            assert found is None
            continue
        assert found.cost == best == cost_along(hard, found.cells, connectivity)
        assert found.length == length_of(found.cells)
        assert tuple(found.cells[0]) == start
        assert tuple(found.cells[-1]) == goal


@given(queries(), st.sampled_from([4, 8]), st.sampled_from([1.0, 1.5, 3.0]))
@settings(max_examples=100, deadline=None)
def test_a_route_over_soft_costs_is_within_its_weight(query, connectivity, weight):
    cost, start, goal = query
    best = cheapest(cost, start, goal, connectivity)
    found = route(cost, start, goal, weight, connectivity)
    if best is None:
        assert found is None
        return
    assert best <= found.cost <= weight * best
    assert cost_along(cost, found.cells, connectivity) == found.cost


@given(queries())
@settings(max_examples=50, deadline=None)
def test_weighted_search_is_bounded_and_no_dearer_in_work_than_the_map(query):
    cost, start, goal = query
    free = cost != 255
    exact, quick = astar(free, start, goal), weighted_astar(free, start, goal, 2.0)
    assert (exact is None) == (quick is None)
    if exact and quick:
        assert exact.cost <= quick.cost <= 2 * exact.cost
        assert quick.expansions <= free.sum()


def test_the_way_from_a_cell_to_itself_is_that_cell():
    found = astar(np.ones((3, 3), bool), (1, 1), (1, 1))
    assert found.cells.tolist() == [[1, 1]]
    assert (found.length, found.cost, found.expansions) == (0.0, 0, 0)


def test_no_corner_is_cut():
    free = np.array([[1, 0], [1, 1]], bool)
    assert astar(free, (0, 0), (1, 1)).length == 2.0


@pytest.mark.parametrize(
    ("start", "goal", "message"),
    [
        ((0, 0), (1, 1), r"start cell \(0, 0\) is blocked"),
        ((1, 1), (0, 0), r"goal cell \(0, 0\) is blocked"),
        ((1, 1), (3, 0), r"goal cell \(3, 0\) is outside the map of 3 rows and 4 columns"),
        ((-1, 1), (1, 1), r"start cell \(-1, 1\) is outside"),
        ((1.5, 1), (1, 1), r"start is \(1.5, 1\); a cell is two whole numbers"),
        ((1, 1), (0, 1, 1), r"goal is \(0, 1, 1\); a cell is two whole numbers"),
        ((1, 1), None, r"goal is None; a cell is two whole numbers"),
    ],
)
def test_a_query_that_makes_no_sense_names_the_cell(start, goal, message):
    free = np.ones((3, 4), bool)
    free[0, 0] = False
    with pytest.raises(AnytimeError, match=message):
        astar(free, start, goal)


def test_other_mistakes_are_named_too():
    free = np.ones((3, 3), bool)
    with pytest.raises(AnytimeError, match="connectivity is 6"):
        astar(free, (0, 0), (1, 1), 6)
    with pytest.raises(AnytimeError, match=r"weight is 0\.5"):
        weighted_astar(free, (0, 0), (1, 1), 0.5)
    with pytest.raises(AnytimeError, match="weight is 'much'"):
        weighted_astar(free, (0, 0), (1, 1), "much")  # pyright: ignore[reportArgumentType]
    with pytest.raises(AnytimeError, match="the map is float64"):
        astar(np.ones((3, 3)), (0, 0), (1, 1))  # pyright: ignore[reportArgumentType]
    with pytest.raises(AnytimeError, match="the map is a list"):
        astar([[True]], (0, 0), (0, 0))  # pyright: ignore[reportArgumentType]
    with pytest.raises(AnytimeError, match="the map holds 255: give bools"):
        astar(np.full((3, 3), 255, np.uint8), (0, 0), (1, 1))  # pyright: ignore[reportArgumentType]


def test_a_map_that_may_not_be_written_and_one_in_pieces_are_planned_on_by_the_same_kernels():
    free = uniform(40, 0.2, np.random.default_rng(0))
    free[0, 0] = free[-1, -1] = True
    wide = np.repeat(np.repeat(free, 2, axis=0), 2, axis=1)
    best = astar(free, (0, 0), (39, 39))
    assert best is not None
    kernels = len(bucket_search.signatures)
    sealed = np.frombuffer(free.tobytes(), bool).reshape(free.shape)
    for kind in (sealed, wide[::2, ::2], np.asfortranarray(free)):
        found = astar(kind, (0, 0), (39, 39))
        assert found is not None
        assert np.array_equal(found.cells, best.cells)
    assert len(bucket_search.signatures) == kernels


def test_a_search_that_may_expand_nothing_says_so():
    with pytest.raises(TimeoutError, match="after 5 expansions"):
        astar(np.ones((30, 30), bool), (0, 0), (29, 20), budget=5)


def test_what_earlier_searches_left_changes_nothing():
    rng = np.random.default_rng(0)
    floors = [rng.random(shape) > 0.25 for shape in ((30, 40), (7, 90), (30, 40), (64, 64))]
    for free in floors:
        free[0, 0] = free[-1, -1] = True

    def answers():
        for free in floors:
            goal = (free.shape[0] - 1, free.shape[1] - 1)
            for search in (astar, textbook_astar):
                found = search(free, (0, 0), goal)
                yield None if found is None else (found.cells.tobytes(), found.expansions)

    first = list(answers())
    assert first == list(answers()) == list(answers())


def test_published_optima_are_met():
    folder = map_folder()
    if folder is None:
        pytest.skip("no maps: set ANYTIME_MAPS or put them at ../shared/maps")
    rng, read = np.random.default_rng(0), 0
    for path in sorted(folder.rglob("*.map.scen")):
        grid = read_map(path.with_suffix(""))
        queries = read_scenarios(path, grid)
        for index in rng.choice(len(queries), min(20, len(queries)), replace=False):
            query = queries[index]
            found = astar(grid.free, query.start, query.goal)
            assert found is not None
            assert abs(found.length - query.optimal_length) <= OPTIMUM_TOLERANCE
        read += 1
    assert read > 0
