"""The genetic algorithm over choices: what a call to `rng` does, and how a generation is made.

[PRP16] §2 and §4, and beyond. A model is executed with the values of a genome; values that it asks
for and the genome lacks are drawn, so lengths and parameters may vary from run to run. Crossover
and edits prepare a child's genome before its run; mutation happens inside it, where the parameters
of the choice are known. What a child inherits and does not ask for stays in its genome, dormant.

All kernels share this file, because numba's cache does not see a callee change in another, and all
take the address of a query's header alone (header.py).
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportPrivateImportUsage=false
# (native code mixes numpy's numbers with Python's; intrinsics are called without a context)

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

from planners.query.header import (
    copy_reals,
    header_at,
    load_int,
    load_real,
    pointer,
    store_int,
    store_real,
)

KINDS = ("flip", "randint", "gaussian", "uniform", "categorical", "exponential", "lognormal")
"""The distributions, in the order of the numbers below."""
FLIP, RANDINT, GAUSSIAN, UNIFORM, CATEGORICAL, EXPONENTIAL, LOGNORMAL = range(7)

FEW_STREAMS, FEW_CELLS, NARROW, SHORT = 1, 2, 4, 8
"""Why a run overflowed: which of the tables must grow."""

LOST = -2
"""The stream or path for which there was no room."""

RUNAWAY = 1_000_000
"""Choices after which one run of a model is given up."""

_U = np.uint64
_GOLDEN, _FIRST, _SECOND = _U(0x9E3779B97F4A7C15), _U(0xBF58476D1CE4E5B9), _U(0x94D049BB133111EB)
_S11, _S27, _S30, _S31, _S32 = _U(11), _U(27), _U(30), _U(31), _U(32)
_ONE = _U(1)
_UNIT = 2.0**-53
_REDRAW = 0.1  # of the mutations draw anew, where a step could be taken
_CANCEL = 0.25  # of the pair mutations move all of one value to another
_AFTER_CHANGE = 0.005  # a cloud's step at least, in spreads, when the world has changed
_CALMING = 0.1  # of the way back to the usual rate of mutation, each generation


# --- Randomness: splitmix64 (Steele, Lea & Flood 2014).


@njit(cache=True, forceinline=True)
def _bits(h: Any) -> Any:
    h.random = h.random + _GOLDEN
    z = h.random
    z = (z ^ (z >> _S30)) * _FIRST
    z = (z ^ (z >> _S27)) * _SECOND
    return z ^ (z >> _S31)


@njit(cache=True, forceinline=True)
def _unit(h: Any) -> float:
    """Uniform in [0, 1)."""
    return np.float64(np.int64(_bits(h) >> _S11)) * _UNIT


@njit(cache=True, forceinline=True)
def _below(h: Any, n: int) -> int:
    """Uniform in [0, n), for n < 2^32."""
    return np.int64(((_bits(h) >> _S32) * _U(n)) >> _S32)


@njit(cache=True)
def _normal(h: Any) -> float:
    """Standard normal, by Marsaglia's polar method."""
    while True:
        x = 2.0 * _unit(h) - 1.0
        y = 2.0 * _unit(h) - 1.0
        square = x * x + y * y
        if 0.0 < square < 1.0:
            return x * math.sqrt(-2.0 * math.log(square) / square)


@njit(cache=True)
def _step(h: Any) -> float:
    """A normal step whose size is log-uniform, in units of the spread of what it changes."""
    size = h.largest_step
    if h.smallest_step < size:
        size *= math.exp(_unit(h) * h.steps_range)
    return size * _normal(h)


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
    h.countdown = 1 + _below(h, 2 * h.gap)
    if h.constrained:
        known = load_real(h.fixed, cell)
        return known != known
    return True


# --- The calls of a model.


@njit(cache=True, forceinline=True)
def flip(header: int, stream: int, p: float) -> bool:
    h = header_at(header)
    cell = _asked(header, h, stream, FLIP)
    value = load_real(h.genome, cell)
    if value == value and not _due(h, cell):
        return value != 0.0
    return _flip_anew(header, cell, value, p)


@njit(cache=True, forceinline=False)
def _flip_anew(header: int, cell: int, value: float, p: float) -> bool:
    h = header_at(header)
    if value != value:
        value = 1.0 if _unit(h) < p else 0.0
    else:
        value = 1.0 - value
    store_real(h.genome, cell, value)
    return value != 0.0


@njit(cache=True, forceinline=True)
def randint(header: int, stream: int, n: int) -> int:
    h = header_at(header)
    if n < 1:
        raise ValueError("randint(source, n) was asked with n < 1; n is the number of values")
    cell = _asked(header, h, stream, RANDINT)
    value = load_real(h.genome, cell)
    if 0.0 <= value < n and not _due(h, cell):
        return np.int64(value)
    return _randint_anew(header, cell, value, n)


@njit(cache=True, forceinline=False)
def _randint_anew(header: int, cell: int, value: float, n: int) -> int:
    h = header_at(header)
    if 0.0 <= value < n and not _unit(h) < 0.5:
        near = value + math.floor(_step(h) * n + 0.5)
        value = near if 0.0 <= near < n else np.float64(_below(h, n))
    else:
        value = np.float64(_below(h, n))
    store_real(h.genome, cell, value)
    return np.int64(value)


@njit(cache=True, forceinline=True)
def gaussian(header: int, stream: int, mean: float, sigma: float) -> float:
    h = header_at(header)
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
    if value != value or _unit(h) < _REDRAW:
        value = mean + sigma * _normal(h)
    else:
        value += sigma * _step(h)
    store_real(h.scales, max(0, stream), sigma)
    store_real(h.genome, cell, value)
    return value


@njit(cache=True)
def uniform(header: int, stream: int, low: float, high: float) -> float:
    h = header_at(header)
    if not low <= high:
        raise ValueError("uniform(source, low, high) was asked with low > high")
    cell = _asked(header, h, stream, UNIFORM)
    value = load_real(h.genome, cell)
    if not low <= value <= high:
        value = low + (high - low) * _unit(h)
    elif _due(h, cell):
        moved = value + (high - low) * _step(h)
        value = moved if low <= moved <= high else low + (high - low) * _unit(h)
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
    left = _unit(h) * total
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
        value = -scale * math.log(1.0 - _unit(h))
    elif _due(h, cell):
        if _unit(h) < _REDRAW:
            value = -scale * math.log(1.0 - _unit(h))
        else:
            value = abs(value + scale * _step(h))
    else:
        return value
    store_real(h.scales, max(0, stream), scale)
    store_real(h.genome, cell, value)
    return value


@njit(cache=True)
def lognormal(header: int, stream: int, mean: float, sigma: float) -> float:
    h = header_at(header)
    cell = _asked(header, h, stream, LOGNORMAL)
    value = load_real(h.genome, cell)
    if not value > 0.0:
        value = math.exp(mean + sigma * _normal(h))
    elif _due(h, cell):
        if _unit(h) < _REDRAW:
            value = math.exp(mean + sigma * _normal(h))
        else:
            value *= math.exp(sigma * _step(h))
    else:
        return value
    store_real(h.scales, max(0, stream), sigma)
    store_real(h.genome, cell, value)
    return value


# --- Making a generation. Genomes and logs go by their addresses: nothing is faster to pass on.


@njit(cache=True, forceinline=True)
def _stream(h: Any, cell: int) -> int:
    return np.int64(load_int(h.homes, 3 * cell))


@njit(cache=True, forceinline=True)
def _index(h: Any, cell: int) -> int:
    return np.int64(load_int(h.homes, 3 * cell + 1))


@njit(cache=True, forceinline=True)
def _kind(h: Any, cell: int) -> int:
    return np.int64(load_int(h.homes, 3 * cell + 2))


@njit(cache=True, forceinline=True)
def _continuous(kind: int) -> bool:
    return kind in (GAUSSIAN, UNIFORM, EXPONENTIAL, LOGNORMAL)


@njit(cache=True, forceinline=True)
def _at(log: int, place: int) -> int:
    return np.int64(load_int(log, place))


@njit(cache=True, forceinline=True)
def _parent(h: Any, row: int) -> int:
    """The genome of a parent."""
    return h.genomes + 8 * (h.side * (h.size + 1) + row) * h.most_cells


@njit(cache=True, forceinline=False)
def _better(h: Any, first: int, size: int) -> int:
    """A parent: the better of two."""
    values = h.values + 8 * h.side * (h.size + 1)
    bits = _bits(h)
    one = first + np.int64(((bits >> _S32) * _U(size)) >> _S32)
    two = first + np.int64(((bits & _U(0xFFFFFFFF)) * _U(size)) >> _S32)
    return one if load_real(values, one) <= load_real(values, two) else two


@njit(cache=True)
def _mix(h: Any, child: int, a: int, b: int, known: int) -> None:
    """Each value from one parent or the other; what only one of them has is inherited.

    Without branches, 64 values by one word of random bits: the compiler makes vectors of it.
    """
    for begin in range(0, known, 64):
        bits = _bits(h)
        for i in range(min(64, known - begin)):
            x, y = load_real(a, begin + i), load_real(b, begin + i)
            from_a = (bits >> _U(i)) & _ONE != 0
            one, two = x if from_a else y, y if from_a else x
            store_real(child, begin + i, one if one == one else two)


@njit(cache=True)
def _blend(h: Any, child: int, a: int, b: int, c: int, share: float, log: int, length: int) -> None:
    """a + share (b - c), in the continuous choices that a made and all three have."""
    copy_reals(child, a, h.known_cells)
    for at in range(length):
        cell = _at(log, at)
        if _continuous(_kind(h, cell)):
            value = load_real(a, cell) + share * (load_real(b, cell) - load_real(c, cell))
            if value == value:
                store_real(child, cell, value)


@njit(cache=True)
def _shift(h: Any, child: int, log: int, length: int) -> bool:
    """Move a bit of one value of a source to another of its values: their sum stays.

    What adds up to a goal can only be straightened that way.
    """
    at = _below(h, length)
    for _ in range(length):
        kind = _kind(h, _at(log, at))
        if kind in (GAUSSIAN, UNIFORM):
            break
        at = at + 1 if at + 1 < length else 0
    else:
        return False
    one = _at(log, at)
    stream = _stream(h, one)
    other = _below(h, length)
    for _ in range(length):
        if _stream(h, _at(log, other)) == stream and _at(log, other) != one:
            break
        other = other + 1 if other + 1 < length else 0
    else:
        return False
    two = _at(log, other)
    if _unit(h) < _CANCEL:
        moved = -load_real(child, one)
    else:
        moved = load_real(h.scales, stream) * _step(h)
    store_real(child, one, load_real(child, one) + moved)
    store_real(child, two, load_real(child, two) - moved)
    return True


@njit(cache=True)
def _edit(header: int, child: int, log: int, length: int, known: int) -> None:
    """Delete, repeat, insert, split or merge one turn of the model's loop.

    A turn is what was chosen between two successive calls to one stream, found in the order of the
    calls. What is split or merged keeps the sum of its normal variables.
    """
    h = header_at(header)
    stream = _stream(h, _at(log, 0 if _unit(h) < 0.5 else _below(h, length)))
    begin = _below(h, length)
    for _ in range(length):
        if _stream(h, _at(log, begin)) == stream:
            break
        begin = begin + 1 if begin + 1 < length else 0
    end = _turn_end(h, log, length, begin)
    if end == length:
        return
    edit = _below(h, 5)
    if edit == 0:
        _delete(h, child, log, length, begin, end)
    elif edit == 4:
        over = _turn_end(h, log, length, end)
        turn = end - begin
        if over == length or over - end != turn:
            return
        for at in range(begin, end):
            if _stream(h, _at(log, at)) != _stream(h, _at(log, at + turn)):
                return
        for at in range(begin, end):
            cell = _at(log, at)
            if _kind(h, cell) == GAUSSIAN:
                value = load_real(child, cell) + load_real(child, _at(log, at + turn))
                store_real(child, cell, value)
        _delete(h, child, log, length, end, over)
    else:
        share = _unit(h)
        _repeat(header, child, log, length, begin, end, edit, share, known)


@njit(cache=True)
def _turn_end(h: Any, log: int, length: int, begin: int) -> int:
    """Where the next turn begins, or `length`."""
    stream = _stream(h, _at(log, begin))
    end = begin + 1
    while end < length and _stream(h, _at(log, end)) != stream:
        end += 1
    return end


@njit(cache=True, forceinline=True)
def _count(h: Any, log: int, begin: int, end: int) -> None:
    """Count the calls of a turn, by stream."""
    for at in range(begin, end):
        stream = _stream(h, _at(log, at))
        store_int(h.counts, stream, load_int(h.counts, stream) + 1)


@njit(cache=True, forceinline=True)
def _uncount(h: Any, log: int, begin: int, end: int) -> None:
    for at in range(begin, end):
        store_int(h.counts, _stream(h, _at(log, at)), 0)


@njit(cache=True)
def _delete(h: Any, child: int, log: int, length: int, begin: int, end: int) -> None:
    """Move what comes after a turn to where the turn was, source by source."""
    _count(h, log, begin, end)
    for at in range(end, length):
        source = _at(log, at)
        stream = _stream(h, source)
        moved = np.int64(load_int(h.counts, stream))
        if moved:
            target = load_int(h.cells, stream * h.width + _index(h, source) - moved)
            store_real(child, np.int64(target), load_real(child, source))
    _uncount(h, log, begin, end)


@njit(cache=True)
def _repeat(
    header: int,
    child: int,
    log: int,
    length: int,
    begin: int,
    end: int,
    edit: int,
    share: float,
    known: int,
) -> None:
    """Make room after a turn: for a copy (edit 1), a new one (2) or a share of it (3)."""
    h = header_at(header)
    _count(h, log, begin, end)
    for at in range(length - 1, begin - 1, -1):
        source = _at(log, at)
        stream = _stream(h, source)
        moved = np.int64(load_int(h.counts, stream))
        if moved:
            kind, index = _kind(h, source), _index(h, source) + moved
            target = np.int64(-1)
            if index < h.width:
                target = np.int64(load_int(h.cells, stream * h.width + index))
                if target < 0:
                    target = cell_of(header, stream, index, kind)
            if 0 <= target < known:
                value = load_real(child, source)
                moved_value = value
                if at < end and edit == 2 and at > begin:
                    moved_value = np.nan
                elif at < end and edit == 3 and kind == GAUSSIAN:
                    moved_value = (1.0 - share) * value
                    store_real(child, source, value * share)
                store_real(child, target, moved_value)
    _uncount(h, log, begin, end)


@njit(cache=True)
def _cloud(h: Any, child: int, a: int, log: int, length: int, step: float) -> int:
    """Move all continuous choices of an individual a little; how many there are."""
    copy_reals(child, a, h.known_cells)
    moved = 0
    for at in range(length):
        cell = _at(log, at)
        kind = _kind(h, cell)
        if _continuous(kind):
            spread = load_real(h.scales, _stream(h, cell)) * step * _normal(h)
            value = load_real(child, cell)
            value = value * math.exp(spread) if kind == LOGNORMAL else value + spread
            store_real(child, cell, value)
            moved += 1
    return moved


@njit(cache=True)
def _island(h: Any, row: int) -> int:
    """The island of a row; the scouts are the last one."""
    return h.islands if row >= h.main else row // (h.main // h.islands)


@njit(cache=True)
def _extent(h: Any, island: int) -> tuple[int, int, int]:
    """First row, rows and elites of an island."""
    if island == h.islands:
        return h.main, h.size - h.main, h.scouts_kept
    size = h.main // h.islands
    return island * size, size, h.kept


@njit(cache=True)
def prepare(header: int, row: int) -> None:
    """Set the tables for a run on a row of the children."""
    h = header_at(header)
    at = (1 - h.side) * (h.size + 1) + row
    h.genome = h.genomes + 8 * at * h.most_cells
    h.log = h.logs + 4 * at * h.longest
    h.length = 0
    h.overflow = 0
    h.countdown = 0
    h.clouded = 0
    for stream in range(h.known_streams):
        store_int(h.counts, stream, 0)


@njit(cache=True)
def breed(header: int, row: int) -> None:
    """Prepare the genome of an individual of the next generation, and the tables for its run."""
    prepare(header, row)
    h = header_at(header)
    child, known = h.genome, h.known_cells
    island = _island(h, row)
    first, size, kept = _extent(h, island)
    begins = h.generation == 0 or load_int(h.begins, island) != 0
    if begins or (row - first >= kept and _unit(h) < h.immigrants):
        for cell in range(known):
            store_real(child, cell, np.nan)
    elif row - first < kept:
        copy_reals(child, _parent(h, np.int64(load_int(h.elites, row))), known)
    else:
        chosen = _unit(h)
        clouded = chosen < h.cloud
        a = np.int64(load_int(h.elites, first)) if clouded else _better(h, first, size)
        at = h.side * (h.size + 1) + a
        length = np.int64(load_int(h.lengths, at))
        log = h.logs + 4 * at * h.longest
        parent = _parent(h, a)
        chosen -= h.cloud
        if clouded:
            h.clouded = _cloud(h, child, parent, log, length, load_real(h.steps, island))
        elif chosen < h.crossover:
            _mix(h, child, parent, _parent(h, _better(h, first, size)), known)
        elif chosen < h.crossover + h.line:
            other = _parent(h, _better(h, first, size))
            _blend(h, child, parent, other, parent, 1.5 * _unit(h) - 0.25, log, length)
        elif chosen < h.crossover + h.line + h.difference:
            b = _parent(h, first + _below(h, size))
            c = _parent(h, first + _below(h, size))
            _blend(h, child, parent, b, c, _unit(h), log, length)
        else:
            copy_reals(child, parent, known)
        if length > 0 and not clouded:
            shifted = _unit(h) < h.pair and _shift(h, child, log, length)
            if _unit(h) < h.structure:
                _edit(header, child, log, length, known)
            if not shifted:
                hurry = 1.0 if h.adaptive == 0 else 1.0 + 2.0 * (1.0 - h.calm)
                h.gap = max(1, np.int64(length / (h.mutations * hurry)))
                h.countdown = 1 + _below(h, 2 * h.gap)
    if h.constrained:
        for cell in range(known):
            fixed = load_real(h.fixed, cell)
            if fixed == fixed:
                store_real(child, cell, fixed)


@njit(cache=True)
def settle(header: int, row: int, value: float) -> None:
    """Write down what the run of an individual gave. NaN is no value: it counts as inf."""
    h = header_at(header)
    at = (1 - h.side) * (h.size + 1) + row
    if h.overflow:
        h.grow = h.grow | h.overflow
    valid = value == value and not h.overflow
    store_real(h.values, at, value if valid else np.inf)
    length = min(h.length, h.longest)
    store_int(h.lengths, at, 0 if h.overflow else length)
    h.evaluations = h.evaluations + 1
    if h.clouded > 0:
        # One success in five: Rechenberg's rule, damped as in Igel, Suttorp & Hansen 2006.
        island = _island(h, row)
        best = (1 - h.side) * (h.size + 1) + _extent(h, island)[0]
        gain = 0.82 if value < load_real(h.values, best) else -0.18
        step = load_real(h.steps, island) * math.exp(gain / (0.82 + 0.41 * h.clouded))
        store_real(h.steps, island, min(h.largest_step, max(1e-12, step)))
    if not h.dormant and not h.overflow:
        log = carray(pointer(h.log), h.longest, np.int32)
        genome = carray(pointer(h.genome), h.most_cells, np.float64)
        spare = carray(
            pointer(h.genomes + 8 * (2 * h.size + 1) * h.most_cells), h.most_cells, np.float64
        )
        for i in range(length):
            spare[log[i]] = genome[log[i]]
        genome[:] = np.nan
        for i in range(length):
            genome[log[i]] = spare[log[i]]


@njit(cache=True)
def _choose_elites(h: Any, values: np.ndarray, first: int, size: int, kept: int) -> None:
    """The rows of the best individuals of an island, best first, equal values once."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    found = 0
    for row in range(first, first + size):
        value = values[row]
        if found == kept and not value < values[elites[first + found - 1]]:
            continue
        place = found
        while place > 0 and value < values[elites[first + place - 1]]:
            place -= 1
        if place > 0 and value == values[elites[first + place - 1]]:
            continue
        found = min(kept, found + 1)
        for i in range(found - 1, place, -1):
            elites[first + i] = elites[first + i - 1]
        elites[first + place] = row
    for i in range(found, kept):  # fewer different ones than places
        elites[first + i] = elites[first]


@njit(cache=True)
def close(header: int) -> None:
    """End a generation: the children become the parents."""
    h = header_at(header)
    values = carray(pointer(h.values), (2, h.size + 1), np.float64)
    elites = carray(pointer(h.elites), h.size, np.int32)
    begins = carray(pointer(h.begins), h.islands + 1, np.int32)
    steps = carray(pointer(h.steps), h.islands + 1, np.float64)
    now = values[1 - h.side]
    if h.generation > 0:
        leading = h.best_island
        first = _extent(h, leading)[0]
        same = now[first] == values[h.side, elites[first]] or begins[leading] != 0
        h.calm = h.calm + _CALMING * (1.0 - h.calm) if same else 0.0
        if not same:
            for island in range(h.islands + 1):
                steps[island] = max(steps[island], _AFTER_CHANGE)
    h.side = 1 - h.side
    h.generation = h.generation + 1
    for island in range(h.islands + 1):
        first, size, kept = _extent(h, island)
        begins[island] = 0
        _choose_elites(h, now, first, size, kept)
    if h.size > h.main:
        _receive(h, now, begins, steps)
    if h.islands > 1 and h.exclusion > 0.0:
        _exclude(h, now, begins, steps)
    best = np.int64(0)
    for island in range(1, h.islands):
        if now[elites[_extent(h, island)[0]]] < now[elites[_extent(h, best)[0]]]:
            best = island
    h.best_island = best
    h.best = np.int64(elites[_extent(h, best)[0]])


@njit(cache=True)
def _receive(h: Any, now: np.ndarray, begins: np.ndarray, steps: np.ndarray) -> None:
    """Take the scouts' best into the population if it is the best of all, or if they begin anew."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    scout = np.int64(elites[h.main])
    worst, leader, near = np.int64(0), np.inf, np.int64(-1)
    for island in range(h.islands):
        at = np.int64(elites[_extent(h, island)[0]])
        if not now[at] < now[elites[_extent(h, worst)[0]]]:
            worst = island
        leader = min(leader, now[at])
        if h.islands > 1 and _near(h, scout, at):
            near = island
    h.scouts_age = h.scouts_age + 1
    over = h.scouts_age >= h.restart
    if over:
        h.scouts_age = 0
        begins[h.islands] = 1
    if not (over or now[scout] < leader):
        return
    target = near if near >= 0 else worst
    first, size, kept = _extent(h, target)
    if h.islands > 1 and not now[scout] < now[elites[first]]:
        return
    if h.islands > 1 and near < 0:  # the worst island settles where the scouts were
        for row in range(first, first + size):
            _copy(h, scout, row)
        steps[target] = _AFTER_CHANGE
    else:
        row = first
        for other in range(first, first + size):
            row = other if now[other] > now[row] else row
        _copy(h, scout, row)
    _choose_elites(h, now, first, size, kept)


@njit(cache=True)
def _exclude(h: Any, now: np.ndarray, begins: np.ndarray, steps: np.ndarray) -> None:
    """Of two islands whose best are near each other, the worse begins anew."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    for one in range(h.islands):
        for two in range(one):
            if begins[one] or begins[two]:
                continue
            a = np.int64(elites[_extent(h, one)[0]])
            b = np.int64(elites[_extent(h, two)[0]])
            if _near(h, a, b):
                worse = one if now[b] <= now[a] else two
                begins[worse] = 1
                steps[worse] = h.largest_step


@njit(cache=True)
def _near(h: Any, one: int, two: int) -> bool:
    """Whether two parents made the same choices, up to a little in the continuous ones."""
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)[h.side]
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)[h.side]
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)[h.side]
    homes = carray(pointer(h.homes), (h.most_cells, 3), np.int32)
    if lengths[one] != lengths[two]:
        return False
    square = 0.0
    for at in range(lengths[one]):
        cell = logs[one, at]
        if logs[two, at] != cell:
            return False
        apart = genomes[one, cell] - genomes[two, cell]
        if _continuous(homes[cell, 2]):
            apart /= load_real(h.scales, np.int64(homes[cell, 0]))
            square += apart * apart
        elif apart != 0.0:
            return False
    return square < h.exclusion * h.exclusion


@njit(cache=True)
def _copy(h: Any, source: int, target: int) -> None:
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)
    values = carray(pointer(h.values), (2, rows), np.float64)
    for at in range(h.most_cells):  # one by one, or numba compiles numpy's words for other shapes
        genomes[h.side, target, at] = genomes[h.side, source, at]
    lengths[h.side, target] = lengths[h.side, source]
    for at in range(lengths[h.side, source]):
        logs[h.side, target, at] = logs[h.side, source, at]
    values[h.side, target] = values[h.side, source]


@njit(cache=True)
def adopt(header: int, value: float) -> None:
    """Put what was run on the spare row of the children into the place of the worst parent."""
    h = header_at(header)
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)
    now = carray(pointer(h.values), (2, rows), np.float64)[h.side]
    worst = np.int64(0)
    for row in range(h.main):
        worst = row if now[row] > now[worst] else worst
    if h.overflow or not value < now[worst]:
        return
    genomes[h.side, worst] = genomes[1 - h.side, h.size]
    logs[h.side, worst] = logs[1 - h.side, h.size]
    lengths[h.side, worst] = h.length
    now[worst] = value
    first, size, kept = _extent(h, _island(h, worst))
    _choose_elites(h, now, first, size, kept)
    if value < now[h.best]:
        h.best, h.best_island = worst, _island(h, worst)


# --- The loop.


@intrinsic
def _call(typingctx: Any, model: Any, header: Any, world: Any) -> Any:
    """Call a native model, float64(rng, world), by its address; what it raises is passed on."""
    signature = types.float64(types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention = context.call_conv
        arguments = [types.int64, types.voidptr]
        function = convention.get_function_type(types.float64, arguments)
        target = builder.inttoptr(args[0], function.as_pointer())
        world_pointer = builder.inttoptr(args[2], ir.IntType(8).as_pointer())
        status, result = convention.call_function(
            builder, target, types.float64, arguments, [args[1], world_pointer]
        )
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return result

    return signature, codegen


@njit(cache=True)
def call(header: int, model: int, world: int) -> float:
    """Run a native model once."""
    return _call(model, header, world)


@njit(cache=True, nogil=True)
def evolve(header: int, model: int, world: int, generations: int, until: float) -> int:
    """Run whole generations of a native model; how many were finished.

    Ends early when the best value is at most `until` or the tables must grow.
    """
    h = header_at(header)
    values = carray(pointer(h.values), (2, h.size + 1), np.float64)
    for done in range(generations):
        for row in range(h.size):
            breed(header, row)
            settle(header, row, _call(model, header, world))
        close(header)
        if h.grow or values[h.side, h.best] <= until:
            return done + 1
    return generations
