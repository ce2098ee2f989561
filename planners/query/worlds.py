"""What a model is evaluated in: numbers and arrays by name, changed from outside at any time."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, MutableMapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from anytime.errors import AnytimeError


class World(MutableMapping[str, Any]):
    """A query's world. What is written here is seen from the next generation on, as a whole.

    Names, types and shapes are fixed; `update` changes several numbers at once. A model reads
    `w.name`, and of an array `w.name[i, j]`.
    """

    def __init__(self, values: Mapping[str, Any] | None) -> None:
        arrays = {name: _array(name, value) for name, value in (values or {}).items()}
        fields = [(name, array.dtype, array.shape) for name, array in arrays.items()]
        # a record without fields has no address: an unused byte stands in
        self.layout = np.dtype(fields or [("unused", np.int8)], align=True)
        self._names = tuple(arrays)
        self._written = np.zeros(1, self.layout)
        self._read = np.zeros(1, self.layout)
        self.address: int = self._read.ctypes.data  # where the native model reads
        self._lock = threading.Lock()
        self._fresh = True
        self._plain: Any = None
        for name, array in arrays.items():
            self._written[name][0] = array

    def __getitem__(self, name: str) -> Any:
        self._known(name)
        with self._lock:
            return _value(self._written[name][0])

    def __setitem__(self, name: str, value: Any) -> None:
        self.update({name: value})

    def update(self, values: Any = (), /, **more: Any) -> None:
        """Change several fields at once. Raises AnytimeError, and changes nothing, for a name that
        is not there, another shape, or a float where there is an integer."""
        checked = {name: self._fitting(name, v) for name, v in {**dict(values), **more}.items()}
        with self._lock:
            for name, array in checked.items():
                self._written[name][0] = array
            self._fresh = True

    def __delitem__(self, name: str) -> None:
        raise AnytimeError(f"world[{name!r}] cannot be deleted; a world's names are fixed")

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def take_over(self) -> None:
        """Let the model see what was written; between generations."""
        if self._fresh:
            with self._lock:
                self._read[:] = self._written
                self._fresh = False
                self._plain = None

    @property
    def plain(self) -> Any:
        """What the plain model reads: Python's own numbers, so that arithmetic is the same."""
        if self._plain is None:
            self._plain = plain({name: self._read[name][0] for name in self._names})
        return self._plain

    def _known(self, name: str) -> None:
        if name not in self._names:
            raise AnytimeError(f"the world has no {name!r}; it has {', '.join(self._names)}")

    def _fitting(self, name: str, value: Any) -> np.ndarray:
        self._known(name)
        array = _array(name, value)
        kind, shape = self.layout[name].base, self.layout[name].shape
        if array.shape != shape:
            raise AnytimeError(f"world[{name!r}] has shape {shape}, not {array.shape}")
        if not np.can_cast(array.dtype, kind, "same_kind"):
            raise AnytimeError(
                f"world[{name!r}] is {kind.name}, not {array.dtype.name}; begin with a float "
                "where floats will come"
            )
        return array.astype(kind)


def plain(values: Mapping[str, Any]) -> SimpleNamespace:
    """A world for a model that runs plain, outside a query."""
    return SimpleNamespace(**{name: _value(np.asarray(value)) for name, value in values.items()})


class Table(np.ndarray):
    """An array whose elements are Python's own numbers."""

    def __getitem__(self, key: Any) -> Any:
        found = super().__getitem__(key)
        return found.item() if isinstance(found, np.generic) else found

    def __iter__(self) -> Iterator[Any]:
        return (self[i] for i in range(len(self)))


def _array(name: str, value: Any) -> np.ndarray:
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.array(None)
    if array.dtype.kind == "b" and array.ndim == 0:
        return array
    if array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise AnytimeError(f"world[{name!r}] is {value!r}; integers have 64 bits, with a sign")
    if array.dtype.kind in "biu":  # native records hold no arrays of bools: they become 0 and 1
        return array.astype(np.int64)
    if array.dtype.kind == "f":
        return array.astype(np.float64)
    raise AnytimeError(f"world[{name!r}] is {value!r}; a world holds numbers and arrays of numbers")


def _value(found: Any) -> Any:
    if np.ndim(found) == 0:
        return found.item()
    copied = np.array(found)
    copied.flags.writeable = False
    return copied.view(Table)
