"""What tells an easy map from a hard one: how much of it is blocked, and in how large pieces."""

import numpy as np

from anytime.machine_code import njit
from planners.blocks import ALL, FIRST_COLUMN, LAST_ROW, SIDE, pack
from planners.frontier import NOT_LAST, ONE, SIDE_BITS

CALLED = "af596e9a0ace"

_TWOS, _FOURS = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333)
_EIGHTS = np.uint64(0x0F0F0F0F0F0F0F0F)


@njit(cache=True, nogil=True, error_model="numpy")
def _count(word):
    """How many bits of a word are set."""
    word -= (word >> ONE) & _TWOS
    word = (word & _FOURS) + ((word >> np.uint64(2)) & _FOURS)
    return np.int64((((word + (word >> np.uint64(4))) & _EIGHTS) * FIRST_COLUMN) >> LAST_ROW)


@njit(cache=True, nogil=True, error_model="numpy")
def features(cost, wall, dearest, columns, most):
    """Density of what is not passable, and its clustering, from `most` blocks spread over the map.

    Clustering is how much likelier than elsewhere the cell after a blocked one (to the right or
    below, within the block) is blocked: 0 where cells are independent, near 1 for large obstacles.
    Returns (density, clustering, cells streamed).
    """
    rows = cost.size // columns
    high, wide = (rows + SIDE - 1) // SIDE, (columns + SIDE - 1) // SIDE
    stride = max(1, int(np.ceil(np.sqrt(high * wide / most))))
    cells, blocked, pairs, both = 0, 0, 0, 0
    for one in range((high + stride - 1) // stride):
        for other in range((wide + stride - 1) // stride):
            # Moved about, or walls at even distances would lie in all of them or in none.
            row = one * stride + 3 * other % stride
            column = other * stride + 5 * one % stride
            if row >= high or column >= wide:
                continue
            tall, broad = min(SIDE, rows - row * SIDE), min(SIDE, columns - column * SIDE)
            on_map = ALL >> np.uint64(SIDE * (SIDE - tall))
            on_map &= np.uint64(0xFF >> (SIDE - broad)) * FIRST_COLUMN
            dear = ~pack(cost, wall, dearest, columns, row * wide + column) & on_map
            right, below = dear & (on_map >> ONE) & NOT_LAST, dear & (on_map >> SIDE_BITS)
            cells += tall * broad
            blocked += _count(dear)
            pairs += _count(right) + _count(below)
            both += _count(right & (dear >> ONE)) + _count(below & (dear >> SIDE_BITS))
    if pairs == 0:
        return 0.0, 0.0, cells
    density = blocked / cells
    return density, max(0.0, (both / pairs - density) / (1.0 - density + 1e-9)), cells
