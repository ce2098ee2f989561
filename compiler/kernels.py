"""Machine code for the inner loops of elimination; imported by `elimination.warm_up` alone."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Levels = NDArray[np.intp]

LAYOUTS = [
    "float64[::1](float64[::1], float64[:,:,::1])",
    "float64[::1](float64[:], float64[:,:,:])",
]
WALKS = [
    "int64[::1](float64[::1], float64[:,:,::1], int64[:])",
    "int64[::1](float64[:], float64[:,:,:], int64[:])",
]


@njit(LAYOUTS, cache=True, nogil=True)
def least_sums(costs: Floats, table: Floats) -> Floats:
    """min over v of costs[v] + table[a, v, b], flat over (a, b): one pass, nothing stored."""
    first, levels, last = table.shape
    least = np.full(first * last, np.inf)
    for a in range(first):
        into = least[a * last : (a + 1) * last]
        for v in range(levels):
            cost = costs[v]
            row = table[a, v]
            for b in range(last):
                total = cost + row[b]
                into[b] = total if total < into[b] else into[b]
    return least


@njit(WALKS, cache=True, nogil=True)
def least_places(costs: Floats, table: Floats, places: Levels) -> Levels:
    """The first v at which costs[v] + table[a, v, b] is least, for each place, flat over (a, b)."""
    _, levels, last = table.shape
    least = np.full(len(places), np.inf)
    found = np.zeros(len(places), np.int64)
    before, after = places // last, places % last
    for v in range(levels):
        cost = costs[v]
        for number in range(len(places)):
            total = cost + table[before[number], v, after[number]]
            if total < least[number]:
                least[number], found[number] = total, v
    return found
