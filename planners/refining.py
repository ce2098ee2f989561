"""Refining a plan, level by level: the kernels of the paper's ATP. [ZR93 §3.2]"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.frontier import octile, path_to, with_room
from planners.search import WALL
from planners.windows import ENDLESS, IMPASSABLE, YES, ZERO, window_search

CALLED = "6311bb2ea748"

# A plan in refinement. A segment is a row of `segment`; its cells lie in `cell`, flat indices on
# its own level; segments meet in joints, each as fine as the finest segment that it bounds.
LEVEL, FIRST, COUNT, LEFT, RIGHT, NEXT, FINAL, OBSTACLENESS = range(8)
SEGMENTS, JOINTS, CELLS, HEAD_SEGMENT = range(4)
# Positions of a segment; full obstacleness of a cell; cost of an abstract free cell.
POSITIONS = 12
REACH = np.int64(POSITIONS)
FULL = 4096
ABSTRACT = 16
# Abstract cells cost more than a free one nearly everywhere, and an abstract length is a belief:
# the exact A* would spend most of its work on comparing ways that do not really differ.
# At the base level a little greed makes refining cost about the same as at the others [ZR93 §3.3].
ABSTRACT_PERCENT = 130
BASE_PERCENT = 112
# How much wider the window is in which a segment is tried again as a whole when a half has failed.
RETRY = 4


class Refinement(NamedTuple):
    """A multi-path while ATP works on it; see the columns' names above."""

    size: NDArray[np.int64]
    segment: NDArray[np.int32]
    joint: NDArray[np.int32]
    cell: NDArray[np.int32]


class Pyramid(NamedTuple):
    """A domain on all levels: `obstacleness` (0 to FULL) and search `cost`, levels concatenated."""

    obstacleness: NDArray[np.int32]
    cost: NDArray[np.uint8]
    offset: NDArray[np.int64]
    columns: NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def _with_room(rows, used):
    """Return an array with room for more rows after the `used` ones."""
    if used < rows.shape[0]:
        return rows
    more = np.zeros((2 * rows.shape[0], rows.shape[1]), np.int32)
    for row in range(used):
        for column in range(rows.shape[1]):
            more[row, column] = rows[row, column]
    return more


@njit(cache=True, nogil=True, error_model="numpy")
def _mean_obstacleness(pyramid, level, path):
    total, base = 0, pyramid.offset[level]
    for place in range(path.size):
        total += np.int64(pyramid.obstacleness[base + path[place]])
    return total // path.size


@njit(cache=True, nogil=True, error_model="numpy")
def _add_segment(plan, pyramid, level, path, left, right):
    """Append a segment (not yet linked); return (plan, its number)."""
    number, used = np.int64(plan.size[SEGMENTS]), np.int64(plan.size[CELLS])
    segment, cell = _with_room(plan.segment, number), plan.cell
    if used + path.size > cell.size:
        cell = with_room(cell, used, 2 * (used + path.size))
    for place in range(path.size):
        cell[used + place] = path[place]
    segment[number, LEVEL] = level
    segment[number, FIRST] = used
    segment[number, COUNT] = path.size
    segment[number, LEFT] = left
    segment[number, RIGHT] = right
    segment[number, NEXT] = -1
    segment[number, FINAL] = 1 if level == 0 else 0
    segment[number, OBSTACLENESS] = _mean_obstacleness(pyramid, level, path)
    plan.size[SEGMENTS] = number + 1
    plan.size[CELLS] = used + path.size
    return Refinement(plan.size, segment, plan.joint, cell), number


@njit(cache=True, nogil=True, error_model="numpy")
def _add_joint(plan, level, row, column):
    """Append a joint; return (plan, its number)."""
    number = np.int64(plan.size[JOINTS])
    joint = _with_room(plan.joint, number)
    joint[number, 0] = level
    joint[number, 1] = row
    joint[number, 2] = column
    plan.size[JOINTS] = number + 1
    return Refinement(plan.size, plan.segment, joint, plan.cell), number


@njit(cache=True, nogil=True, error_model="numpy")
def _project(plan, number, level, columns):
    """Return the cell of a level that holds the joint, as a flat index."""
    shift = level - np.int64(plan.joint[number, 0])
    return (np.int64(plan.joint[number, 1]) >> shift) * columns + (
        np.int64(plan.joint[number, 2]) >> shift
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _descend(plan, pyramid, number, level, beside, beyond):
    """Bring a joint down to `level`, if it lies above: to its freest child, then the nearest.

    `beside` and `beyond` are the joints before and after it, which "nearest" refers to.
    """
    if plan.joint[number, 0] <= level:
        return
    columns, base = pyramid.columns[level], pyramid.offset[level]
    rows = (pyramid.offset[level + 1] - base) // columns
    best, best_row, best_column = 1 << 60, 0, 0
    for child in range(4):
        row = 2 * np.int64(plan.joint[number, 1]) + (child >> 1)
        column = 2 * np.int64(plan.joint[number, 2]) + (child & 1)
        if row >= rows or column >= columns:
            continue
        detour = 0
        for end in range(2):
            other = beside if end == 0 else beyond
            # In half cells of `level`, from centre to centre.
            size = np.int64(plan.joint[other, 0]) - level
            if size >= 0:
                there_row = (2 * np.int64(plan.joint[other, 1]) + 1) << size
                there_column = (2 * np.int64(plan.joint[other, 2]) + 1) << size
            else:
                there_row = 2 * (np.int64(plan.joint[other, 1]) >> -size) + 1
                there_column = 2 * (np.int64(plan.joint[other, 2]) >> -size) + 1
            detour += octile(2 * row + 1 - there_row, 2 * column + 1 - there_column)
        blocked = np.int64(pyramid.obstacleness[base + row * columns + column])
        worth = (blocked << 40) + detour
        if worth < best:
            best, best_row, best_column = worth, row, column
    plan.joint[number, 0] = level
    plan.joint[number, 1] = best_row
    plan.joint[number, 2] = best_column


@njit(cache=True, nogil=True, error_model="numpy")
def _find(pyramid, level, start, goal, margin, work):
    """The paper's PATH-FINDER: best path between two cells of one level: (path, expansions)."""
    columns, base = pyramid.columns[level], pyramid.offset[level]
    cost = pyramid.cost[base : pyramid.offset[level + 1]]
    rows = cost.size // columns
    row, column = goal // columns, goal % columns
    start_row, start_column = start // columns, start % columns
    box = (
        max(min(row, start_row) - margin, 0),
        max(min(column, start_column) - margin, 0),
        min(max(row, start_row) + margin + 1, rows),
        min(max(column, start_column) + margin + 1, columns),
    )
    floor, percent = (1, BASE_PERCENT) if level == 0 else (ABSTRACT, ABSTRACT_PERCENT)
    target = (row, column, row + 1, column + 1)
    if cost[start] == WALL or cost[goal] == WALL:
        return np.empty(0, np.int32), 0
    found, expansions = window_search(
        cost, IMPASSABLE, columns, start, target, box, YES, percent, floor, ENDLESS, work
    )
    if found < 0:
        return np.empty(0, np.int32), expansions
    return path_to(cost, IMPASSABLE, columns, start, goal, YES, work), expansions


@njit(cache=True, nogil=True, error_model="numpy")
def first_plan(pyramid, level, start, goal, work):
    """SEGMENTIZE the best path at the highest level: (plan, expansions); no segment if none."""
    plan = Refinement(
        np.zeros(4, np.int64),
        np.zeros((64, 8), np.int32),
        np.zeros((64, 3), np.int32),
        np.zeros(1024, np.int32),
    )
    columns, base_columns = pyramid.columns[level], pyramid.columns[0]
    plan, left = _add_joint(plan, ZERO, start // base_columns, start % base_columns)
    plan, last = _add_joint(plan, ZERO, goal // base_columns, goal % base_columns)
    first, end = _project(plan, left, level, columns), _project(plan, last, level, columns)
    path, expansions = _find(pyramid, level, first, end, ENDLESS >> 40, work)
    plan.size[HEAD_SEGMENT] = -1
    before, begin = -1, 0
    while begin < path.size:
        # A segment of POSITIONS cells shares its last cell with the next one's first.
        stop = begin + POSITIONS
        if stop + POSITIONS // 2 > path.size:
            stop = path.size
        right = last
        if stop < path.size:
            row, column = path[stop - 1] // columns, path[stop - 1] % columns
            plan, right = _add_joint(plan, level, row, column)
        plan, number = _add_segment(plan, pyramid, level, path[begin:stop], left, right)
        if before < 0:
            plan.size[HEAD_SEGMENT] = number
        else:
            plan.segment[before, NEXT] = number
        before, left = number, right
        begin = stop - 1 if stop < path.size else stop
    return plan, expansions


@njit(cache=True, nogil=True, error_model="numpy")
def _worst(plan):
    """Return the segment most blocked, weighted by its size, or -1 where none is refinable."""
    worst, most, number = -1, -1, np.int64(plan.size[HEAD_SEGMENT])
    while number >= 0:
        if plan.segment[number, FINAL] == 0:
            blocked = (1 + np.int64(plan.segment[number, OBSTACLENESS])) << plan.segment[
                number, LEVEL
            ]
            if blocked > most:
                worst, most = number, blocked
        number = np.int64(plan.segment[number, NEXT])
    return worst


@njit(cache=True, nogil=True, error_model="numpy")
def refine(plan, pyramid, grain, work):
    """REFINE the WORST-SEGMENT until `grain` expansions are spent: (plan, expansions, done).

    Where a half has no path one level down the whole is tried in a wider window; what then still
    has none stays as it is and is never tried again.
    """
    expansions = 0
    while expansions < grain:
        worst = _worst(plan)
        if worst < 0:
            return plan, expansions, True
        level, count = np.int64(plan.segment[worst, LEVEL]), np.int64(plan.segment[worst, COUNT])
        first, after = np.int64(plan.segment[worst, FIRST]), np.int64(plan.segment[worst, NEXT])
        left, right = np.int64(plan.segment[worst, LEFT]), np.int64(plan.segment[worst, RIGHT])
        halves, middle = 1, right
        if count > POSITIONS // 2 + 1:
            halves = 2
            split, columns = np.int64(plan.cell[first + count // 2]), pyramid.columns[level]
            plan, middle = _add_joint(plan, level, split // columns, split % columns)
        _descend(plan, pyramid, left, level - 1, left, middle)
        _descend(plan, pyramid, right, level - 1, middle, right)
        if halves == 2:
            _descend(plan, pyramid, middle, level - 1, left, right)
        columns = pyramid.columns[level - 1]
        ends = (
            _project(plan, left, level - 1, columns),
            _project(plan, middle, level - 1, columns),
            _project(plan, right, level - 1, columns),
        )
        path, taken = _find(pyramid, level - 1, ends[0], ends[1], REACH, work)
        expansions += taken
        rest = path
        if halves == 2:
            rest, taken = _find(pyramid, level - 1, ends[1], ends[2], REACH, work)
            expansions += taken
        if path.size == 0 or rest.size == 0:
            # The joint between the halves may lie in a pocket, or the way round be long.
            whole, taken = _find(pyramid, level - 1, ends[0], ends[2], RETRY * REACH, work)
            expansions += taken
            if whole.size > 0:
                path, middle, halves = whole, right, 1
        before = worst
        for half in range(halves):
            one, other = left if half == 0 else middle, right if half == halves - 1 else middle
            if half == 1:
                path = rest
            if path.size > 0:
                plan, number = _add_segment(plan, pyramid, level - 1, path, one, other)
            else:
                begin = first if half == 0 else first + count // 2
                stop = first + count if half == halves - 1 else first + count // 2 + 1
                kept = plan.cell[begin:stop].copy()
                plan, number = _add_segment(plan, pyramid, level, kept, one, other)
                plan.segment[number, FINAL] = 1
            if half == 0:
                # The first half takes the parent's place, so that whoever links to it still does.
                for column in range(plan.segment.shape[1]):
                    plan.segment[worst, column] = plan.segment[number, column]
            else:
                plan.segment[before, NEXT] = number
                before = number
        plan.segment[before, NEXT] = after
    return plan, expansions, _worst(plan) < 0
