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
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.arrays import zeroed

STRAIGHT, DIAGONAL = 10_000, 14_142
WALL = 255
SPAN = 1 << 44
LAST = 1 << 62
NO_PATH, OUT_OF_BUDGET = -1, -2
UNLIMITED = 1 << 60

# Smaller than the smallest positive step of f (5 858), so that a bucket rarely mixes values of f.
BUCKET_SHIFT = 12
BUCKETS = 16
NOTHING, CLOSED = -1, -2
ENTRIES = 8
"""Entries that a node can have in the buckets at once: f rises by less than so many of them."""


# The sides of a cell, orthogonal ones first. A set of them is a byte.
DOWN = np.array([-1, 1, 0, 0, -1, -1, 1, 1])
ACROSS = np.array([0, 0, -1, 1, -1, 1, -1, 1])
STEP = np.array([STRAIGHT] * 4 + [DIAGONAL] * 4)
PARTS = ((0,), (1,), (2,), (3,), (0, 2), (0, 3), (1, 2), (1, 3))
"""The orthogonal sides that a step to a side goes by."""
FIRST = np.array([(sides & -sides).bit_length() - 1 for sides in range(256)], np.int8)
SIDE_BITS, ANY_SIDE, SET_OUT = 4, 15, 8
"""A node is known by its bucket and the side to which its way came; the start came to none."""


def _onward(diagonals: bool) -> NDArray[np.uint8]:
    """Where a way goes on: by the side to which it came and the free sides, flat [9, 256], sides.

    All others are reached as cheaply past the node, from the one before it, and straight steps
    come last on equal ways [Harabor & Grastien 2011, pruned neighbours, where no corner is cut].
    """
    steps = zip(DOWN.tolist(), ACROSS.tolist(), strict=True)
    side_of = {(down, across): side for side, (down, across) in enumerate(steps)}
    onward = np.zeros((SET_OUT + 1, 256), np.uint8)
    for free in range(256):
        usable = {
            side
            for side in range(8 if diagonals else 4)
            if all(free >> part & 1 for part in (side, *PARTS[side]))
        }
        for came in range(SET_OUT + 1):
            wanted = usable
            if diagonals and came != SET_OUT:
                wanted = {came, *PARTS[came]}
                down, across = int(DOWN[came]), int(ACROSS[came])
                for turn in (across, down), (-across, -down):
                    behind = side_of.get((turn[0] - down, turn[1] - across))
                    if came < 4 and behind is not None and not free >> behind & 1:
                        wanted |= {side_of[turn], side_of[turn[0] + down, turn[1] + across]}
            onward[came, free] = sum(1 << side for side in wanted & usable)
    return onward.reshape(-1)


FOUR_WAYS, EIGHT_WAYS = _onward(False), _onward(True)


class Workspace(NamedTuple):
    """Arrays that searches reuse; one per thread, for maps of up to `label.size` cells.

    The bucket search keeps the bucket of each node and its side in `slot`, and its entries, chained
    in their buckets, in `entry` and `behind`.
    """

    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    key: NDArray[np.int64]
    heap: NDArray[np.int32]
    slot: NDArray[np.int32]
    entry: NDArray[np.int32]
    behind: NDArray[np.int32]
    bucket: NDArray[np.int32]


_kept = local()


def workspace(cells: int) -> Workspace:
    """Return this thread's workspace, grown to `cells` cells where it is smaller."""
    kept: Workspace | None = getattr(_kept, "workspace", None)
    if kept is not None and kept.label.size >= cells:
        return kept
    # Zeroed pages are only committed when touched, so a small query on a large map costs nothing.
    _kept.workspace = Workspace(
        **zeroed(
            clock=(1, np.int64),
            label=(cells, np.int64),
            key=(cells, np.int64),
            heap=(cells, np.int32),
            slot=(cells, np.int32),
            entry=(ENTRIES * cells, np.int32),
            behind=(ENTRIES * cells, np.int32),
            bucket=(BUCKETS, np.int32),
        )
    )
    return _kept.workspace


@njit(cache=True, nogil=True, error_model="numpy")
def bucket_search(cost, wall, columns, start, goal, diagonals, budget, work):
    """A* over cells of equal cost; return (g at the goal or NO_PATH or OUT_OF_BUDGET, expansions).

    Label-correcting with last-in-first-out buckets: a bucket may hold several values of f, so a
    node may be expanded twice, and a label of the goal prunes everything that cannot beat it. A
    node whose f falls into another bucket gets another entry there, and the old one is passed over
    when it comes up: that is twice as fast as to unlink it. A way goes on to the sides that
    `_onward` tells, which spares most looks at labels.
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
    label, slot, bucket = work.label, work.slot, work.bucket
    entry, behind = work.entry, work.behind
    bucket[:] = NOTHING
    row, column = start // columns, start % columns
    down, across = abs(row - goal_row), abs(column - goal_column)
    current = (STRAIGHT * max(down, across) + minor * min(down, across)) >> BUCKET_SHIFT
    label[start], slot[start] = base, current << SIDE_BITS | SET_OUT
    entry[0], behind[0], bucket[current & (BUCKETS - 1)] = start, NOTHING, 0
    apart = np.empty(8, np.int64)
    for side in range(8):
        apart[side] = DOWN[side] * columns + ACROSS[side]
    onward = EIGHT_WAYS if diagonals else FOUR_WAYS
    inverse = 1.0 / columns  # a division of integers would take a third of the time
    upper, expansions, opened, fresh, unused = SPAN, 0, 1, np.int64(1), np.int64(NOTHING)
    while opened > 0:
        place = np.int64(bucket[current & (BUCKETS - 1)])
        if place < 0:
            current += 1
            continue
        if current << BUCKET_SHIFT >= upper:
            break
        bucket[current & (BUCKETS - 1)] = behind[place]
        behind[place], unused = unused, place
        opened -= 1
        node = np.int64(entry[place])
        if slot[node] >> SIDE_BITS != current:
            continue
        came = np.int64(slot[node] & ANY_SIDE)
        slot[node] = CLOSED
        g = base - label[node]
        row = int((node + 0.5) * inverse)
        column = node - row * columns
        down, across = row - goal_row, column - goal_column
        near, far = abs(down), abs(across)
        if near > far:
            near, far = far, near
        if g + STRAIGHT * far + minor * near >= upper:
            continue
        if expansions >= budget:
            return OUT_OF_BUDGET, expansions
        expansions += 1
        inside = 0 < row < rows - 1 and 0 < column < columns - 1
        free = 0
        for side in range(8):
            there_row, there_column = row + DOWN[side], column + ACROSS[side]
            if inside or (0 <= there_row < rows and 0 <= there_column < columns):
                free |= int(cost[node + apart[side]] != wall) << side
        wanted = np.int64(onward[came * 256 + free])
        while wanted:
            side = np.int64(FIRST[wanted])
            wanted &= wanted - 1
            there = node + apart[side]
            old, new = label[there], base - g - STEP[side]
            if new <= old:
                continue
            near, far = abs(down + DOWN[side]), abs(across + ACROSS[side])
            if near > far:
                near, far = far, near
            f = g + STEP[side] + STRAIGHT * far + minor * near
            if f >= upper:
                continue
            label[there] = new
            there_bucket = f >> BUCKET_SHIFT
            queued = old > base - SPAN and slot[there] >> SIDE_BITS == there_bucket
            slot[there] = there_bucket << SIDE_BITS | side
            if queued:
                continue
            if unused >= 0:
                place, unused = unused, np.int64(behind[unused])
            else:
                place = fresh
                fresh += 1
            head = there_bucket & (BUCKETS - 1)
            entry[place], behind[place], bucket[head] = there, bucket[head], place
            opened += 1
        if label[goal] > base - SPAN:
            upper = base - label[goal]
    if upper == SPAN:
        return NO_PATH, expansions
    return upper, expansions
