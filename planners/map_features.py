"""What tells an easy map from a hard one: how much of it is blocked, and in how large pieces."""

import numpy as np
from numba import njit

from planners.blocks import SIDE

CALLED = "f25dedbf315a"


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
