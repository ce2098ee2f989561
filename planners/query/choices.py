"""What a model chose: values by address, in the order of its calls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Any

Address = tuple[str, int]
"""(source, index): the index-th call to a source; below a path the source is "plan/3/walk"."""


class Choices(Mapping[Address, Any]):
    """Choices of one run of a model, by (source, index), in the order of its calls.

    Values are bool (flip), int (randint, categorical) or float.
    """

    def __init__(self, values: Mapping[Address, Any], kinds: Mapping[Address, str]) -> None:
        self._values = dict(values)
        self._kinds = {address: kinds[address] for address in self._values}

    def __getitem__(self, address: Address) -> Any:
        return self._values[address]

    def __iter__(self) -> Iterator[Address]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def kind(self, address: Address) -> str:
        """The distribution that was asked for at an address."""
        return self._kinds[address]

    def of(self, source: str) -> tuple[Any, ...]:
        """The values of one source, in order."""
        return tuple(value for (name, _), value in self._values.items() if name == source)

    def first(self, count: int) -> Choices:
        """The first `count` choices in the order of the calls."""
        return Choices(dict(islice(self._values.items(), count)), self._kinds)

    def __repr__(self) -> str:
        shown = (f"{name}#{i}={_short(value)}" for (name, i), value in self._values.items())
        return f"Choices({', '.join(shown)})"


@dataclass(frozen=True)
class Solution:
    """A value that a model returned, and the choices that led to it."""

    value: float
    choices: Choices

    def __str__(self) -> str:
        return f"{self.value:.6g} by {self.choices!r}"


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
