"""The way in hand: windows make it shorter, never longer, and leave it a way."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planners import astar, weighted_astar
from planners.frontier import step_between, step_cost, way_cost
from planners.improving import COUNT, POSITION, new_run
from planners.norms import least_norm
from planners.way_in_hand import improve_windows
from sensing import uniform


@st.composite
def detours(draw):
    """A floor, and the flat cells of a way over it that is longer than it need be."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = draw(st.integers(2, 40)), draw(st.integers(2, 40))
    free = uniform(shape, draw(st.floats(0.0, 0.35)), rng)
    free[0, 0] = free[-1, -1] = True
    over = int(rng.integers(shape[0])), int(rng.integers(shape[1]))
    free[over] = True
    legs = [((0, 0), over), (over, (shape[0] - 1, shape[1] - 1))]
    found = [weighted_astar(free, one, other, 3.0) for one, other in legs]
    if any(leg is None for leg in found):
        return free, np.zeros(0, np.int32)
    cells = np.concatenate([found[0].cells, found[1].cells[1:]])
    return free, (cells[:, 0] * shape[1] + cells[:, 1]).astype(np.int32)


def improved(free, way, length, grain):
    """The way after its windows of a length, by so many expansions at a time."""
    cost, columns = np.ascontiguousarray(free).view(np.uint8).reshape(-1), free.shape[1]
    run = new_run(*free.shape)
    run.path[: len(way)], run.state[COUNT], run.state[POSITION] = way, len(way), 0
    least_norm(True, run.norm)
    while not improve_windows(cost, 0, columns, length, True, run, grain)[0]:
        pass
    return run.path[: run.state[COUNT]].copy()


def cost_of(free, way):
    """Cost of a way, each of whose steps must be allowed."""
    cost, columns = np.ascontiguousarray(free).view(np.uint8).reshape(-1), free.shape[1]
    for node, there in zip(way[:-1].tolist(), way[1:].tolist(), strict=True):
        assert step_cost(cost, 0, columns, node, *step_between(node, there, columns)) > 0
    return int(way_cost(cost, 0, columns, way, 0, len(way) - 1))


@given(detours(), st.integers(2, 100), st.integers(1, 300))
@settings(max_examples=60)
def test_windows_leave_a_way_between_the_same_cells_that_is_not_longer(detour, length, grain):
    free, way = detour
    if len(way) < 2:
        return
    better = improved(free, way, length, grain)
    assert (better[0], better[-1]) == (way[0], way[-1])
    assert cost_of(free, better) <= cost_of(free, way)


@given(detours(), st.integers(1, 300))
@settings(max_examples=60)
def test_a_window_over_the_whole_way_makes_it_the_shortest(detour, grain):
    free, way = detour
    if len(way) < 2:
        return
    best = astar(free, (0, 0), (free.shape[0] - 1, free.shape[1] - 1))
    assert best is not None
    assert cost_of(free, improved(free, way, len(way), grain)) == best.cost
