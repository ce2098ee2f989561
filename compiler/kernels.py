"""Machine code for the inner loops of elimination; imported by `elimination.warm_up` alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from compiler.ordering import ALONG

Floats = NDArray[np.float64]
Levels = NDArray[np.intp]

LAYOUTS = [
    "float64[::1](float64[::1], float64[:,:,::1])",
    "float64[::1](float64[:], float64[:,:,:])",
]
ALONG_LAYOUTS = [
    f"float64[::1](float64[::1], UniTuple(float64[:, ::1], {ALONG}), int64)",
    f"float64[::1](float64[:], UniTuple(float64[:, :], {ALONG}), int64)",
]
WALKS = [
    "int64[::1](float64[::1], float64[:,:,::1], int64[:])",
    "int64[::1](float64[:], float64[:,:,:], int64[:])",
]


@njit(nogil=True)
def _least(costs: Floats, table: Floats, least: Floats) -> None:
    """Lowers `least`, [b], to costs[v] + table[v, b]. Four rows at once, so that what is lowered
    is read and written once for them."""
    levels, last = table.shape
    for v in range(0, levels - 3, 4):
        cost, cost1, cost2, cost3 = costs[v], costs[v + 1], costs[v + 2], costs[v + 3]
        row, row1, row2, row3 = table[v], table[v + 1], table[v + 2], table[v + 3]
        for b in range(last):
            total, total1 = cost + row[b], cost1 + row1[b]
            total2, total3 = cost2 + row2[b], cost3 + row3[b]
            total = total if total < total1 else total1
            total2 = total2 if total2 < total3 else total3
            total = total if total < total2 else total2
            before = least[b]
            least[b] = total if total < before else before
    for v in range(levels - levels % 4, levels):
        cost = costs[v]
        row = table[v]
        for b in range(last):
            total = cost + row[b]
            least[b] = total if total < least[b] else least[b]


@njit(LAYOUTS, cache=True, nogil=True)
def least_sums(costs: Floats, table: Floats) -> Floats:
    """min over v of costs[v] + table[a, v, b], flat over (a, b): one pass, nothing stored."""
    first, _, last = table.shape
    least = np.full(first * last, np.inf)
    for a in range(first):
        _least(costs, table[a], least[a * last : (a + 1) * last])
    return least


@njit(ALONG_LAYOUTS, cache=True, nogil=True)
def least_sums_along(costs: Floats, tables: Sequence[Floats], count: int) -> Floats:
    """`least_sums` through the first `count` of tables [a, b], the costs of each those that the
    one before left; what each left, one after the other: from Python a call for each would take
    longer than its table."""
    cells = 0
    for number in range(count):
        cells += tables[number].shape[1]
    every = np.full(cells, np.inf)
    end = tables[0].shape[1]
    _least(costs, tables[0], every[:end])
    left = every[:end]
    for number in range(1, count):
        start, end = end, end + tables[number].shape[1]
        _least(left, tables[number], every[start:end])
        left = every[start:end]
    return every


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
