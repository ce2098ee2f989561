"""What a call to `rng` in a model does: the address, the value that is kept, drawn or mutated.

[PRP16] §2. A model is executed with the values of a genome; values that it asks for and the genome
lacks are drawn, so lengths and parameters may vary from run to run. Mutation happens here, where
the parameters of the choice are known.

All kernels take the address of a query's header alone (header.py).
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportPrivateImportUsage=false
# (native code mixes numpy's numbers with Python's; intrinsics are called without a context)

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import carray, njit

from planners.query.header import header_at, load_int, load_real, pointer, store_int, store_real

CALLED = "5f139c62ad7a"

KINDS = ("flip", "randint", "gaussian", "uniform", "categorical", "exponential", "lognormal")
"""The distributions, in the order of the numbers below."""
FLIP, RANDINT, GAUSSIAN, UNIFORM, CATEGORICAL, EXPONENTIAL, LOGNORMAL = range(7)

FEW_STREAMS, FEW_CELLS, NARROW, SHORT = 1, 2, 4, 8
"""Why a run overflowed: which of the tables must grow."""

LOST = -2
"""The stream or path for which there was no room."""

RUNAWAY = 1_000_000
"""Choices after which one run of a model is given up."""

_MOST_VALUES = 2**32  # of an integer choice: from so many bits it is drawn

_U = np.uint64
_GOLDEN, _FIRST, _SECOND = _U(0x9E3779B97F4A7C15), _U(0xBF58476D1CE4E5B9), _U(0x94D049BB133111EB)
_S11, _S27, _S30, _S31, _S32 = _U(11), _U(27), _U(30), _U(31), _U(32)
_UNIT = 2.0**-53
_REDRAW = 0.1  # of the mutations draw anew, where a step could be taken


# --- Randomness: splitmix64 (Steele, Lea & Flood 2014).


@njit(cache=True, forceinline=True)
def draw_bits(h: Any) -> Any:
    h.random = h.random + _GOLDEN
    z = h.random
    z = (z ^ (z >> _S30)) * _FIRST
    z = (z ^ (z >> _S27)) * _SECOND
    return z ^ (z >> _S31)


@njit(cache=True, forceinline=True)
def draw_unit(h: Any) -> float:
    """Uniform in [0, 1)."""
    return np.float64(np.int64(draw_bits(h) >> _S11)) * _UNIT


@njit(cache=True, forceinline=True)
def draw_below(h: Any, n: int) -> int:
    """Uniform in [0, n), for n <= 2^32."""
    return np.int64(((draw_bits(h) >> _S32) * _U(n)) >> _S32)


@njit(cache=True)
def draw_normal(h: Any) -> float:
    """Standard normal, by Marsaglia's polar method."""
    while True:
        x = 2.0 * draw_unit(h) - 1.0
        y = 2.0 * draw_unit(h) - 1.0
        square = x * x + y * y
        if 0.0 < square < 1.0:
            return x * math.sqrt(-2.0 * math.log(square) / square)


@njit(cache=True)
def draw_step(h: Any) -> float:
    """A normal step whose size is log-uniform, in units of the spread of what it changes."""
    size = h.largest_step
    if h.smallest_step < size:
        size *= math.exp(draw_unit(h) * h.steps_range)
    return size * draw_normal(h)


# --- Addresses.


@njit(cache=True)
def _place(h: Any, parent: int, name: int, index: int) -> int:
    """Where a key stands in the hash table, or the empty place where it belongs."""
    size = 4 * h.most_streams
    slots = carray(pointer(h.slots), size, np.int32)
    keys = carray(pointer(h.streams), (h.most_streams, 3), np.int64)
    mixed = (_U(parent + 1) * _FIRST) ^ (_U(name + 1) * _SECOND) ^ (_U(index + 2) * _GOLDEN)
    place = np.int64((mixed >> _S32) % _U(size))
    while slots[place] >= 0:
        found = slots[place]
        if keys[found, 0] == parent and keys[found, 1] == name and keys[found, 2] == index:
            break
        place = place + 1 if place + 1 < size else 0
    return place


@njit(cache=True)
def stream_of(header: int, parent: int, name: int, index: int) -> int:
    """The number of a source's stream (index -1) or of the path `name`/`index`, below a path.

    A new one is made if need be; LOST if the table is full. `parent` is -1 at the root.
    """
    h = header_at(header)
    if parent == LOST:
        return LOST
    place = _place(h, parent, name, index)
    known = np.int64(load_int(h.slots, place))
    if known >= 0:
        return known
    made = h.known_streams
    if made >= h.most_streams:
        return LOST
    keys = carray(pointer(h.streams), (h.most_streams, 3), np.int64)
    keys[made, 0], keys[made, 1], keys[made, 2] = parent, name, index
    store_int(h.slots, place, made)
    store_int(h.counts, made, 0)
    h.known_streams = made + 1
    return made


@njit(cache=True)
def hash_again(header: int) -> None:
    """Fill an empty hash table from the streams."""
    h = header_at(header)
    keys = carray(pointer(h.streams), (h.most_streams, 3), np.int64)
    for stream in range(h.known_streams):
        place = _place(h, keys[stream, 0], keys[stream, 1], keys[stream, 2])
        store_int(h.slots, place, stream)


@njit(cache=True)
def cell_of(header: int, stream: int, index: int, kind: int) -> int:
    """The cell of an address, a new one if need be; -1 if the tables are full."""
    h = header_at(header)
    if index >= h.width or stream < 0:
        return -1
    known = np.int64(load_int(h.cells, stream * h.width + index))
    if known >= 0:
        return known
    made = h.known_cells
    if made + 1 >= h.most_cells:  # the last cell is scrap, for choices that have none
        return -1
    store_int(h.cells, stream * h.width + index, made)
    store_int(h.homes, 3 * made, stream)
    store_int(h.homes, 3 * made + 1, index)
    store_int(h.homes, 3 * made + 2, kind)
    store_real(h.fixed, made, np.nan)
    genomes = carray(pointer(h.genomes), (2 * (h.size + 1), h.most_cells), np.float64)
    for row in range(2 * (h.size + 1)):
        genomes[row, made] = np.nan
    h.known_cells = made + 1
    return made


@njit(cache=True, forceinline=False)
def _overflow(h: Any, reason: int) -> int:
    h.overflow = h.overflow | reason
    if h.length > RUNAWAY:
        raise RuntimeError("the model made more than 1,000,000 choices in one run; bound its loop")
    scrap = h.most_cells - 1
    store_real(h.genome, scrap, np.nan)
    return scrap


@njit(cache=True, forceinline=True)
def _asked(header: int, h: Any, stream: int, kind: int) -> int:
    """The cell of the next call to a stream, written down in the log."""
    at = h.length
    h.length = at + 1
    if stream < 0:
        return _overflow(h, FEW_STREAMS)
    index = np.int64(load_int(h.counts, stream))
    store_int(h.counts, stream, index + 1)
    if index < h.width and at < h.longest:
        cell = np.int64(load_int(h.cells, stream * h.width + index))
        if cell >= 0:
            store_int(h.log, at, cell)
            return cell
    return _asked_anew(header, at, stream, index, kind)


@njit(cache=True, forceinline=False)
def _asked_anew(header: int, at: int, stream: int, index: int, kind: int) -> int:
    """The same for an address without a cell, and where there is no room."""
    h = header_at(header)
    cell = cell_of(header, stream, index, kind)
    if cell < 0:
        return _overflow(h, FEW_CELLS if index < h.width else NARROW)
    if at >= h.longest:
        return _overflow(h, SHORT)
    store_int(h.log, at, cell)
    return cell


@njit(cache=True, forceinline=True)
def _due(h: Any, cell: int) -> bool:
    """Whether this inherited value is to be mutated."""
    h.countdown = h.countdown - 1
    return h.countdown == 0 and _due_now(h, cell)


@njit(cache=True, forceinline=False)
def _due_now(h: Any, cell: int) -> bool:
    h.countdown = 1 + draw_below(h, 2 * h.gap)
    if h.constrained:
        known = load_real(h.fixed, cell)
        return known != known
    return True


# --- The calls of a model.


@njit(cache=True, forceinline=True)
def flip(header: int, stream: int, p: float) -> bool:
    h = header_at(header)
    cell = _asked(header, h, stream, FLIP)
    if p <= 0.0 or p >= 1.0:  # whatever was inherited, it is no longer possible, or sure
        store_real(h.genome, cell, np.float64(p >= 1.0))
        return p >= 1.0
    value = load_real(h.genome, cell)
    if value == value and not _due(h, cell):
        return value != 0.0
    return _flip_anew(header, cell, value, p)


@njit(cache=True, forceinline=False)
def _flip_anew(header: int, cell: int, value: float, p: float) -> bool:
    h = header_at(header)
    if value != value:
        value = 1.0 if draw_unit(h) < p else 0.0
    else:
        value = 1.0 - value
    store_real(h.genome, cell, value)
    return value != 0.0


@njit(cache=True, forceinline=True)
def randint(header: int, stream: int, n: int) -> int:
    h = header_at(header)
    if not 1 <= n <= _MOST_VALUES:
        raise ValueError("randint(source, n) takes a number of values n from 1 to 2**32")
    cell = _asked(header, h, stream, RANDINT)
    value = load_real(h.genome, cell)
    if 0.0 <= value < n and not _due(h, cell):
        return np.int64(value)
    return _randint_anew(header, cell, value, n)


@njit(cache=True, forceinline=False)
def _randint_anew(header: int, cell: int, value: float, n: int) -> int:
    h = header_at(header)
    if 0.0 <= value < n and not draw_unit(h) < 0.5:
        near = value + math.floor(draw_step(h) * n + 0.5)
        value = near if 0.0 <= near < n else np.float64(draw_below(h, n))
    else:
        value = np.float64(draw_below(h, n))
    store_real(h.genome, cell, value)
    return np.int64(value)


@njit(cache=True, forceinline=True)
def gaussian(header: int, stream: int, mean: float, sigma: float) -> float:
    h = header_at(header)
    if not sigma >= 0.0:
        raise ValueError("gaussian(source, mean, sigma) was asked with a sigma < 0")
    cell = _asked(header, h, stream, GAUSSIAN)
    value = load_real(h.genome, cell)
    if value == value and not _due(h, cell):
        return value
    return _gaussian_anew(header, stream, cell, value, mean, sigma)


@njit(cache=True, forceinline=False)
def _gaussian_anew(
    header: int, stream: int, cell: int, value: float, mean: float, sigma: float
) -> float:
    h = header_at(header)
    if value != value or draw_unit(h) < _REDRAW:
        value = mean + sigma * draw_normal(h)
    else:
        value += sigma * draw_step(h)
    store_real(h.scales, max(0, stream), sigma)
    store_real(h.genome, cell, value)
    return value


@njit(cache=True)
def uniform(header: int, stream: int, low: float, high: float) -> float:
    h = header_at(header)
    if not (low <= high and high - low < math.inf):
        raise ValueError("uniform(source, low, high) was asked with low > high, or without end")
    cell = _asked(header, h, stream, UNIFORM)
    value = load_real(h.genome, cell)
    if not low <= value <= high:
        value = low + (high - low) * draw_unit(h)
    elif _due(h, cell):
        moved = value + (high - low) * draw_step(h)
        value = moved if low <= moved <= high else low + (high - low) * draw_unit(h)
    else:
        return value
    store_real(h.scales, max(0, stream), high - low)
    store_real(h.genome, cell, value)
    return value


@njit(cache=True)
def categorical(header: int, stream: int, weights: np.ndarray) -> int:
    h = header_at(header)
    total = 0.0
    for weight in weights:
        if not weight >= 0.0:
            raise ValueError("categorical(source, weights) was asked with a weight < 0")
        total += weight
    if not total > 0.0:
        raise ValueError("categorical(source, weights) was asked with weights that are all 0")
    cell = _asked(header, h, stream, CATEGORICAL)
    value = load_real(h.genome, cell)
    kept = 0.0 <= value < len(weights) and weights[np.int64(value)] > 0.0
    if kept and not _due(h, cell):
        return np.int64(value)
    left = draw_unit(h) * total
    chosen = np.int64(0)
    for i in range(len(weights)):
        if weights[i] > 0.0:
            chosen = i
            left -= weights[i]
            if left < 0.0:
                break
    store_real(h.genome, cell, np.float64(chosen))
    return chosen


@njit(cache=True)
def exponential(header: int, stream: int, scale: float) -> float:
    h = header_at(header)
    if not scale >= 0.0:
        raise ValueError("exponential(source, scale) was asked with a scale < 0")
    cell = _asked(header, h, stream, EXPONENTIAL)
    value = load_real(h.genome, cell)
    if not value >= 0.0:
        value = -scale * math.log(1.0 - draw_unit(h))
    elif _due(h, cell):
        if draw_unit(h) < _REDRAW:
            value = -scale * math.log(1.0 - draw_unit(h))
        else:
            value = abs(value + scale * draw_step(h))
    else:
        return value
    store_real(h.scales, max(0, stream), scale)
    store_real(h.genome, cell, value)
    return value


@njit(cache=True)
def lognormal(header: int, stream: int, mean: float, sigma: float) -> float:
    h = header_at(header)
    if not sigma >= 0.0:
        raise ValueError("lognormal(source, mean, sigma) was asked with a sigma < 0")
    cell = _asked(header, h, stream, LOGNORMAL)
    value = load_real(h.genome, cell)
    if not value > 0.0:
        value = math.exp(mean + sigma * draw_normal(h))
    elif _due(h, cell):
        if draw_unit(h) < _REDRAW:
            value = math.exp(mean + sigma * draw_normal(h))
        else:
            value *= math.exp(sigma * draw_step(h))
    else:
        return value
    store_real(h.scales, max(0, stream), sigma)
    store_real(h.genome, cell, value)
    return value
