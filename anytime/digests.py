"""What tells problems and programs apart: digests of values, the same in every process."""

from __future__ import annotations

import hashlib
import io
import pickle
import sys
from collections.abc import Iterable
from types import FunctionType
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray


def digest_of(*values: Any) -> str:
    """A digest of values in their order: arrays by type, shape and content, what is in lists,
    tuples, sets and dicts likewise, the rest as pickled.

    Raises TypeError for what cannot be pickled.
    """
    return hashlib.blake2b(_joined(map(_content, values)), digest_size=8).hexdigest()


def _content(value: Any) -> bytes:
    """What a value holds, as bytes that equal values share."""
    kind = type(value).__qualname__.encode()
    if isinstance(value, np.ma.MaskedArray):
        masked = cast("np.ma.MaskedArray[Any, Any]", value)
        return _joined([kind, _array(np.ma.getdata(masked)), _array(np.ma.getmaskarray(masked))])
    if isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
        return _array(np.asarray(cast("NDArray[Any]", value)))
    if isinstance(value, dict):
        pairs = cast("dict[Any, Any]", value).items()
        return _joined([kind, *sorted(_joined(map(_content, pair)) for pair in pairs)])
    if isinstance(value, set | frozenset):
        return _joined([kind, *sorted(map(_content, cast("set[Any]", value)))])
    if type(value) in (list, tuple):
        return _joined([kind, *map(_content, cast("list[Any]", value))])
    content = io.BytesIO()
    try:
        _Pickler(content, protocol=5).dump(value)
        return content.getvalue()
    except Exception as error:  # whatever the value's own methods raise
        raise TypeError(f"{type(value).__name__} cannot be pickled: {error}") from error


class _Pickler(pickle.Pickler):
    """Writes what pickle would write differently in another process: sets, whose order differs, by
    what they hold; classes and functions of a script, whose module is `__main__` or named after its
    file, by their own names."""

    def persistent_id(self, obj: Any) -> bytes | None:
        if type(obj) in (set, frozenset):
            return _content(obj)
        if isinstance(obj, type | FunctionType) and _is_script(obj.__module__):
            # What is made within a function has no name of its own, and cannot be pickled.
            return None if "<" in obj.__qualname__ else obj.__qualname__.encode()
        return None


def _is_script(module: str | None) -> bool:
    """Whether a module is a file outside of any package."""
    packaged = module is None or "." in module or hasattr(sys.modules.get(module), "__path__")
    return not packaged and module not in sys.stdlib_module_names


def _array(array: NDArray[Any]) -> bytes:
    about = f"{array.dtype.descr} {array.shape}"
    return _joined([about.encode(), np.ascontiguousarray(array).tobytes()])


def _joined(parts: Iterable[bytes]) -> bytes:
    """The parts one after the other, so that others never look the same."""
    return b"".join(len(part).to_bytes(8, "little") + part for part in parts)
