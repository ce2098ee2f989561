"""A way that is made shorter: best-first search in a corridor around it, and in windows along it.

A search gives its time back after any number of expansions and goes on later. It knows the way in
hand: nothing is expanded that cannot beat it, and where the search comes to a cell of that way more
cheaply than the way itself, the way is shorter from then on, long before the search ends.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planners.frontier import least_way, next_base, path_to, pop, sift_up, step_cost, with_room
from planners.search import CLOSED, DIAGONAL, LAST, NO_PATH, OUT_OF_BUDGET, SPAN, STRAIGHT

FRONTIER = "84699215c6e2"

FOUND = 0
SIZE, BASE, UPPER, GAIN, MEETING, CONFINED, FOLLOWS = range(7)
PERCENT, LOWEST, COUNT, POSITION = range(7, 11)
"""State of a search: nodes in the heap; base of its labels; cost of the way in hand; by how much it
is beaten, and at which cell; whether a corridor confines it, and whether it knows the way's cost up
to each cell; its weight; the least f taken so far. Of the way: its cells; where the next window
begins."""
BLOCK_SHIFT = 3
"""A corridor is made of blocks of 8 x 8 cells."""
_WEIGHT_SHIFT = 16
WINDOW_BUDGET = 4000
"""Expansions after which a window is given up."""


class Run(NamedTuple):
    """Arrays of one planner at work. They are zeroed pages until they are touched.

    Of every cell: label (`base` - g), its slot in the heap, prefix (`base` + cost of the way
    in hand up to the cell). heap, key: nodes and their f. mark: of every block, the base of the
    search whose corridor it is in. path: flat indices of the way in hand.
    """

    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    key: NDArray[np.int64]
    heap: NDArray[np.int32]
    slot: NDArray[np.int32]
    prefix: NDArray[np.int64]
    mark: NDArray[np.int64]
    path: NDArray[np.int32]
    state: NDArray[np.int64]


def new_run(rows: int, columns: int) -> Run:
    """Arrays for a map of that size."""
    cells, across = rows * columns, 1 << BLOCK_SHIFT
    blocks = -(-rows // across) * -(-columns // across)
    return Run(
        clock=np.zeros(1, np.int64),
        label=np.zeros(cells, np.int64),
        key=np.zeros(cells, np.int64),
        heap=np.zeros(cells, np.int32),
        slot=np.zeros(cells, np.int32),
        prefix=np.zeros(cells, np.int64),
        mark=np.zeros(blocks, np.int64),
        path=np.zeros(cells + 1, np.int32),
        state=np.zeros(11, np.int64),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def begin(start, percent, upper, run):
    """Begin a search whose result must cost less than `upper`."""
    if run.clock[0] >= LAST:  # the labels are about to be cleared: these go by the same bases
        run.prefix[:] = 0
        run.mark[:] = 0
    base = next_base(run)
    run.state[SIZE], run.state[BASE] = 1, base
    run.state[UPPER], run.state[GAIN], run.state[MEETING] = upper, 0, -1
    run.state[CONFINED], run.state[FOLLOWS] = 0, 0
    run.state[PERCENT], run.state[LOWEST] = percent, 0
    run.label[start] = base
    run.key[0] = 0
    run.heap[0] = start
    run.slot[start] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def search(cost, wall, columns, start, goal, diagonals, floor, run, budget):
    """Go on with the search; return (FOUND or NO_PATH or OUT_OF_BUDGET, expansions).

    f = g + percent/100 · h, where h is the least way · `floor`, the cheapest cost of a cell. Each
    node is closed once, so at 100 % the result is the shortest in the corridor; NO_PATH says that
    nothing beats the way in hand, as it is after `GAIN`.
    """
    # Arrays are taken out of the tuple once: inside the loop that would count references.
    state, label, key, heap, slot = run.state, run.label, run.key, run.heap, run.slot
    prefix, mark, follows = run.prefix, run.mark, state[FOLLOWS] != 0
    rows, across = cost.size // columns, (columns + (1 << BLOCK_SHIFT) - 1) >> BLOCK_SHIFT
    base, percent, confined = state[BASE], state[PERCENT], state[CONFINED] != 0
    weight = (percent << _WEIGHT_SHIFT) // 100  # a division for every node would be felt
    size, upper, expansions = state[SIZE], state[UPPER] - state[GAIN], 0
    goal_row, goal_column = goal // columns, goal % columns
    while size > 0:
        if expansions >= budget:
            state[SIZE] = size
            return OUT_OF_BUDGET, expansions
        f = key[0]
        node = pop(size, heap, slot, key, label)
        size -= 1
        expansions += 1
        g = base - label[node]
        row, column = node // columns, node % columns
        if g + floor * least_way(row - goal_row, column - goal_column, diagonals) >= upper:
            if percent == 100:  # and so have all others
                break
            continue
        if node == goal:
            state[SIZE] = size
            return FOUND, expansions
        if percent == 100:
            state[LOWEST] = max(state[LOWEST], f)
        if follows and prefix[node] >= base and prefix[node] - base - g > state[GAIN]:
            state[GAIN], state[MEETING] = prefix[node] - base - g, node
            upper = state[UPPER] - state[GAIN]
        # Cells off the map are walls; the orthogonal ones are read once for the diagonals.
        north = int(cost[node - columns]) if row > 0 else wall
        south = int(cost[node + columns]) if row + 1 < rows else wall
        west = int(cost[node - 1]) if column > 0 else wall
        east = int(cost[node + 1]) if column + 1 < columns else wall
        for side in range(8 if diagonals else 4):
            if side == 0:
                swept, one, other, dr, dc = north, north, north, -1, 0
            elif side == 1:
                swept, one, other, dr, dc = south, south, south, 1, 0
            elif side == 2:
                swept, one, other, dr, dc = west, west, west, 0, -1
            elif side == 3:
                swept, one, other, dr, dc = east, east, east, 0, 1
            elif side == 4:
                swept, one, other, dr, dc = 0, north, west, -1, -1
            elif side == 5:
                swept, one, other, dr, dc = 0, north, east, -1, 1
            elif side == 6:
                swept, one, other, dr, dc = 0, south, west, 1, -1
            else:
                swept, one, other, dr, dc = 0, south, east, 1, 1
            if one == wall or other == wall:
                continue
            there = node + dr * columns + dc
            if side >= 4:
                swept = int(cost[there])
                if swept == wall:
                    continue
            new_g = g + (STRAIGHT if side < 4 else DIAGONAL) * max(swept, one, other)
            old = label[there]
            if base - new_g <= old:
                continue
            known = old > base - SPAN
            if known and slot[there] == CLOSED:
                continue
            if confined:
                block = ((row + dr) >> BLOCK_SHIFT) * across + ((column + dc) >> BLOCK_SHIFT)
                if mark[block] != base:
                    continue
            h = floor * least_way(row + dr - goal_row, column + dc - goal_column, diagonals)
            if new_g + h >= upper:
                continue
            label[there] = base - new_g
            if known:
                place = np.int64(slot[there])
            else:
                place = size
                size += 1
            f_there = new_g + (h * weight >> _WEIGHT_SHIFT)
            sift_up(place, there, f_there, heap, slot, key, label)
    state[SIZE] = 0
    return NO_PATH, expansions


@njit(cache=True, nogil=True, error_model="numpy")
def reweigh(columns, goal, diagonals, floor, percent, run):
    """Go on with another weight: order the open nodes anew."""
    state, label, key, heap, slot = run.state, run.label, run.key, run.heap, run.slot
    state[PERCENT] = percent
    weight = (percent << _WEIGHT_SHIFT) // 100
    goal_row, goal_column = goal // columns, goal % columns
    for place in range(state[SIZE]):
        node = np.int64(heap[place])
        g = state[BASE] - label[node]
        h = floor * least_way(node // columns - goal_row, node % columns - goal_column, diagonals)
        sift_up(place, node, g + (h * weight >> _WEIGHT_SHIFT), heap, slot, key, label)


@njit(cache=True, nogil=True, error_model="numpy")
def way_cost(cost, wall, columns, path, first, last):
    """Cost of the way from its cell number `first` to its cell number `last`."""
    total = np.int64(0)
    for place in range(first, last):
        node, there = np.int64(path[place]), np.int64(path[place + 1])
        down, across = there // columns - node // columns, there % columns - node % columns
        total += step_cost(cost, wall, columns, node, down, across)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def so_far(cost, wall, columns, start, diagonals, run):
    """The way as the search has made it shorter so far, which still goes on: flat indices."""
    count, node = run.state[COUNT], run.state[MEETING]
    if node < 0:
        return run.path[:count].copy()
    beginning = path_to(cost, wall, columns, start, node, diagonals, run)
    rest = 0
    while run.path[rest] != node:
        rest += 1
    way = with_room(beginning, beginning.size, beginning.size + count - rest - 1)
    for place in range(rest + 1, count):
        way[beginning.size + place - rest - 1] = run.path[place]
    return way


@njit(cache=True, nogil=True, error_model="numpy")
def take_up(cost, wall, columns, start, node, diagonals, run):
    """Take up what the last search found: its way to `node`, and from there on the way in hand.

    Returns the cost of the new way.
    """
    beginning = path_to(cost, wall, columns, start, node, diagonals, run)
    count, rest = run.state[COUNT], 0
    if count == 0 or node == run.path[count - 1]:
        run.path[: beginning.size] = beginning
        run.state[COUNT] = beginning.size
    else:
        while run.path[rest] != node:
            rest += 1
        _replace(run, 0, rest, beginning)
    return way_cost(cost, wall, columns, run.path, 0, run.state[COUNT] - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _replace(run, first, last, piece):
    """Put a piece in the place of the way's cells `first` to `last`."""
    count = run.state[COUNT]
    grown = piece.size - (last - first + 1)
    if grown > 0:
        for place in range(count - 1, last, -1):
            run.path[place + grown] = run.path[place]
    elif grown < 0:
        for place in range(last + 1, count):
            run.path[place + grown] = run.path[place]
    for place in range(piece.size):
        run.path[first + place] = piece[place]
    run.state[COUNT] = count + grown


@njit(cache=True, nogil=True, error_model="numpy")
def follow_way(cost, wall, columns, run):
    """Tell the search that has begun what the way in hand costs up to each of its cells."""
    total, base = np.int64(0), run.state[BASE]
    run.state[FOLLOWS] = 1
    run.prefix[run.path[0]] = base
    for place in range(run.state[COUNT] - 1):
        total += way_cost(cost, wall, columns, run.path, place, place + 1)
        run.prefix[run.path[place + 1]] = base + total


@njit(cache=True, nogil=True, error_model="numpy")
def confine(rows, columns, radius, run):
    """Confine the search that has begun to the blocks at most `radius` steps from the way in hand.

    Returns how many blocks were touched.
    """
    high = (rows + (1 << BLOCK_SHIFT) - 1) >> BLOCK_SHIFT
    wide = (columns + (1 << BLOCK_SHIFT) - 1) >> BLOCK_SHIFT
    base, touched, before = run.state[BASE], 0, -1
    run.state[CONFINED] = 1
    for place in range(run.state[COUNT]):
        node = np.int64(run.path[place])
        row, column = (node // columns) >> BLOCK_SHIFT, (node % columns) >> BLOCK_SHIFT
        if row * wide + column == before:
            continue
        before = row * wide + column
        for r in range(max(row - radius, 0), min(row + radius + 1, high)):
            left = radius - abs(r - row)
            for c in range(max(column - left, 0), min(column + left + 1, wide)):
                touched += 1
                run.mark[r * wide + c] = base
    return touched


@njit(cache=True, nogil=True, error_model="numpy")
def improve_windows(cost, wall, columns, length, diagonals, floor, run, budget):
    """Make the way in hand the shortest in windows of `length` cells, half of each in the next.

    Returns (done, expansions). A window that is as short as can be costs nothing.
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
        if before > floor * least_way(down, across, diagonals):
            begin(start, 100, before, run)
            found, taken = search(
                cost, wall, columns, start, goal, diagonals, floor, run, WINDOW_BUDGET
            )
            expansions += taken
            if found == FOUND:
                piece = path_to(cost, wall, columns, start, goal, diagonals, run)
                _replace(run, first, last, piece)
                last = first + piece.size - 1
        state[POSITION] = last if last == state[COUNT] - 1 else first + max(1, (last - first) // 2)
    return True, expansions
