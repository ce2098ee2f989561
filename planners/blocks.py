"""The graph of a map's regions: what hangs together within a block of 8 x 8 cells, a machine word.

A block is the third level of the quad-tree, the highest of [ZR93]. Its free cells are the bits of
one word; those that hang together make a region, at most 32 a block; regions of neighbouring blocks
are joined where free cells touch. Connectivity is exact, so an abstract plan always leads through.
Blocks are looked at when a search comes to them, and kept for later queries.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planners.frontier import least_way, next_base, pop, sift_up
from planners.search import CLOSED, NO_PATH, OUT_OF_BUDGET, SPAN

FRONTIER = "84699215c6e2"

FOUND = 0
SIDE, MOST = 8, 32
UNKNOWN = 255
STREAMED, TOUCHED, EXPANDED = 1, 16, 256
"""Work of a cell summed, a word or cell touched, a node expanded, in 1/256 of an expansion."""

ONE, ZERO, SIDE_BITS = np.uint64(1), np.uint64(0), np.uint64(SIDE)
LAST_ROW = np.uint64(SIDE * (SIDE - 1))
FIRST_ROW = np.uint64(0xFF)
FIRST_COLUMN = np.uint64(0x0101010101010101)
LAST_BIT = np.uint64(SIDE - 1)
NOT_FIRST = ~FIRST_COLUMN
NOT_LAST = ~(FIRST_COLUMN << LAST_BIT)


class Regions(NamedTuple):
    """What is known of a map's blocks; bit 8·row + column of a word is a cell of its block.

    word: passable cells. count: regions, or UNKNOWN. mask: the cells of region k of block b, at
    32·b + k.
    """

    word: NDArray[np.uint64]
    count: NDArray[np.uint8]
    mask: NDArray[np.uint64]


class RegionRun(NamedTuple):
    """Arrays of a search over regions: label, heap, key and slot as in other searches.

    pin: of each region, the cell where it is entered. parent: the region from which.
    """

    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    key: NDArray[np.int64]
    heap: NDArray[np.int32]
    slot: NDArray[np.int32]
    pin: NDArray[np.int32]
    parent: NDArray[np.int32]
    state: NDArray[np.int64]


def new_regions(rows: int, columns: int) -> Regions:
    """A map of which nothing is known yet."""
    blocks = -(-rows // SIDE) * -(-columns // SIDE)
    return Regions(
        word=np.zeros(blocks, np.uint64),
        count=np.full(blocks, UNKNOWN, np.uint8),
        mask=np.zeros(blocks * MOST, np.uint64),
    )


def new_region_run(rows: int, columns: int) -> RegionRun:
    """Arrays for a map of that size."""
    regions = -(-rows // SIDE) * -(-columns // SIDE) * MOST
    return RegionRun(
        clock=np.zeros(1, np.int64),
        label=np.zeros(regions, np.int64),
        key=np.zeros(regions, np.int64),
        heap=np.zeros(regions, np.int32),
        slot=np.zeros(regions, np.int32),
        pin=np.zeros(regions, np.int32),
        parent=np.zeros(regions, np.int32),
        state=np.zeros(3, np.int64),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _pack(cost, wall, dearest, columns, block):
    """The cells of a block that cost at most `dearest`, as bits; cells off the map are walls."""
    rows, across = cost.size // columns, (columns + SIDE - 1) // SIDE
    top, left = block // across * SIDE, block % across * SIDE
    word, bit = ZERO, ONE
    for row in range(top, top + SIDE):
        for column in range(left, left + SIDE):
            if row < rows and column < columns:
                dear = int(cost[row * columns + column])
                if dear != wall and dear <= dearest:
                    word |= bit
            bit <<= ONE
    return word


@njit(cache=True, nogil=True, error_model="numpy")
def _smear(fill, word):
    """Spread bits over the set bits of a word, along rows and then along columns as far as it goes.

    Three doublings each way: after the first a bit has gone one cell, then three, then seven.
    """
    east, west = word & NOT_FIRST, word & NOT_LAST
    there, back, away, home = fill, fill, east, west
    for shift in (ONE, np.uint64(2), np.uint64(4)):
        there |= (there << shift) & away
        away &= away << shift
        back |= (back >> shift) & home
        home &= home >> shift
    there |= back
    back, away, home = there, word, word
    for shift in (SIDE_BITS, np.uint64(16), np.uint64(32)):
        there |= (there << shift) & away
        away &= away << shift
        back |= (back >> shift) & home
        home &= home >> shift
    return there | back


@njit(cache=True, nogil=True, error_model="numpy")
def know(cost, wall, dearest, columns, block, regions):
    """Part a block into regions if it is not known yet; return the work, in 1/256 expansions."""
    if regions.count[block] != UNKNOWN:
        return 0
    word = _pack(cost, wall, dearest, columns, block)
    regions.word[block] = word
    work, count, left = SIDE * SIDE * STREAMED, 0, word
    while left != ZERO:
        fill, before = left & (~left + ONE), ZERO
        while fill != before:
            before = fill
            fill = _smear(fill, word)
            work += TOUCHED
        regions.mask[block * MOST + count] = fill
        left &= ~fill
        count += 1
    regions.count[block] = count
    return work


@njit(cache=True, nogil=True, error_model="numpy")
def region_of(columns, node, regions):
    """The region of a passable cell whose block is known, or -1."""
    across = (columns + SIDE - 1) // SIDE
    row, column = node // columns, node % columns
    block = row // SIDE * across + column // SIDE
    bit = ONE << np.uint64(row % SIDE * SIDE + column % SIDE)
    for region in range(block * MOST, block * MOST + np.int64(regions.count[block])):
        if regions.mask[region] & bit != ZERO:
            return region
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
def forget(regions, columns, top, left, bottom, right):
    """Forget the blocks of a rectangle of cells (the latter two exclusive) that have changed."""
    across = (columns + SIDE - 1) // SIDE
    for row in range(top // SIDE, (bottom + SIDE - 1) // SIDE):
        for column in range(left // SIDE, (right + SIDE - 1) // SIDE):
            regions.count[row * across + column] = UNKNOWN


@njit(cache=True, nogil=True, error_model="numpy")
def begin_regions(cost, wall, dearest, columns, start, goal, regions, run):
    """Begin a search from start to goal; return the work, in 1/256 expansions."""
    across = (columns + SIDE - 1) // SIDE
    work = 0
    for node in (start, goal):
        block = node // columns // SIDE * across + node % columns // SIDE
        work += know(cost, wall, dearest, columns, block, regions)
    base = next_base(run)
    first, last = region_of(columns, start, regions), region_of(columns, goal, regions)
    run.state[0], run.state[1], run.state[2] = 1, first, last
    if first < 0 or last < 0:
        run.state[0] = 0
        return work
    run.label[first] = base
    run.key[0] = 0
    run.heap[0] = first
    run.slot[first] = 0
    run.pin[first] = start
    run.parent[first] = -1
    return work


@njit(cache=True, nogil=True, error_model="numpy")
def search_regions(cost, wall, dearest, columns, goal, diagonals, percent, regions, run, budget):
    """Go on with the search; return (FOUND or NO_PATH or OUT_OF_BUDGET, work in 1/256 expansions).

    Weighted A*: a region's g is the least way over its pins, the cells where each region of the
    way is entered, and of the cells that join two regions that one is the pin which is the least
    detour from the pin before to the goal.
    """
    rows, across = cost.size // columns, (columns + SIDE - 1) // SIDE
    high = (rows + SIDE - 1) // SIDE
    label, key, heap, slot = run.label, run.key, run.heap, run.slot
    base, size, last, work = run.clock[0], run.state[0], run.state[2], 0
    goal_row, goal_column = goal // columns, goal % columns
    while size > 0:
        if work >= budget:
            run.state[0] = size
            return OUT_OF_BUDGET, work
        here = pop(size, heap, slot, key, label)
        size -= 1
        work += EXPANDED
        if here == last:
            run.state[0] = size
            return FOUND, work
        block, mask = here // MOST, regions.mask[here]
        top, left = block // across * SIDE, block % across * SIDE
        pin = np.int64(run.pin[here])
        pin_row, pin_column = pin // columns, pin % columns
        g = base - label[here]
        for side in range(4):
            work += TOUCHED
            if side == 0:
                edge, there = mask & FIRST_ROW, block - across
                if edge == ZERO or top == 0:
                    continue
            elif side == 1:
                edge, there = (mask >> LAST_ROW) & FIRST_ROW, block + across
                if edge == ZERO or block // across + 1 >= high:
                    continue
            elif side == 2:
                edge, there = mask & FIRST_COLUMN, block - 1
                if edge == ZERO or left == 0:
                    continue
            else:
                edge, there = (mask >> LAST_BIT) & FIRST_COLUMN, block + 1
                if edge == ZERO or block % across + 1 >= across:
                    continue
            work += know(cost, wall, dearest, columns, there, regions)
            for region in range(there * MOST, there * MOST + np.int64(regions.count[there])):
                work += TOUCHED
                across_edge = regions.mask[region]
                if side == 0:
                    across_edge = (across_edge >> LAST_ROW) & FIRST_ROW
                elif side == 1:
                    across_edge = across_edge & FIRST_ROW
                elif side == 2:
                    across_edge = (across_edge >> LAST_BIT) & FIRST_COLUMN
                else:
                    across_edge = across_edge & FIRST_COLUMN
                join = edge & across_edge
                if join == ZERO:
                    continue
                known = label[region] > base - SPAN
                if known and slot[region] == CLOSED:
                    continue
                least, entry, way = SPAN, np.int64(-1), np.int64(0)
                for place in range(SIDE):
                    bit = place if side < 2 else place * SIDE
                    if (join >> np.uint64(bit)) & ONE == ZERO:
                        continue
                    if side == 0:
                        row, column = top - 1, left + place
                    elif side == 1:
                        row, column = top + SIDE, left + place
                    elif side == 2:
                        row, column = top + place, left - 1
                    else:
                        row, column = top + place, left + SIDE
                    way_here = least_way(row - pin_row, column - pin_column, diagonals)
                    h = least_way(row - goal_row, column - goal_column, diagonals)
                    if way_here + h < least:
                        least, entry, way = way_here + h, row * columns + column, way_here
                new_g = g + way
                f = new_g + (least - way) * percent // 100
                if known and f >= key[slot[region]]:
                    continue
                label[region] = base - new_g
                run.pin[region] = entry
                run.parent[region] = here
                if known:
                    place = np.int64(slot[region])
                else:
                    place = size
                    size += 1
                sift_up(place, region, f, heap, slot, key, label)
    run.state[0] = 0
    return NO_PATH, work


@njit(cache=True, nogil=True, error_model="numpy")
def features(cost, wall, dearest, columns, most):
    """Density of what is not passable, and its clustering, from `most` blocks spread over the map.

    Clustering is how much likelier than elsewhere the cell after a blocked one (to the right or
    below) is blocked: 0 where cells are independent, near 1 for large obstacles. Returns
    (density, clustering, cells streamed).
    """
    rows = cost.size // columns
    high, wide = (rows + SIDE - 1) // SIDE, (columns + SIDE - 1) // SIDE
    stride = max(1, int(np.ceil(np.sqrt(high * wide / most))))
    cells, blocked, pairs, both = 0, 0, 0, 0
    for top in range(stride // 2 * SIDE, rows, stride * SIDE):
        for left in range(stride // 2 * SIDE, columns, stride * SIDE):
            for row in range(top, min(top + SIDE, rows)):
                for column in range(left, min(left + SIDE, columns)):
                    dear = int(cost[row * columns + column])
                    cells += 1
                    if dear != wall and dear <= dearest:
                        continue
                    blocked += 1
                    for side in range(2):
                        r, c = row + side, column + 1 - side
                        if r < rows and c < columns:
                            pairs += 1
                            dear = int(cost[r * columns + c])
                            both += dear == wall or dear > dearest
    if pairs == 0:
        return 0.0, 0.0, cells
    density = blocked / cells
    return density, max(0.0, (both / pairs - density) / (1.0 - density + 1e-9)), cells
