"""Following a plan by touch: what a robot does that knows its surroundings only by bumping."""

import numpy as np

from anytime.machine_code import njit
from planners.frontier import octile, path_to, step_cost, with_room
from planners.search import DIAGONAL, STRAIGHT, WALL
from planners.windows import CHEAPEST, ENDLESS, EXACT, IMPASSABLE, YES, window_search

CALLED = "6311bb2ea748"

# How far beyond its ends a window reaches at first, and how much wider the next one is. A target
# of a plan is given up after the second window; the goal is given up only after the whole map.
MARGIN, WIDER, ADVICE = 8, 4, 32
REACHED, LEASHED, UNREACHABLE = 0, 1, 2
# What a cell costs that is as likely free as blocked.
EVEN_ODDS = 5


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
def _doubtful(cost, columns, path, longest):
    """Tell whether a path is longer than that or goes through what is believed an obstacle."""
    length = 0
    for place in range(1, path.size):
        before, node = path[place - 1], path[place]
        if cost[node] > EVEN_ODDS:
            return True
        straight = before // columns == node // columns or before % columns == node % columns
        length += STRAIGHT if straight else DIAGONAL
    return length > longest


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
            cost, IMPASSABLE, columns, node, target, box, YES, EXACT, CHEAPEST, ENDLESS, work
        )
        expansions += taken
        last = whole or (not is_goal and margin >= ADVICE)
        if found >= 0:
            path = path_to(cost, IMPASSABLE, columns, node, found, YES, work)
            # What lies outside the window matters only to a long detour or a believed obstacle.
            if last or not _doubtful(cost, columns, path, ahead + 2 * margin * STRAIGHT):
                return path, expansions
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
        # An abstract cell is advice: aim at the next but one, which smooths the way.
        if not is_goal and level > 0 and following + 1 < count and plan[following + 1, 0] == level:
            following += 1
            top, left = int(plan[following, 1]) << level, int(plan[following, 2]) << level
            bottom, right = min(top + (1 << level), rows), min(left + (1 << level), columns)
        if is_goal:
            top, left = goal // columns, goal % columns
            bottom, right = top + 1, left + 1
        down, across = top - node // columns, left - node % columns
        adjacent = bottom - top == 1 and right - left == 1 and abs(down) <= 1 and abs(across) <= 1
        if adjacent and step_cost(cost, IMPASSABLE, columns, node, down, across) > 0:
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
            there = np.int64(leg[place])
            down, across = there // columns - node // columns, there % columns - node % columns
            if step_cost(cost, IMPASSABLE, columns, node, down, across) == 0:
                break
            step = STRAIGHT if down == 0 or across == 0 else DIAGONAL
            if length + step > limit:
                return path[:steps].copy(), LEASHED, expansions
            length += step
            node = there
            _touch(free, cost, touched, columns, node)
            if steps == path.size:
                path = with_room(path, steps, 2 * steps)
            path[steps] = node
            steps += 1
            if node == goal:
                break
    return path[:steps].copy(), REACHED, expansions
