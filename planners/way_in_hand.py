"""The way in hand: what it costs, and how what was found takes the place of some of it."""

import numpy as np

from anytime.machine_code import njit
from planners.frontier import cells_of, step_cost, way_cost, with_room
from planners.improving import (
    BASE,
    COUNT,
    CURRENT,
    DONE,
    FOLLOWS,
    GAIN,
    LENGTH,
    MEETING,
    NOTHING,
    POSITION,
    SHIFT,
    SIDE,
    UPPER,
    begin,
    estimated,
    search,
)
from planners.norms import expected_norm, least_norm
from planners.search import ACROSS, DIAGONAL, DOWN, SPAN, STEP, STRAIGHT

CALLED = "dc77380243b5"

_WINDOW_BUDGET = 4000  # expansions after which a window is given up


@njit(cache=True, nogil=True, error_model="numpy")
def way_to(cost, wall, columns, start, node, diagonals, run):
    """The way from `start` to `node` by the labels of the last search, flat indices, and its cost.

    It goes by the sides to which ways came, but diagonally where that costs no more: among ways
    that the search holds equal, from those the next search was measured to gain more.
    """
    label, rows = run.label, cost.size // columns
    apart = np.empty(8, np.int64)
    for side in range(8):
        apart[side] = DOWN[side] * columns + ACROSS[side]
    row, column, length = node // columns, node % columns, 0
    most = (run.state[BASE] - (label[node] >> LENGTH)) // STRAIGHT + 1  # no step costs less
    way = np.empty(min(most, cost.size), np.int32)
    first = way.size - 1
    way[first] = node
    while node != start:
        best, least = (label[node] >> SIDE) & 7, label[node] >> LENGTH
        if diagonals and best < 4:
            inside = 0 < row < rows - 1 and 0 < column < columns - 1
            for side in range(4, 8):
                there_row, there_column = row - DOWN[side], column - ACROSS[side]
                if not inside and not (0 <= there_row < rows and 0 <= there_column < columns):
                    continue
                there = node - apart[side]
                if (label[there] >> LENGTH) - DIAGONAL < least:
                    continue
                step = step_cost(cost, wall, columns, there, DOWN[side], ACROSS[side])
                if step > 0 and (label[there] >> LENGTH) - step >= least:
                    best, least = side, (label[there] >> LENGTH) - step
        down, across = DOWN[best], ACROSS[best]
        node, row, column = node - apart[best], row - down, column - across
        step = STEP[best] if wall == 0 else step_cost(cost, wall, columns, node, down, across)
        length += step
        first -= 1
        way[first] = node
    return way[first:], length


@njit(cache=True, nogil=True, error_model="numpy")
def so_far(cost, wall, columns, start, diagonals, run, known):
    """The way in hand, known to cost so much, or what a search that has beaten it, and still goes
    on, has made of it so far: its cells as `cells_of` a plan, and its cost."""
    count, node, path = run.state[COUNT], run.state[MEETING], run.path
    way, length = path[:count], known
    if node >= 0:
        # Labels that were corrected since may have made it even shorter than was told.
        way, length = way_to(cost, wall, columns, start, node, diagonals, run)
        if count > 0 and node != path[count - 1]:
            length += _left(run, node)
            first, rest = way.size, count - 1  # its last visit, should the way go in a circle
            while path[rest] != node:
                rest -= 1
            way = with_room(way, first, first + count - rest - 1)
            for place in range(rest + 1, count):
                way[first + place - rest - 1] = path[place]
    cells, diagonal = cells_of(way, columns, 1)
    return cells, diagonal, length


@njit(cache=True, nogil=True, error_model="numpy")
def take_up(cost, wall, columns, start, diagonals, run):
    """Take up what the last search found: its way to `MEETING`, and then the way in hand.

    `UPPER` is what the new way costs.
    """
    state, path = run.state, run.path
    node, count = state[MEETING], state[COUNT]
    beginning, length = way_to(cost, wall, columns, start, node, diagonals, run)
    rest = count - 1
    if count > 0 and node != path[rest]:
        while path[rest] != node:
            rest -= 1
        length += _left(run, node)
    _replace(run, 0, rest, beginning)
    state[UPPER], state[GAIN], state[MEETING] = length, 0, NOTHING


@njit(cache=True, nogil=True, error_model="numpy")
def _left(run, node):
    """What the way in hand, as it was when the search began, costs from one of its cells on."""
    return run.state[UPPER] - (run.prefix[node] - run.state[BASE])


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
def set_out(cost, wall, columns, start, goal, diagonals, run, budget, upper, density, scale):
    """Begin a search for a way that costs less than `upper` and `go_on` with it.

    The way in hand costs as much; if that is `SPAN`, there is none. The search expects `scale`
    times the norm of the density, or the least way if that is 0.
    """
    if scale > 0.0:
        expected_norm(density, scale, diagonals, run.norm)
    else:
        least_norm(diagonals, run.norm)
    begin(cost, columns, start, goal, upper, scale == 0.0, run)
    if upper < SPAN:
        follow_way(cost, wall, columns, run)
    else:
        run.state[COUNT] = 0
    return go_on(cost, wall, columns, start, goal, diagonals, run, budget)


@njit(cache=True, nogil=True, error_model="numpy")
def go_on(cost, wall, columns, start, goal, diagonals, run, budget):
    """Go on with a search as `improving.search` does, and when it is done take up what it found.

    Returns besides what the way costs now, and what any other costs at least if the norm is exact.
    """
    found, taken = search(cost, wall, columns, goal, diagonals, run, budget)
    state = run.state
    if found == DONE and state[MEETING] >= 0:
        take_up(cost, wall, columns, start, diagonals, run)
    return found, taken, state[UPPER] - state[GAIN], state[CURRENT] << state[SHIFT]


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
                piece, _ = way_to(cost, wall, columns, start, goal, diagonals, run)
                _replace(run, first, last, piece)
                last = first + piece.size - 1
        state[POSITION] = last if last == state[COUNT] - 1 else first + max(1, (last - first) // 2)
    return True, expansions
