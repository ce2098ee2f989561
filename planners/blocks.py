"""The graph of a map's regions: what hangs together within a block of 8 x 8 cells, a machine word.

A block is the third level of the quad-tree, the highest of [ZR93]. Its free cells are the bits of
one word; those that hang together make a region, at most 32 a block; regions of neighbouring blocks
are joined where free cells touch. Connectivity is exact, so an abstract plan always leads through.
Blocks are looked at when a search comes to them, and kept for later queries.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.arrays import zeroed
from planners.frontier import NOT_FIRST, NOT_LAST, ONE, SIDE_BITS

CALLED = "5afabff1aa83"

SIDE, MOST = 8, 32
UNKNOWN = 255
STREAMED, TOUCHED, EXPANDED = 1, 16, 256
"""Work of a cell summed, a word or cell touched, a node expanded, in 1/256 of an expansion."""

ZERO, ALL = np.uint64(0), ~np.uint64(0)
LAST_ROW = np.uint64(SIDE * (SIDE - 1))
FIRST_ROW = np.uint64(0xFF)
FIRST_COLUMN = np.uint64(0x0101010101010101)
LAST_BIT = np.uint64(SIDE - 1)
GATHER = np.uint64(0x0102040810204080)
HIGH_BITS = ~np.uint64(0x7F7F7F7F7F7F7F7F)


class Regions(NamedTuple):
    """What is known of a map's blocks; bit 8·row + column of a word is a cell of its block.

    count: regions of each of the n blocks, or UNKNOWN. Region k of block b has the number k·n + b,
    so that those which mostly are the only ones lie together. mask: its cells. edge: those in the
    block's first row, last row, first column and last column, a byte each from the lowest on.
    """

    count: NDArray[np.uint8]
    mask: NDArray[np.uint64]
    edge: NDArray[np.uint32]


def new_regions(rows: int, columns: int) -> Regions:
    """Arrays for a map of that size, of which nothing is known yet."""
    blocks = -(-rows // SIDE) * -(-columns // SIDE)
    regions = Regions(
        **zeroed(
            count=(blocks, np.uint8),
            mask=(blocks * MOST, np.uint64),
            edge=(blocks * MOST, np.uint32),
        )
    )
    regions.count[:] = UNKNOWN
    return regions


@njit(cache=True, nogil=True, error_model="numpy")
def _eight(cost, first):
    """Eight cells as the bytes of a word: one load, as the indices are unsigned."""
    place, word = np.uint64(first), ZERO
    word |= np.uint64(cost[place]) | np.uint64(cost[place + ONE]) << SIDE_BITS
    word |= np.uint64(cost[place + np.uint64(2)]) << np.uint64(16)
    word |= np.uint64(cost[place + np.uint64(3)]) << np.uint64(24)
    word |= np.uint64(cost[place + np.uint64(4)]) << np.uint64(32)
    word |= np.uint64(cost[place + np.uint64(5)]) << np.uint64(40)
    word |= np.uint64(cost[place + np.uint64(6)]) << np.uint64(48)
    return word | np.uint64(cost[place + LAST_BIT]) << LAST_ROW


@njit(cache=True, nogil=True, error_model="numpy")
def pack(cost, wall, dearest, columns, block):
    """The cells of a block that cost at most `dearest`, as bits; cells off the map are walls."""
    rows, across = cost.size // columns, (columns + SIDE - 1) // SIDE
    top, left = block // across * SIDE, block % across * SIDE
    high, wide, word = min(SIDE, rows - top), min(SIDE, columns - left), ZERO
    beyond = np.uint64(127 - dearest) * FIRST_COLUMN
    for row in range(high):
        first, bits = (top + row) * columns + left, ZERO
        if wide < SIDE:
            for along in range(wide):
                dear = int(cost[first + along])
                bits |= np.uint64((dear != wall) & (dear <= dearest)) << np.uint64(along)
        else:
            bits = _eight(cost, first)
            if wall != 0:  # of a known map the bytes are bits already
                bits = ~(((bits & ~HIGH_BITS) + beyond) | bits) >> LAST_BIT & FIRST_COLUMN
            bits = (bits * GATHER) >> LAST_ROW
        word |= bits << np.uint64(SIDE * row)
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
def _edges(mask):
    """The outermost cells of a region, as `Regions.edge`. A product gathers a column's bits."""
    west = ((mask & FIRST_COLUMN) * GATHER) >> LAST_ROW
    east = (((mask >> LAST_BIT) & FIRST_COLUMN) * GATHER) >> LAST_ROW
    return np.uint32(
        (mask & FIRST_ROW)
        | (mask >> LAST_ROW) << SIDE_BITS
        | west << np.uint64(2 * SIDE)
        | east << np.uint64(3 * SIDE)
    )


@njit(cache=True, nogil=True, error_model="numpy")
def part(cost, wall, dearest, columns, block, regions):
    """Part an unknown block into regions; return the work, in 1/256 expansions."""
    counts, masks, edges = regions.count, regions.mask, regions.edge
    word = pack(cost, wall, dearest, columns, block)
    work, count, left = SIDE * SIDE * STREAMED, 0, word
    while left != ZERO:
        fill, before = left & (~left + ONE), ZERO
        while fill != before and fill != left:
            before = fill
            fill = _smear(fill, word)
            work += TOUCHED
        region = count * counts.size + block
        masks[region], edges[region] = fill, _edges(fill)
        left &= ~fill
        count += 1
    counts[block] = count
    return work


@njit(cache=True, nogil=True, error_model="numpy")
def region_of(columns, node, regions):
    """The region of a passable cell, or -1, as where its block is not known."""
    across = (columns + SIDE - 1) // SIDE
    row, column = node // columns, node % columns
    block = row // SIDE * across + column // SIDE
    bit = ONE << np.uint64(row % SIDE * SIDE + column % SIDE)
    if regions.count[block] == UNKNOWN:
        return -1
    for number in range(np.int64(regions.count[block])):
        region = number * regions.count.size + block
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
