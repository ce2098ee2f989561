"""How a file is spoilt: a tree with a wrong node, or raw bytes."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Iterator
from typing import Any

import numpy as np

_WORST: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**30, -0.5, 1.5, 1e300, 1e999, -1e999, 5e-324),
    *("", "x", "../../x", "NaN", "\x00", "é" * 50, "x" * 3000, [], {}, [[]], [None], {"": 0}),
    [0] * 1000,
)


def bytes_changed(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(len(changed) + 1))
        way = int(rng.integers(4))
        if way == 0:
            del changed[at:]
        elif way == 1:
            changed[at : at + 1] = bytes([int(rng.integers(256))])
        elif way == 2:
            changed[at:at] = changed[: int(rng.integers(64))]
        else:
            del changed[at : at + int(rng.integers(1, 64))]
    return bytes(changed)


def tree_changed(tree: Any, rng: np.random.Generator) -> Any:
    """The tree with one node changed: replaced, dropped, doubled or swapped with a neighbour."""
    places = list(_places(tree))
    if not places:
        return _worst(rng)
    holder, key = places[int(rng.integers(len(places)))]
    way = int(rng.integers(5))
    if way == 0:
        del holder[key]
    elif way == 1 and isinstance(holder, list):
        holder.insert(key, copy.deepcopy(holder[key]))
    elif way == 1:
        holder[f"{key}_"] = holder[key]
    elif way == 2:
        other, place = places[int(rng.integers(len(places)))]
        with contextlib.suppress(LookupError, TypeError):
            holder[key] = copy.deepcopy(other[place])
    else:
        holder[key] = _worst(rng)
    return tree


def _worst(rng: np.random.Generator) -> Any:
    return copy.deepcopy(_WORST[int(rng.integers(len(_WORST)))])  # it may be changed in its turn


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Where a value can be changed: all in small lists, a few in long ones."""
    if isinstance(tree, dict):
        items = list(tree.items())
    elif isinstance(tree, list):
        items = list(enumerate(tree))
    else:
        return
    for key, value in items[:6] + items[6 :: max(1, len(items) // 6)]:
        yield tree, key
        yield from _places(value)
