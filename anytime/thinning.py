"""Some of many results, in bounded memory."""

from __future__ import annotations

from typing import Any

from anytime.results import Change


class Thinned:
    """Results at equal distances, and the last: between half of `most` and `most` of them, of a
    module that registers for ever. Halving all that is kept, again and again as more come, would
    make the early ones rare, and they improve most."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._even: list[tuple[Any, Change]] = []
        self._last: list[tuple[Any, Change]] = []
        self._count, self._apart = 0, 1

    def add(self, value: Any, change: Change) -> None:
        """One more result."""
        self._last = [(value, change)]
        if self._count % self._apart == 0:
            self._even += self._last
            self._last = []
            if len(self._even) >= self._most:
                del self._even[1::2]
                self._apart *= 2
                self._last = [(value, change)]
        self._count += 1

    @property
    def kept(self) -> list[tuple[Any, Change]]:
        return self._even + self._last
