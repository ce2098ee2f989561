"""The search inside a window of a grid of soft costs.

`cost` is flat bytes, `wall` is impassable, every other value is at least 1. A step costs 10 000
straight and 14 142 diagonally, times the dearest cell it sweeps; a diagonal sweeps both orthogonal
cells, so corners are never cut. No search touches a cell outside its window.
"""

import numpy as np

from anytime.machine_code import njit
from planners.frontier import next_base, octile, pop, sift_up
from planners.search import (
    CLOSED,
    DIAGONAL,
    NO_PATH,
    OUT_OF_BUDGET,
    SPAN,
    STRAIGHT,
    UNLIMITED,
    WALL,
)

CALLED = "5afabff1aa83"

# numba compiles a callee once more for every literal argument; these are no literals.
YES, ZERO, CHEAPEST, EXACT = np.bool_(True), np.int64(0), np.int64(1), np.int64(100)
IMPASSABLE, ENDLESS = np.int64(WALL), np.int64(UNLIMITED)


@njit(cache=True, nogil=True, error_model="numpy")
def window_search(cost, wall, columns, start, target, box, diagonals, percent, floor, budget, work):
    """Weighted A* inside a window; return (cell reached or NO_PATH or OUT_OF_BUDGET, expansions).

    `target` and `box` are (top, left, bottom, right), the latter two exclusive: any cell of the
    target ends the search, no cell outside the box is looked at. f = g + percent/100 · h, where h
    is octile · `floor`, the cheapest cost of a cell. Each node is closed once, so at 100 % and with
    floor ≤ every cost the path is the shortest, else at most percent/100 times as long.
    """
    top, left, bottom, right = box
    goal_top, goal_left, goal_bottom, goal_right = target
    base = next_base(work)
    label, key, heap, slot = work.label, work.key, work.heap, work.slot
    label[start] = base
    key[start] = 0
    heap[0] = start
    slot[start] = 0
    size, expansions = np.int64(1), 0
    while size > 0:
        node = pop(size, heap, slot, key, label)
        size -= 1
        row, column = node // columns, node % columns
        if goal_top <= row < goal_bottom and goal_left <= column < goal_right:
            return node, expansions
        if expansions >= budget:
            return OUT_OF_BUDGET, expansions
        expansions += 1
        g = base - label[node]
        # Cells outside the window are walls; the orthogonal ones are read once for the diagonals.
        north = int(cost[node - columns]) if row > top else wall
        south = int(cost[node + columns]) if row + 1 < bottom else wall
        west = int(cost[node - 1]) if column > left else wall
        east = int(cost[node + 1]) if column + 1 < right else wall
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
            step = (STRAIGHT if side < 4 else DIAGONAL) * max(swept, one, other)
            old = label[there]
            if base - g - step <= old:
                continue
            known = old > base - SPAN
            if known and slot[there] == CLOSED:
                continue
            down = max(goal_top - row - dr, 0, row + dr - goal_bottom + 1)
            across = max(goal_left - column - dc, 0, column + dc - goal_right + 1)
            if diagonals:
                h = floor * octile(down, across)
            else:
                h = floor * STRAIGHT * (down + across)
            label[there] = base - g - step
            f = g + step + h * percent // 100
            if known:
                place = np.int64(slot[there])
            else:
                place = size
                size += 1
            sift_up(place, there, f, heap, slot, key, label)
    return NO_PATH, expansions
