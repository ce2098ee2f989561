"""A Dask cluster on this machine alone, with Dask's own commands."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

START = 120.0  # seconds that the scheduler may take


@contextmanager
def cluster(workers: int = 2) -> Generator[str]:
    """A scheduler and workers on 127.0.0.1; the name to give as an executor.

    The workers have no nanny: one that dies stays dead. Raises TimeoutError if none comes up.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        here = ("--host", "127.0.0.1", "--scheduler-file", str(file))
        begun = [_begun(folder, "dask_scheduler", *here, "--port", "0", "--no-dashboard")]
        try:
            until = time.monotonic() + START
            while not file.exists() or not file.read_text():
                if begun[0].poll() is not None or time.monotonic() > until:
                    raise TimeoutError("no Dask scheduler came up")
                time.sleep(0.05)
            plain = ("--no-nanny", "--nthreads", "1", "--no-dashboard")
            begun += [_begun(folder, "dask_worker", *here, *plain) for _ in range(workers)]
            address: str = json.loads(file.read_text())["address"]
            yield address.replace("tcp://", "dask://")
        finally:
            for each in reversed(begun):
                each.kill()
            for each in begun:
                each.wait()


def _begun(folder: str, name: str, *arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{name}", *arguments],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
