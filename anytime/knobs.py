"""Knobs: arguments of a module that whoever divides its time may set."""

from __future__ import annotations

import itertools
import numbers
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from anytime.errors import AnytimeError

_WORD = re.compile(r"[A-Za-z0-9_.-]{1,40}")
MOST = 16  # settings of one module


@dataclass(frozen=True)
class Knob:
    """The values that an argument may have; the first is what it has where nobody sets it."""

    values: tuple[Any, ...]


def knob(values: Sequence[Any]) -> Any:
    """An argument that may be set at run time: the default of a keyword-only parameter.

    `def find_path(grid, *, weight=anytime.knob([5, 3, 2, 1]))`. Each value is measured, and a
    program chooses among them as among modules. values: two or more different numbers or words.
    Raises AnytimeError for others.
    """
    found = tuple(values)
    names = [str(value) for value in found]
    for value, name in zip(found, names, strict=True):
        plain = isinstance(value, str | numbers.Real) and value == value  # NaN is not itself
        if not plain or not _WORD.fullmatch(name):
            raise AnytimeError(f"a knob of {value!r}; its values are numbers or words")
    if len(found) < 2 or len(set(found)) < len(found) or len(set(names)) < len(names):
        raise AnytimeError(f"a knob of {list(found)}; give two different values or more")
    return Knob(found)


def settings(knobs: Mapping[str, Knob]) -> Iterator[dict[str, Any]]:
    """Every combination of their values."""
    for combination in itertools.product(*(each.values for each in knobs.values())):
        yield dict(zip(knobs, combination, strict=True))


def setting_name(module: str, chosen: Mapping[str, Any]) -> str:
    """What a module with set knobs is called: find_path@weight=3."""
    return f"{module}@{','.join(f'{name}={value}' for name, value in chosen.items())}"


def family_of(name: str) -> str:
    """The module that a setting belongs to."""
    return name.partition("@")[0]
