"""A query's memory: a header, and the blocks of numbers that it points to."""

from __future__ import annotations

from operator import index
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from planners.query import choosing
from planners.query.header import HEADER

_TABLES = {  # field of the header: type, shape by name of size, filler
    "counts": (np.int32, ("most_streams",), 0),
    "cells": (np.int32, ("most_streams", "width"), -1),
    "streams": (np.int64, ("most_streams", 3), 0),
    "slots": (np.int32, ("hash",), -1),
    "scales": (np.float64, ("most_streams",), 1.0),
    "homes": (np.int32, ("most_cells", 3), 0),
    "fixed": (np.float64, ("most_cells",), np.nan),
    "genomes": (np.float64, ("rows", "most_cells"), np.nan),
    "logs": (np.int32, ("rows", "longest"), 0),
    "lengths": (np.int32, ("rows",), 0),
    "values": (np.float64, ("rows",), np.inf),
    "elites": (np.int32, ("size",), 0),
    "steps": (np.float64, ("parts",), 0.4),
    "begins": (np.int32, ("parts",), 0),
}


def random_state(seed: Any) -> int:
    """The state of a generator with that seed. Raises AnytimeError for what is no integer."""
    try:
        return index(seed) % 2**64
    except TypeError:
        raise AnytimeError(f"seed is {seed!r}; give an integer") from None


class Memory:
    """Owns a header and its blocks. `address` is what the kernels take."""

    def __init__(self, size: int, streams: int, islands: int = 1) -> None:
        self._record = np.zeros(1, HEADER)
        self.address: int = self._record.ctypes.data
        self.blocks: dict[str, np.ndarray] = {}
        self["size"] = self["main"] = size
        self["islands"] = islands
        self["most_streams"] = max(16, 2 * streams)
        self["most_cells"], self["width"], self["longest"] = 128, 32, 64
        self._allocate()

    def __getitem__(self, field: str) -> Any:
        return self._record[field][0].item()

    def __setitem__(self, field: str, value: float) -> None:
        self._record[field][0] = value

    def grow(self, field: str) -> None:
        """Double one of the sizes: most_streams, most_cells, width or longest."""
        self[field] = 2 * self[field]
        before = self.blocks
        self._allocate()
        for name, block in before.items():
            if name != "slots":
                self.blocks[name][tuple(slice(0, n) for n in block.shape)] = block
        if field == "most_streams":
            choosing.hash_again(self.address)
        else:
            self.blocks["slots"][:] = before["slots"]

    def _allocate(self) -> None:
        sizes = {
            "hash": 4 * self["most_streams"],
            "rows": 2 * (self["size"] + 1),
            **{name: self[name] for name in ("most_streams", "width", "most_cells", "longest")},
            "size": self["size"],
            "parts": self["islands"] + 1,
        }
        self.blocks = {}
        for name, (kind, shape, filler) in _TABLES.items():
            dimensions = tuple(n if isinstance(n, int) else sizes[n] for n in shape)
            self.blocks[name] = np.full(dimensions, filler, kind)
            self[name] = self.blocks[name].ctypes.data
