"""numba's `njit`, with a folder for the machine code that it keeps from process to process.

numba keeps it beside the source or in the user's caches, and where neither can be written, as by a
user without a home in a container, it refuses to define a kernel at all. There we give it a folder
that ends with this process and serves its workers too. So all kernels take `njit` from here.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
import warnings

from numba import config
from numba import njit as njit

from anytime.errors import AnytimeError

_NOWHERE = "machine code cannot be kept: neither the folder of its source nor a home can be written"
_CURE = "set NUMBA_CACHE_DIR to a folder that can"


def _find_place() -> None:
    try:
        njit(cache=True)(lambda: None)
    except RuntimeError:  # "no locator available"
        # Nobody else may write there: numba unpickles what it finds.
        try:
            folder = tempfile.mkdtemp(prefix="anytime-machine-code-")
        except OSError as error:
            raise AnytimeError(f"{_NOWHERE}; {_CURE}") from error
        atexit.register(_remove, folder, os.getpid())
        os.environ["NUMBA_CACHE_DIR"] = folder
        config.CACHE_DIR = folder  # pyright: ignore[reportAttributeAccessIssue]
        warnings.warn(
            f"{_NOWHERE}; it is compiled anew, which takes a minute ({_CURE})", stacklevel=2
        )


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)


_find_place()
