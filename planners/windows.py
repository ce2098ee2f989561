"""Searches inside a window of a grid of soft costs, and what drives them: walking and refining.

`cost` is flat bytes, `wall` is impassable, every other value is at least 1. A step costs 10 000
straight and 14 142 diagonally, times the dearest cell it sweeps; a diagonal sweeps both orthogonal
cells, so corners are never cut. No search touches a cell outside its window.

The kernels share this file because numba's cache does not see a callee change in another file.
"""

import numpy as np
from numba import njit

from planners.search import (
    CLOSED,
    DIAGONAL,
    LAST,
    NO_PATH,
    OUT_OF_BUDGET,
    SPAN,
    STRAIGHT,
    UNLIMITED,
    WALL,
)


@njit(cache=True, nogil=True, error_model="numpy")
def octile(rows, columns):
    """Return the length of the shortest 8-connected way over a free rectangle."""
    rows, columns = abs(rows), abs(columns)
    if rows > columns:
        return STRAIGHT * rows + (DIAGONAL - STRAIGHT) * columns
    return STRAIGHT * columns + (DIAGONAL - STRAIGHT) * rows


@njit(cache=True, nogil=True, error_model="numpy")
def next_base(work):
    """Start a generation of labels that all earlier ones lie below."""
    if work.clock[0] >= LAST:
        work.label[:] = 0
        work.clock[0] = 0
    work.clock[0] += SPAN
    return work.clock[0]


@njit(cache=True, nogil=True, error_model="numpy")
def _before(one, other, key, label):
    """Tell whether the heap serves `one` first: lower f, then greater g (a lower label)."""
    a, b = key[one], key[other]
    return a < b or (a == b and label[one] < label[other])


@njit(cache=True, nogil=True, error_model="numpy")
def _sift_up(place, node, heap, slot, key, label):
    """Move `node` up from `place`; `slot` is each node's place in the heap."""
    while place > 0:
        parent = int(heap[(place - 1) >> 1])
        if not _before(node, parent, key, label):
            break
        heap[place] = parent
        slot[parent] = place
        place = (place - 1) >> 1
    heap[place] = node
    slot[node] = place


@njit(cache=True, nogil=True, error_model="numpy")
def _pop(size, heap, slot, key, label):
    """Take the first node from a heap of `size`; the heap then holds one less."""
    first, node, place = int(heap[0]), int(heap[size - 1]), 0
    size -= 1
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and _before(int(heap[child + 1]), int(heap[child]), key, label):
            child += 1
        moved = int(heap[child])
        if not _before(moved, node, key, label):
            break
        heap[place] = moved
        slot[moved] = place
        place = child
    if size > 0:
        heap[place] = node
        slot[node] = place
    slot[first] = CLOSED
    return first


@njit(cache=True, nogil=True, error_model="numpy")
def step_cost(cost, wall, columns, node, dr, dc):
    """Return what the step (dr, dc) costs, or 0 where it is not allowed (the map's edge apart)."""
    there = node + dr * columns + dc
    dearest = int(cost[there])
    if dearest == wall:
        return 0
    if dr == 0 or dc == 0:
        return STRAIGHT * dearest
    beside, below = int(cost[node + dc]), int(cost[node + dr * columns])
    if beside == wall or below == wall:
        return 0
    return DIAGONAL * max(dearest, beside, below)


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
    label, key, heap, slot = work.label, work.key, work.after, work.before
    label[start] = base
    key[start] = 0
    heap[0] = start
    slot[start] = 0
    size, expansions = 1, 0
    while size > 0:
        node = _pop(size, heap, slot, key, label)
        size -= 1
        row, column = node // columns, node % columns
        if goal_top <= row < goal_bottom and goal_left <= column < goal_right:
            return node, expansions
        if expansions >= budget:
            return OUT_OF_BUDGET, expansions
        expansions += 1
        g = base - label[node]
        for dr in range(-1, 2):
            if row + dr < top or row + dr >= bottom:
                continue
            for dc in range(-1, 2):
                if column + dc < left or column + dc >= right:
                    continue
                if (dr == 0 and dc == 0) or (not diagonals and dr != 0 and dc != 0):
                    continue
                there = node + dr * columns + dc
                old = label[there]
                known = old > base - SPAN
                if known and slot[there] == CLOSED:
                    continue
                step = step_cost(cost, wall, columns, node, dr, dc)
                if step == 0 or base - g - step <= old:
                    continue
                down = max(goal_top - row - dr, 0, row + dr - goal_bottom + 1)
                across = max(goal_left - column - dc, 0, column + dc - goal_right + 1)
                if diagonals:
                    h = floor * octile(down, across)
                else:
                    h = floor * STRAIGHT * (down + across)
                label[there] = base - g - step
                key[there] = g + step + h * percent // 100
                if known:
                    place = int(slot[there])
                else:
                    place = size
                    size += 1
                _sift_up(place, there, heap, slot, key, label)
    return NO_PATH, expansions


@njit(cache=True, nogil=True, error_model="numpy")
def path_to(cost, wall, columns, start, node, diagonals, work):
    """Read the path from `start` to `node` back from the labels of the last search."""
    rows, base, label = cost.size // columns, work.clock[0], work.label
    path = np.empty(64, np.int32)
    count = 0
    while True:
        if count == path.size:
            longer = np.empty(2 * count, np.int32)
            longer[:count] = path
            path = longer
        path[count] = node
        count += 1
        if node == start:
            return path[:count][::-1].copy()
        row, column = node // columns, node % columns
        best, best_label = node, base - SPAN
        for dr in range(-1, 2):
            if row + dr < 0 or row + dr >= rows:
                continue
            for dc in range(-1, 2):
                if column + dc < 0 or column + dc >= columns:
                    continue
                if (dr == 0 and dc == 0) or (not diagonals and dr != 0 and dc != 0):
                    continue
                there = node + dr * columns + dc
                if label[there] <= label[node]:
                    continue
                step = step_cost(cost, wall, columns, there, -dr, -dc)
                # Every label is the length of a real way, so the best neighbour is closer by it.
                if step > 0 and label[there] - step > best_label:
                    best, best_label = there, label[there] - step
        node = best


# How far beyond its ends a window reaches at first, and how much wider the next one is. A target
# of a plan is given up after the second window; the goal is given up only after the whole map.
MARGIN, WIDER, ADVICE = 8, 4, 32
REACHED, LEASHED, UNREACHABLE = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def _touch(free, cost, touched, columns, node):
    """Learn the cell the robot stands on and its 8 neighbours for certain."""
    rows, row, column = free.size // columns, node // columns, node % columns
    for there_row in range(max(row - 1, 0), min(row + 2, rows)):
        for there_column in range(max(column - 1, 0), min(column + 2, columns)):
            there = there_row * columns + there_column
            touched[there] = 1
            cost[there] = 1 if free[there] else WALL


@njit(cache=True, nogil=True, error_model="numpy")
def _approach(cost, columns, node, target, is_goal, work):
    """Find a way on the belief from `node` to the target block: (path, empty if none; work)."""
    rows, row, column = cost.size // columns, node // columns, node % columns
    top, left, bottom, right = target
    down, across = max(top - row, 0, row - bottom + 1), max(left - column, 0, column - right + 1)
    ahead = octile(down, across)
    margin, expansions = MARGIN, 0
    while True:
        box = (
            max(min(row, top) - margin, 0),
            max(min(column, left) - margin, 0),
            min(max(row + 1, bottom) + margin, rows),
            min(max(column + 1, right) + margin, columns),
        )
        whole = box[0] == 0 and box[1] == 0 and box[2] == rows and box[3] == columns
        found, taken = window_search(
            cost, WALL, columns, node, target, box, True, 100, 1, UNLIMITED, work
        )
        expansions += taken
        last = whole or (not is_goal and margin >= ADVICE)
        # A way that is hardly longer than the straight one is not beaten outside the window.
        if found >= 0 and (
            last or work.clock[0] - work.label[found] <= ahead + 2 * margin * STRAIGHT
        ):
            return path_to(cost, WALL, columns, node, found, True, work), expansions
        if last:
            return np.empty(0, np.int32), expansions
        margin *= WIDER


@njit(cache=True, nogil=True, error_model="numpy")
def walk(free, cost, touched, columns, plan, start, goal, limit, work):
    """Follow a plan by touch: (path, REACHED or LEASHED or UNREACHABLE, expansions).

    The belief `cost` and `touched` are updated in place. Every failed leg has touched a blocked
    cell that was believed passable, so the walk ends.
    """
    rows, count = free.size // columns, plan.shape[0]
    path = np.empty(64, np.int32)
    path[0] = start
    steps, length, expansions, following, reopened = 1, 0, 0, 0, False
    node = start
    _touch(free, cost, touched, columns, node)
    while node != goal:
        top, left = goal // columns, goal % columns
        bottom, right = top + 1, left + 1
        is_goal = True
        while following < count:
            level = int(plan[following, 0])
            top, left = int(plan[following, 1]) << level, int(plan[following, 2]) << level
            bottom, right = min(top + (1 << level), rows), min(left + (1 << level), columns)
            row, column = node // columns, node % columns
            here = top <= row < bottom and left <= column < right
            outside = top < 0 or left < 0 or top >= rows or left >= columns
            if not (here or outside or (level == 0 and cost[top * columns + left] == WALL)):
                is_goal = False
                break
            following += 1
        if is_goal:
            top, left = goal // columns, goal % columns
            bottom, right = top + 1, left + 1
        down, across = top - node // columns, left - node % columns
        adjacent = bottom - top == 1 and right - left == 1 and abs(down) <= 1 and abs(across) <= 1
        if adjacent and step_cost(cost, WALL, columns, node, down, across) > 0:
            leg = np.empty(2, np.int32)
            leg[1] = top * columns + left
        else:
            target = (top, left, bottom, right)
            leg, taken = _approach(cost, columns, node, target, is_goal, work)
            expansions += taken
        if leg.size == 0 and not is_goal:
            following += 1
            continue
        if leg.size == 0:
            if reopened:
                return path[:steps].copy(), UNREACHABLE, expansions
            # Only what was touched is certain: try everything else before saying so.
            for there in range(cost.size):
                if cost[there] == WALL and touched[there] == 0:
                    cost[there] = WALL - 1
            reopened = True
            continue
        for place in range(1, leg.size):
            there = int(leg[place])
            down, across = there // columns - node // columns, there % columns - node % columns
            if step_cost(cost, WALL, columns, node, down, across) == 0:
                break
            step = STRAIGHT if down == 0 or across == 0 else DIAGONAL
            if length + step > limit:
                return path[:steps].copy(), LEASHED, expansions
            length += step
            node = there
            _touch(free, cost, touched, columns, node)
            if steps == path.size:
                longer = np.empty(2 * steps, np.int32)
                longer[:steps] = path
                path = longer
            path[steps] = node
            steps += 1
            if node == goal:
                break
    return path[:steps].copy(), REACHED, expansions
