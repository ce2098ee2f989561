"""Arrays that a planner has done with, for the next one on a map of the same size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

Arrays = TypeVar("Arrays")


class Pool(Generic[Arrays]):
    """Keeps the arrays of the sizes that were used last; several threads may use it at once."""

    # Constants of the class: maps may leave arrays when those of the module are gone.
    SIZES = 4  # of maps whose arrays are kept: a map that grows must not leave all it ever had …
    EACH = 8  # … nor a thousand maps of one size as many

    def __init__(self, make: Callable[[int, int], Arrays]) -> None:
        self._make = make
        self._kept: dict[tuple[int, int], list[Arrays]] = {}

    def take(self, shape: tuple[int, int]) -> Arrays:
        """Arrays for a map of so many rows and columns, as somebody left them or new ones."""
        try:
            return self._kept[shape].pop()
        except (KeyError, IndexError):
            return self._make(*shape)

    def put_back(self, shape: tuple[int, int], arrays: Arrays) -> None:
        """Leave arrays to the next; those of the size that was not used for longest are dropped."""
        kept = self._kept.pop(shape, [])
        if len(kept) < self.EACH:
            kept.append(arrays)
        self._kept[shape] = kept
        for other in list(self._kept)[: -self.SIZES]:
            self._kept.pop(other, None)
