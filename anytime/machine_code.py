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


def _find_place() -> None:
    try:
        njit(cache=True)(lambda: None)
    except RuntimeError:  # "no locator available"
        # Nobody else may write there: numba unpickles what it finds.
        folder = tempfile.mkdtemp(prefix="anytime-machine-code-")
        atexit.register(_remove, folder, os.getpid())
        os.environ["NUMBA_CACHE_DIR"] = folder
        config.CACHE_DIR = folder  # pyright: ignore[reportAttributeAccessIssue]
        warnings.warn(
            "machine code is compiled anew, which takes a minute: neither the folder of its source "
            "nor a home can be written; set NUMBA_CACHE_DIR to one that can, to keep it",
            stacklevel=2,
        )


def _remove(folder: str, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)


_find_place()
