"""The way in hand: what it costs, and how what was found takes the place of some of it."""

import numpy as np
from numba import njit

from planners.frontier import path_to, way_cost, with_room
from planners.improving import (
    BASE,
    COUNT,
    FOLLOWS,
    MEETING,
    NOTHING,
    POSITION,
    begin,
    estimated,
    search,
)

CALLED = "1bd60240246b"

_WINDOW_BUDGET = 4000  # expansions after which a window is given up


@njit(cache=True, nogil=True, error_model="numpy")
def so_far(cost, wall, columns, start, diagonals, run):
    """The way as a search that has beaten it, and still goes on, has made it shorter so far: flat
    indices."""
    count, node, path = run.state[COUNT], run.state[MEETING], run.path
    beginning = path_to(cost, wall, columns, start, node, diagonals, run)
    if count == 0 or node == path[count - 1]:
        return beginning
    rest = count - 1  # its last visit, should the way go in a circle
    while path[rest] != node:
        rest -= 1
    way = with_room(beginning, beginning.size, beginning.size + count - rest - 1)
    for place in range(rest + 1, count):
        way[beginning.size + place - rest - 1] = path[place]
    return way


@njit(cache=True, nogil=True, error_model="numpy")
def take_up(cost, wall, columns, start, diagonals, run):
    """Take up what the last search found: its way to `MEETING`, and then the way in hand.

    Returns the cost of the new way.
    """
    node, count, path = run.state[MEETING], run.state[COUNT], run.path
    rest = count - 1
    beginning = path_to(cost, wall, columns, start, node, diagonals, run)
    run.state[MEETING] = NOTHING
    while rest > 0 and path[rest] != node:
        rest -= 1
    _replace(run, 0, min(rest, count - 1), beginning)
    return way_cost(cost, wall, columns, path, 0, run.state[COUNT] - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _replace(run, first, last, piece):
    """Put a piece in the place of the way's cells `first` to `last`."""
    # Arrays are taken out of the tuple once: inside a loop that would count references.
    count, path = run.state[COUNT], run.path
    grown = piece.size - (last - first + 1)
    if grown > 0:
        for place in range(count - 1, last, -1):
            path[place + grown] = path[place]
    elif grown < 0:
        for place in range(last + 1, count):
            path[place + grown] = path[place]
    for place in range(piece.size):
        path[first + place] = piece[place]
    run.state[COUNT] = count + grown


@njit(cache=True, nogil=True, error_model="numpy")
def follow_way(cost, wall, columns, run):
    """Tell the search that has begun what the way in hand costs up to each of its cells."""
    total, base, path, prefix = np.int64(0), run.state[BASE], run.path, run.prefix
    run.state[FOLLOWS] = 1
    prefix[path[0]] = base
    for place in range(run.state[COUNT] - 1):
        total += way_cost(cost, wall, columns, path, place, place + 1)
        prefix[path[place + 1]] = base + total


@njit(cache=True, nogil=True, error_model="numpy")
def improve_windows(cost, wall, columns, length, diagonals, run, budget):
    """Make the way in hand the shortest in windows of `length` cells, half of each in the next.

    Returns (done, expansions). `run.norm` must be exact. A window that is as short
    as can be costs nothing.
    """
    state, path, expansions = run.state, run.path, 0
    while state[POSITION] < state[COUNT] - 1:
        if expansions >= budget:
            return False, expansions
        first = state[POSITION]
        last = min(first + length, state[COUNT] - 1)
        start, goal = np.int64(path[first]), np.int64(path[last])
        before = way_cost(cost, wall, columns, path, first, last)
        down, across = goal // columns - start // columns, goal % columns - start % columns
        if before > estimated(down, across, run.norm):
            begin(cost, columns, start, goal, before, True, run)
            _, taken = search(cost, wall, columns, goal, diagonals, run, _WINDOW_BUDGET)
            expansions += taken
            if state[MEETING] >= 0:
                piece = path_to(cost, wall, columns, start, goal, diagonals, run)
                _replace(run, first, last, piece)
                last = first + piece.size - 1
        state[POSITION] = last if last == state[COUNT] - 1 else first + max(1, (last - first) // 2)
    return True, expansions
