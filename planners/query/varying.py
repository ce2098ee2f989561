"""How a child's genome differs from its parents' before its run: crossover, clouds, edits.

[PRP16] §4, and beyond. What a child inherits and does not ask for stays in its genome, dormant.
Genomes and logs go by their addresses: nothing is faster to pass on.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportPrivateImportUsage=false
# (native code mixes numpy's numbers with Python's; intrinsics are called without a context)

from __future__ import annotations

import math
from typing import Any

import numpy as np

from anytime.machine_code import njit
from planners.query.choosing import (
    EXPONENTIAL,
    GAUSSIAN,
    LOGNORMAL,
    UNIFORM,
    cell_of,
    draw_below,
    draw_bits,
    draw_normal,
    draw_step,
    draw_unit,
)
from planners.query.header import copy_reals, header_at, load_int, load_real, store_int, store_real

CALLED = "10f5e7070bce"

_U, _ONE = np.uint64, np.uint64(1)
_CANCEL = 0.25  # of the pair mutations move all of one value to another


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
def is_continuous(kind: int) -> bool:
    return kind in (GAUSSIAN, UNIFORM, EXPONENTIAL, LOGNORMAL)


@njit(cache=True, forceinline=True)
def _at(log: int, place: int) -> int:
    return np.int64(load_int(log, place))


@njit(cache=True)
def mix(h: Any, child: int, a: int, b: int, known: int) -> None:
    """Each value from one parent or the other; what only one of them has is inherited.

    Without branches, 64 values by one word of random bits: the compiler makes vectors of it.
    """
    for begin in range(0, known, 64):
        bits = draw_bits(h)
        for i in range(min(64, known - begin)):
            x, y = load_real(a, begin + i), load_real(b, begin + i)
            from_a = (bits >> _U(i)) & _ONE != 0
            one, two = x if from_a else y, y if from_a else x
            store_real(child, begin + i, one if one == one else two)


@njit(cache=True)
def blend(h: Any, child: int, a: int, b: int, c: int, share: float, log: int, length: int) -> None:
    """a + share (b - c), in the continuous choices that a made and all three have."""
    copy_reals(child, a, h.known_cells)
    for at in range(length):
        cell = _at(log, at)
        if is_continuous(_kind(h, cell)):
            value = load_real(a, cell) + share * (load_real(b, cell) - load_real(c, cell))
            if value == value:
                store_real(child, cell, value)


@njit(cache=True)
def shift(h: Any, child: int, log: int, length: int) -> bool:
    """Move a bit of one value of a source to another of its values: their sum stays.

    What adds up to a goal can only be straightened that way.
    """
    at = draw_below(h, length)
    for _ in range(length):
        kind = _kind(h, _at(log, at))
        if kind in (GAUSSIAN, UNIFORM):
            break
        at = at + 1 if at + 1 < length else 0
    else:
        return False
    one = _at(log, at)
    stream = _stream(h, one)
    other = draw_below(h, length)
    for _ in range(length):
        if _stream(h, _at(log, other)) == stream and _at(log, other) != one:
            break
        other = other + 1 if other + 1 < length else 0
    else:
        return False
    two = _at(log, other)
    if draw_unit(h) < _CANCEL:
        moved = -load_real(child, one)
    else:
        moved = load_real(h.scales, stream) * draw_step(h)
    store_real(child, one, load_real(child, one) + moved)
    store_real(child, two, load_real(child, two) - moved)
    return True


@njit(cache=True)
def edit_choices(header: int, child: int, log: int, length: int, known: int) -> None:
    """Delete, repeat, insert, split or merge one turn of the model's loop.

    A turn is what was chosen between two successive calls to one stream, found in the order of the
    calls. What is split or merged keeps the sum of its normal variables.
    """
    h = header_at(header)
    stream = _stream(h, _at(log, 0 if draw_unit(h) < 0.5 else draw_below(h, length)))
    begin = draw_below(h, length)
    for _ in range(length):
        if _stream(h, _at(log, begin)) == stream:
            break
        begin = begin + 1 if begin + 1 < length else 0
    end = _turn_end(h, log, length, begin)
    if end == length:
        return
    edit = draw_below(h, 5)
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
        share = draw_unit(h)
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
def cloud(h: Any, child: int, a: int, log: int, length: int, step: float) -> int:
    """Move all continuous choices of an individual a little; how many there are."""
    copy_reals(child, a, h.known_cells)
    moved = 0
    for at in range(length):
        cell = _at(log, at)
        kind = _kind(h, cell)
        if is_continuous(kind):
            spread = load_real(h.scales, _stream(h, cell)) * step * draw_normal(h)
            value = load_real(child, cell)
            value = value * math.exp(spread) if kind == LOGNORMAL else value + spread
            store_real(child, cell, value)
            moved += 1
    return moved
