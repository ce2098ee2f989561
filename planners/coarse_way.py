"""A first way over regions: the search for it, and its tracing from cell to cell when it is found.

Both are one call of machine code. Where another search has just filled the caches, every call from
Python takes several microseconds, and five of them were a sixth of a plan on a small map.
"""

import numpy as np

from anytime.machine_code import njit
from planners.blocks import TOUCHED
from planners.frontier import way_cost
from planners.region_search import FOUND, begin_regions, search_regions
from planners.tracing import connect, pins_of

CALLED = "3a950d31c499"


@njit(cache=True, nogil=True, error_model="numpy")
def set_out(
    cost, wall, dearest, columns, start, goal, diagonals, percent, regions, run, far, budget, path
):
    """Begin a search over regions and `go_on` with it."""
    work = begin_regions(cost, wall, dearest, columns, start, goal, percent, regions, run, far)
    found, searched, besides, count, length = go_on(
        cost, wall, dearest, columns, goal, diagonals, percent, regions, run, far, budget, path
    )
    return found, searched, work + besides, count, length


@njit(cache=True, nogil=True, error_model="numpy")
def go_on(cost, wall, dearest, columns, goal, diagonals, percent, regions, run, far, budget, path):
    """Go on with the search; when it is `FOUND`, write the way into `path`.

    Returns (FOUND, NO_PATH or OUT_OF_BUDGET; work of the search and besides, in 1/256 expansions;
    cells of the way; its cost).
    """
    found, searched = search_regions(
        cost, wall, dearest, columns, goal, diagonals, percent, regions, run, far, budget
    )
    if found != FOUND:
        return found, searched, np.int64(0), np.int64(0), np.int64(0)
    pins, way, touched = pins_of(columns, goal, diagonals, regions, run)
    count, more = connect(cost, wall, dearest, columns, pins, way, regions, diagonals, path)
    length = way_cost(cost, wall, columns, path, 0, count - 1)
    return found, searched, np.int64((touched + more) * TOUCHED), np.int64(count), length
