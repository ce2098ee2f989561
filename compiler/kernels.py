"""Machine code for the inner loops of elimination; imported by `elimination.warm_up` alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
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
    """Lowers `least`, [b], to costs[v] + table[v, b]. Eight rows at once, so that what is lowered
    is read and written once for them; it is read before it is compared, else the compiler stores
    under a mask, and the next rows wait for that."""
    levels, last = table.shape
    for v in range(0, levels - 7, 8):
        c0, c1, c2, c3 = costs[v], costs[v + 1], costs[v + 2], costs[v + 3]
        c4, c5, c6, c7 = costs[v + 4], costs[v + 5], costs[v + 6], costs[v + 7]
        r0, r1, r2, r3 = table[v], table[v + 1], table[v + 2], table[v + 3]
        r4, r5, r6, r7 = table[v + 4], table[v + 5], table[v + 6], table[v + 7]
        for b in range(last):
            t0, t1, t2, t3 = c0 + r0[b], c1 + r1[b], c2 + r2[b], c3 + r3[b]
            t4, t5, t6, t7 = c4 + r4[b], c5 + r5[b], c6 + r6[b], c7 + r7[b]
            t0 = t0 if t0 < t1 else t1
            t2 = t2 if t2 < t3 else t3
            t4 = t4 if t4 < t5 else t5
            t6 = t6 if t6 < t7 else t7
            t0 = t0 if t0 < t2 else t2
            t4 = t4 if t4 < t6 else t6
            t0 = t0 if t0 < t4 else t4
            before = least[b]
            least[b] = t0 if t0 < before else before
    for v in range(levels - levels % 8, levels):
        cost, row = costs[v], table[v]
        for b in range(last):
            total = cost + row[b]
            before = least[b]
            least[b] = total if total < before else before


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
