"""Where the runs of a campaign are made: here, in processes of this machine, on a Dask cluster."""

from __future__ import annotations

import importlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from anytime.errors import AnytimeError

Make = Callable[[], Executor]
SPECIFICATIONS = "serial, processes:N or dask://HOST:PORT"


def maker(specification: str) -> Make | None:
    """What makes the executor that a user names; None for `serial`.

    Raises AnytimeError for a name that is none of `SPECIFICATIONS`, and where Dask is missing.
    """
    kind, _, rest = specification.partition(":")
    if specification == "serial":
        return None
    if kind == "processes" and rest.isascii() and rest.isdigit() and 1 <= int(rest) <= 1024:
        return lambda: processes(int(rest))
    if kind == "dask" and rest.startswith("//") and len(rest) > 2:
        return lambda: _dask(f"tcp:{rest}")
    raise AnytimeError(f"executor {specification!r}; give {SPECIFICATIONS}")


def lent(executor: Executor) -> Make:
    """An executor of the user's own: it is not shut down, and cannot be made anew."""
    left = [_Guest(executor, lambda: None)]

    def make() -> Executor:
        if not left:
            raise AnytimeError(
                f"the workers of {type(executor).__name__} died, and only you can make it anew; "
                f"give {SPECIFICATIONS}, or go on from the store"
            )
        return left.pop()

    return make


class _Guest(Executor):
    """Passes on what is submitted; what closes it is not the executor's own shutdown."""

    def __init__(self, executor: Executor, close: Callable[[], object]) -> None:
        self._executor, self._close = executor, close

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._executor.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._close()


def processes(count: int) -> Executor:
    """So many processes, which end when this one does.

    They are started anew: a fork of a process with threads may deadlock.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    methods = multiprocessing.get_all_start_methods()
    how = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    return ProcessPoolExecutor(count, mp_context=how, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """End this worker when the campaign dies, however: a pool does not outlive a SIGKILL else."""
    import multiprocessing
    from multiprocessing.connection import wait

    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _dask(address: str) -> Executor:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise AnytimeError(
            "Dask is not installed; pip install 'anytime-robots[dask]', or use processes:N"
        ) from None
    try:
        client: Any = distributed.Client(address, timeout=10, set_as_default=False)  # untyped
    except (OSError, TimeoutError, ValueError) as error:
        raise AnytimeError(
            f"no Dask scheduler at {address} ({type(error).__name__}); start one with: dask "
            "scheduler --host 127.0.0.1"
        ) from None
    # Equal calls would be taken for one if they were pure.
    return _Guest(client.get_executor(pure=False, retries=2), client.close)
