"""What tells problems and programs apart: digests of values, the same in every process."""

from __future__ import annotations

import hashlib
import pickle
from typing import Any

import numpy as np


def digest_of(*values: Any) -> str:
    """A digest of values in their order: arrays by type, shape and content, the rest as pickled.

    Raises TypeError for what cannot be pickled.
    """
    digest = hashlib.blake2b(digest_size=8)
    for value in values:
        array = np.asarray(value) if isinstance(value, np.ndarray | np.generic) else None
        if array is not None and array.dtype != object:
            content = array.dtype.str.encode() + repr(array.shape).encode()
            content += np.ascontiguousarray(array).tobytes()
        else:
            content = _pickled(value)
        digest.update(len(content).to_bytes(8, "little") + content)
    return digest.hexdigest()


def _pickled(value: Any) -> bytes:
    try:
        return pickle.dumps(value, protocol=5)
    except Exception as error:  # whatever the value's own methods raise
        raise TypeError(f"{type(value).__name__} cannot be pickled: {error}") from error
