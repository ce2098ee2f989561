"""The arrays of a search, in one piece of memory that large pages can back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LARGE_PAGE = 1 << 21  # bytes; what is smaller as a whole needs none
_ASKED_FOR = 1 << 22  # bytes from which on numpy asks the system for large pages
_LINE = 64  # bytes that the processor loads at once


def zeroed(**wanted: tuple[int | tuple[int, ...], type[np.generic]]) -> dict[str, NDArray[Any]]:
    """Zeroed arrays by name, each of its (shape, type).

    A search that goes down a large map comes with every row to other pages of small arrays, and to
    look up where they are takes it a tenth or more of its time. Laid out together, from where a
    large page begins, a few pages hold all; they are committed when they are touched.
    """
    ends, end = {}, 0
    for name, (shape, kind) in wanted.items():
        begin = -(-end // _LINE) * _LINE
        end = begin + math.prod(np.atleast_1d(shape).tolist()) * np.dtype(kind).itemsize
        ends[name] = begin, end
    if end < _LARGE_PAGE:
        piece = np.zeros(end, np.uint8)
    else:
        piece = np.zeros(max(end + _LARGE_PAGE, _ASKED_FOR), np.uint8)
        piece = piece[-piece.ctypes.data % _LARGE_PAGE :]
    return {
        name: piece[begin:end].view(wanted[name][1]).reshape(wanted[name][0])
        for name, (begin, end) in ends.items()
    }
