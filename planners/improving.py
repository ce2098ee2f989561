"""Best-first search for a way that beats the one in hand.

A search gives its time back after any number of expansions and goes on later. It knows the way in
hand: nothing is expanded that cannot beat it, and where the search comes to a cell of that way more
cheaply than the way itself, the way is shorter from then on, long before the search ends.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.arrays import zeroed
from planners.prefetching import prefetch
from planners.search import (
    ACROSS,
    DIAGONAL,
    DOWN,
    EIGHT_WAYS,
    FIRST,
    FOUR_WAYS,
    OUT_OF_BUDGET,
    SET_OUT,
    STEP,
    STRAIGHT,
    WALL,
)

CALLED = "9e017e1483df"

DONE = 0
BUCKETS = 1 << 13
BASE, SHIFT, CURRENT, LOW, HIGH, OPENED, FRESH, UNUSED = range(8)
EXACT, FOLLOWS, UPPER, GAIN, MEETING, COUNT, POSITION, CLOCK = range(8, 16)
"""State of a search: base of its labels; width of a bucket, as a shift; the bucket at work, the
lowest and the highest used; entries in all of them; the first entry never used, the first given
back. Whether its norm is a lower bound; whether it knows the way's cost up to each cell; cost of
the way in hand; by how much it is beaten, and at which cell. Of the way: its cells; where the next
window begins. Up to where bases have been used."""
NOTHING = -1
CELL, AFTER = 0, 1  # columns of `Run.entry`
CLOSED, SIDE, LENGTH = 1, 1, 4
"""A label's lowest bit is set when the cell is closed. Above it is the side to which its way came,
and from bit `LENGTH` on `base` - g."""
_LAST = 1 << 58
_NARROW = 12  # 4 096 is less than the smallest positive step of f on a free floor
_ENTRIES = 8
_AHEAD = 6  # cells: what the search is likely to come to while it is loaded


class Run(NamedTuple):
    """Arrays of one planner at work. They are zeroed pages until they are touched.

    Of every cell: label (see `LENGTH`; one array, for to look at it costs more than to take it
    apart), prefix (`base` + cost of the way in hand up to the cell). bucket: the first entry of
    each. entry: its cell and the entry after it. norm: the heuristic, see
    `estimated`. path: flat indices of the way in hand.
    """

    label: NDArray[np.int64]
    prefix: NDArray[np.int64]
    bucket: NDArray[np.int32]
    entry: NDArray[np.int32]
    norm: NDArray[np.int64]
    path: NDArray[np.int32]
    state: NDArray[np.int64]


def new_run(rows: int, columns: int) -> Run:
    """Arrays for a map of that size."""
    cells = rows * columns
    run = Run(
        **zeroed(
            label=(cells, np.int64),
            prefix=(cells, np.int64),
            bucket=(BUCKETS, np.int32),
            entry=((_ENTRIES * cells, 2), np.int32),
            norm=(6, np.int64),
            path=(cells + 1, np.int32),
            state=(16, np.int64),
        )
    )
    run.bucket[:] = NOTHING
    run.state[MEETING] = NOTHING
    return run


@njit(cache=True, nogil=True, error_model="numpy")
def estimated(rows, columns, norm):
    """What a way costs by a norm: the greatest of three sums `norm[2i]` · far + `norm[2i+1]` · near
    over the greater and the smaller of the distances."""
    far, near = abs(rows), abs(columns)
    if near > far:
        far, near = near, far
    return max(
        norm[0] * far + norm[1] * near,
        norm[2] * far + norm[3] * near,
        norm[4] * far + norm[5] * near,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _width(rows, columns, norm):
    """The width of a bucket, as a shift, with which all that is open at once fits into the ring.

    On the way to the goal f falls by what the norm says beyond the least way, and with one step it
    rises by the dearest of them.
    """
    spread = estimated(rows, columns, norm) - STRAIGHT * max(rows, columns)
    spread += (WALL + 1) * DIAGONAL + 2 * (norm[4] + norm[5])
    shift = _NARROW
    while spread >> shift >= BUCKETS // 2:
        shift += 1
    return shift


@njit(cache=True, nogil=True, error_model="numpy")
def begin(cost, columns, start, goal, upper, exact, run):
    """Begin a search by `run.norm`, which is `exact` if it never says too much, whose result must
    cost less than `upper`."""
    state, norm, bucket = run.state, run.norm, run.bucket
    # Labels go below the base and prefixes above it by less than `upper`, so that none of an
    # earlier search is taken for one of this.
    if state[CLOCK] > _LAST - 2 * upper:
        run.label[:] = 0
        run.prefix[:] = 0
        state[CLOCK] = 0
    base = state[CLOCK] + upper
    state[CLOCK] = base + upper
    for place in range(state[LOW], min(state[HIGH] + 1, state[LOW] + BUCKETS)):
        bucket[place & (BUCKETS - 1)] = NOTHING
    shift = _width(cost.size // columns, columns, norm)
    f = estimated(start // columns - goal // columns, start % columns - goal % columns, norm)
    state[BASE], state[SHIFT], state[EXACT] = base, shift, exact
    state[CURRENT] = state[LOW] = state[HIGH] = f >> shift
    state[OPENED], state[FRESH], state[UNUSED] = 1, 1, NOTHING
    state[UPPER], state[GAIN], state[MEETING] = upper, 0, NOTHING
    state[FOLLOWS] = 0
    run.label[start] = base << LENGTH
    run.entry[0, CELL], run.entry[0, AFTER] = start, NOTHING
    bucket[state[CURRENT] & (BUCKETS - 1)] = 0


@njit(cache=True, nogil=True, error_model="numpy")
def search(cost, wall, columns, goal, diagonals, run, budget):
    """Go on with the search; return (DONE or OUT_OF_BUDGET, expansions).

    It is done when nothing open can beat the way in hand, as it is after `GAIN`; without an exact
    norm also when it has come to the goal, and then a node is closed for good. With an exact one
    the buckets correct labels: a node may be expanded twice while the same bucket is at work.
    Where all cells cost the same, a way goes on to few sides only, as in `search.bucket_search`,
    which spares most looks at labels. That is proven where nodes are closed in the order of an
    exact norm: only then does an end without a way say that there is none.
    """
    # Arrays are taken out of the tuple once: inside the loop that would count references.
    state, label, prefix, norm = run.state, run.label, run.prefix, run.norm
    bucket, entry = run.bucket, run.entry
    one_far, one_near, two_far, two_near, three_far, three_near = (
        norm[0], norm[1], norm[2], norm[3], norm[4], norm[5],
    )  # fmt: skip
    onward = EIGHT_WAYS if diagonals else FOUR_WAYS
    apart = np.empty(8, np.int64)
    for side in range(8):
        apart[side] = DOWN[side] * columns + ACROSS[side]
    rows = cost.size // columns
    exact, follows = state[EXACT] != 0, state[FOLLOWS] != 0
    base, shift, current, opened = state[BASE], state[SHIFT], state[CURRENT], state[OPENED]
    low, high, fresh, unused = state[LOW], state[HIGH], state[FRESH], state[UNUSED]
    goal_row, goal_column = goal // columns, goal % columns
    inverse = 1.0 / columns  # a division of integers would take a third of the time
    upper, expansions, found = state[UPPER] - state[GAIN], 0, DONE
    stale = base - state[UPPER]
    while opened > 0:
        place = np.int64(bucket[current & (BUCKETS - 1)])
        if place < 0:
            current += 1
            if current << shift >= upper:
                break
            continue
        if expansions >= budget:
            found = OUT_OF_BUDGET
            break
        bucket[current & (BUCKETS - 1)] = entry[place, AFTER]
        entry[place, AFTER], unused = unused, place
        opened -= 1
        node = np.int64(entry[place, CELL])
        mine = label[node]
        if mine & CLOSED:
            continue
        g = base - (mine >> LENGTH)
        row = int((node + 0.5) * inverse)
        column = node - row * columns
        down, along = row - goal_row, column - goal_column
        ahead = node - min(max(down, -_AHEAD), _AHEAD) * columns - min(max(along, -_AHEAD), _AHEAD)
        prefetch(label, ahead)
        prefetch(cost, ahead)
        far, near = abs(down), abs(along)
        if near > far:
            far, near = near, far
        f = g + max(
            one_far * far + one_near * near,
            two_far * far + two_near * near,
            three_far * far + three_near * near,
        )
        if f >> shift != current or f >= upper:  # it has another entry, or cannot beat the way
            continue
        label[node] = mine | CLOSED
        if follows and prefix[node] >= base and prefix[node] - base - g > state[GAIN]:
            state[GAIN], state[MEETING] = prefix[node] - base - g, node
            upper = state[UPPER] - state[GAIN]
        if node == goal:
            state[GAIN], state[MEETING] = state[UPPER] - g, goal
            upper = g
            if exact:
                continue
            break
        expansions += 1
        inside, free = 0 < row < rows - 1 and 0 < column < columns - 1, 0
        for side in range(8):
            there_row, there_column = row + DOWN[side], column + ACROSS[side]
            if inside or (0 <= there_row < rows and 0 <= there_column < columns):
                free |= int(cost[node + apart[side]] != wall) << side
        came = (mine >> SIDE) & 7 if wall == 0 and g > 0 else SET_OUT
        wanted = np.int64(onward[came * 256 + free])
        while wanted:
            side = np.int64(FIRST[wanted])
            wanted &= wanted - 1
            there, dr, dc = node + apart[side], DOWN[side], ACROSS[side]
            dearest = 1
            if wall != 0:
                dearest = int(cost[there])
                if side >= 4:
                    dearest = max(dearest, int(cost[node + dc]), int(cost[node + dr * columns]))
            new_g = g + STEP[side] * dearest
            old = label[there]
            least = old >> LENGTH
            if base - new_g <= least:
                continue
            known = least > stale
            if known and old & CLOSED and not exact:
                continue
            far, near = abs(down + dr), abs(along + dc)
            if near > far:
                far, near = near, far
            h = max(
                one_far * far + one_near * near,
                two_far * far + two_near * near,
                three_far * far + three_near * near,
            )
            if new_g + h >= upper:
                continue
            label[there] = (base - new_g) << LENGTH | side << SIDE
            number = (new_g + h) >> shift
            old_f = base - least + h  # beyond the upper end its entry may have been passed over
            if known and not old & CLOSED and old_f < upper and old_f >> shift == number:
                continue
            if unused >= 0:
                place, unused = unused, np.int64(entry[unused, AFTER])
            else:
                place = fresh
                fresh += 1
            entry[place, CELL], entry[place, AFTER] = there, bucket[number & (BUCKETS - 1)]
            bucket[number & (BUCKETS - 1)] = place
            opened += 1
            if number < current:
                current = number
                low = min(low, number)
            elif number > high:
                high = number
    state[CURRENT], state[OPENED] = current, opened
    state[LOW], state[HIGH], state[FRESH], state[UNUSED] = low, high, fresh, unused
    return found, expansions


@njit(cache=True, nogil=True, error_model="numpy")
def reweigh(columns, goal, run):
    """Go on with another norm that is not exact: put what is open into other buckets."""
    state, label, bucket, entry = run.state, run.label, run.bucket, run.entry
    waiting, count, rows = np.empty(state[OPENED], np.int32), 0, label.size // columns
    for number in range(state[LOW], min(state[HIGH] + 1, state[LOW] + BUCKETS)):
        place = np.int64(bucket[number & (BUCKETS - 1)])
        bucket[number & (BUCKETS - 1)] = NOTHING
        while place >= 0:
            waiting[count] = entry[place, CELL]
            count += 1
            place = np.int64(entry[place, AFTER])
    state[LOW], state[HIGH], state[UNUSED] = 1 << 60, 0, NOTHING
    state[SHIFT] = _width(rows, columns, run.norm)
    opened = 0
    for place in range(count):
        node = np.int64(waiting[place])
        if label[node] & CLOSED:
            continue
        h = estimated(node // columns - goal // columns, node % columns - goal % columns, run.norm)
        number = (state[BASE] - (label[node] >> LENGTH) + h) >> state[SHIFT]
        entry[opened, CELL], entry[opened, AFTER] = node, bucket[number & (BUCKETS - 1)]
        bucket[number & (BUCKETS - 1)] = opened
        opened += 1
        state[LOW], state[HIGH] = min(state[LOW], number), max(state[HIGH], number)
    state[CURRENT], state[OPENED], state[FRESH] = state[LOW], opened, opened
