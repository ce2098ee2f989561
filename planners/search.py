"""The bucket A* on whole maps, and the workspace that it shares with the searches in windows.

A grid is flat bytes in which the value `wall` is impassable; a boolean map viewed as bytes is such
a grid (`wall` = 0). A step costs 10 000 straight and 14 142 diagonally; a diagonal needs both
orthogonal cells free, so corners are never cut. All arithmetic is integer: counts and paths are the
same everywhere.

No search clears anything. A label is `base - g`, and every search takes a `base` that is one
`SPAN` above the last one's, so whatever an earlier search left looks like "not reached". No parent
is stored either: the path is read back from the labels.
"""

from threading import local
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

STRAIGHT, DIAGONAL = 10_000, 14_142
WALL = 255
SPAN = 1 << 44
LAST = 1 << 62
NO_PATH, OUT_OF_BUDGET = -1, -2
UNLIMITED = 1 << 60

# Smaller than the smallest positive step of f (5 858), so that a bucket rarely mixes values of f.
BUCKET_SHIFT = 12
BUCKETS = 16
HEAD, CLOSED = -1, -2


class Workspace(NamedTuple):
    """Arrays that searches reuse; one per thread, for maps of up to `label.size` cells."""

    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    key: NDArray[np.int64]
    after: NDArray[np.int32]
    before: NDArray[np.int32]
    bucket: NDArray[np.int32]


_kept = local()


def workspace(cells: int) -> Workspace:
    """Return this thread's workspace, grown to `cells` cells where it is smaller."""
    kept: Workspace | None = getattr(_kept, "workspace", None)
    if kept is not None and kept.label.size >= cells:
        return kept
    # Zeroed pages are only committed when touched, so a small query on a large map costs nothing.
    _kept.workspace = Workspace(
        clock=np.zeros(1, np.int64),
        label=np.zeros(cells, np.int64),
        key=np.zeros(cells, np.int64),
        after=np.zeros(cells, np.int32),
        before=np.zeros(cells, np.int32),
        bucket=np.zeros(BUCKETS, np.int32),
    )
    return _kept.workspace


@njit(cache=True, nogil=True, error_model="numpy")
def _link(node, f, after, before, bucket):
    head = int(bucket[(f >> BUCKET_SHIFT) & (BUCKETS - 1)])
    after[node] = head
    before[node] = HEAD
    if head >= 0:
        before[head] = node
    bucket[(f >> BUCKET_SHIFT) & (BUCKETS - 1)] = node


@njit(cache=True, nogil=True, error_model="numpy")
def _unlink(node, f, after, before, bucket):
    behind, ahead = int(after[node]), int(before[node])
    if behind >= 0:
        before[behind] = ahead
    if ahead >= 0:
        after[ahead] = behind
    else:
        bucket[(f >> BUCKET_SHIFT) & (BUCKETS - 1)] = behind


@njit(cache=True, nogil=True, error_model="numpy")
def bucket_search(cost, wall, columns, start, goal, diagonals, budget, work):
    """A* over cells of equal cost; return (g at the goal or NO_PATH or OUT_OF_BUDGET, expansions).

    Label-correcting with last-in-first-out buckets: a bucket may hold several values of f, so a
    node may be expanded twice, and a label of the goal prunes everything that cannot beat it.
    """
    rows = cost.size // columns
    goal_row, goal_column = goal // columns, goal % columns
    # Without diagonals a step sideways costs as much as one ahead: the heuristic is Manhattan's.
    minor = DIAGONAL - STRAIGHT if diagonals else STRAIGHT
    if work.clock[0] >= LAST:
        work.label[:] = 0
        work.clock[0] = 0
    work.clock[0] += SPAN
    base = work.clock[0]
    # Arrays are taken out of the tuple once: inside the loop that would count references.
    label, after, before, bucket = work.label, work.after, work.before, work.bucket
    bucket[:] = HEAD
    row, column = start // columns, start % columns
    down, across = abs(row - goal_row), abs(column - goal_column)
    f = STRAIGHT * max(down, across) + minor * min(down, across)
    label[start] = base
    _link(start, f, after, before, bucket)
    upper, expansions, opened, current = SPAN, 0, 1, f >> BUCKET_SHIFT
    while opened > 0:
        node = int(bucket[current & (BUCKETS - 1)])
        if node < 0:
            current += 1
            continue
        if current << BUCKET_SHIFT >= upper:
            break
        _unlink(node, current << BUCKET_SHIFT, after, before, bucket)
        before[node] = CLOSED
        opened -= 1
        g = base - label[node]
        row, column = node // columns, node % columns
        down, across = row - goal_row, column - goal_column
        near, far = abs(down), abs(across)
        if near > far:
            near, far = far, near
        if g + STRAIGHT * far + minor * near >= upper:
            continue
        if expansions >= budget:
            return OUT_OF_BUDGET, expansions
        expansions += 1
        north = row > 0 and cost[node - columns] != wall
        south = row + 1 < rows and cost[node + columns] != wall
        west = column > 0 and cost[node - 1] != wall
        east = column + 1 < columns and cost[node + 1] != wall
        for side in range(8):
            if side < 4:
                if side == 0:
                    usable, dr, dc = north, -1, 0
                elif side == 1:
                    usable, dr, dc = south, 1, 0
                elif side == 2:
                    usable, dr, dc = west, 0, -1
                else:
                    usable, dr, dc = east, 0, 1
                step = STRAIGHT
            else:
                if side == 4:
                    usable, dr, dc = diagonals and north and west, -1, -1
                elif side == 5:
                    usable, dr, dc = diagonals and north and east, -1, 1
                elif side == 6:
                    usable, dr, dc = diagonals and south and west, 1, -1
                else:
                    usable, dr, dc = diagonals and south and east, 1, 1
                step = DIAGONAL
            if not usable:
                continue
            there = node + dr * columns + dc
            old, new = label[there], base - g - step
            if new <= old or (side >= 4 and cost[there] == wall):
                continue
            near, far = abs(down + dr), abs(across + dc)
            if near > far:
                near, far = far, near
            h = STRAIGHT * far + minor * near
            if g + step + h >= upper:
                continue
            if old > base - SPAN and before[there] != CLOSED:
                _unlink(there, base - old + h, after, before, bucket)
            else:
                opened += 1
            label[there] = new
            _link(there, g + step + h, after, before, bucket)
        if label[goal] > base - SPAN:
            upper = base - label[goal]
    if upper == SPAN:
        return NO_PATH, expansions
    return upper, expansions
