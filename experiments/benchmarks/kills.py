"""Writers that are killed, and disks that fail: what is then in their files."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from anytime.errors import AnytimeError
from anytime.files import Disk, write_atomically
from anytime.library import read_machine
from monitor.log_reading import read_log

WRITERS = ("new", "again", "log")
_LINES = 400  # of a file, so that writing takes a while

_WRITER = """
import sys
from pathlib import Path
from anytime.library import write_machine
from anytime.machines import Machine
path, kind = Path(sys.argv[1]), sys.argv[2]
filler = Machine("m")
for index in range({lines}):
    filler = filler.with_rate(f"module_{{index}}", index + 0.5)
if kind == "log":
    import dataclasses
    from monitor import Energy, Mission, Value
    from monitor.logs import LogWriter
    from monitor.reports import Frame, Moment
    from monitor.states import Decision
    mission = Mission(Value("hard", 1.0, 1e9), Energy(0, 0, 0))
    frame = Frame(0, 0.0, 1.0, True, (Moment(0.0, "frame", Decision({{"see": 1.0}}, 1.0)),), (),
                  0.0, 0.0, False, {{"filler": list(range({lines}))}})
    with LogWriter(path) as writer:
        writer.mission(mission, policy="p", seed=0, labels=("see",))
        print("READY", flush=True)
        for done in range(10**9):
            writer.frame(dataclasses.replace(frame, index=done))
            print(done + 1, flush=True)
print("READY", flush=True)
for done in range(1, 10**9):
    write_machine(path, filler.with_rate("done", float(done)))
    print(done, flush=True)
"""


def killed(count: int, seed: int) -> Iterator[tuple[bool, bool]]:
    """Kill each kind of writer at `count` random points; for each: whether its file was corrupt,
    and whether something was lost that it had acknowledged."""
    rng = np.random.default_rng(seed)
    for kind in WRITERS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "file"
            for _ in range(count):
                if kind == "new":
                    path.unlink(missing_ok=True)
                said = _killed(path, kind, float(rng.uniform(0.0, 0.03)))
                try:
                    found = _found(path, kind)
                except AnytimeError:
                    yield True, False
                else:
                    yield False, found < said
            strays = list(Path(folder).glob(".*.tmp"))
            with contextlib.suppress(AnytimeError):
                write_atomically(Path(folder) / "other", b"swept")
            if strays and list(Path(folder).glob(".*.tmp")):
                yield True, False


def _killed(path: Path, kind: str, seconds: float) -> int:
    """Kill a writer after so many seconds of writing; the last that it said was written."""
    words = [sys.executable, "-c", _WRITER.format(lines=_LINES), str(path), kind]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        time.sleep(seconds)
        writer.kill()
        said = [line for line in writer.stdout.read().splitlines(keepends=True) if line[-1] == "\n"]
    return int(said[-1]) if said else 0


def _found(path: Path, kind: str) -> int:
    if kind == "log":
        return len(read_log(path).frames)
    if not path.exists():
        return 0
    return int(read_machine(path).rates["done"].per_work)


class FailingDisk(Disk):
    """A disk whose n-th call fails, or all from the n-th on."""

    def __init__(self, at: int, persistent: bool) -> None:
        self.at, self.persistent, self.calls = at, persistent, 0

    def __getattribute__(self, name: str) -> object:
        found = object.__getattribute__(self, name)
        if name not in Disk.__dict__ or name.startswith("_"):
            return found
        self.calls += 1
        fails = self.calls == self.at or (self.persistent and self.calls > self.at)

        def failing(*arguments: object) -> object:
            raise OSError(28, "No space left on device, as it was told to")

        return failing if fails else found


def failing(write: Callable[[Path, bytes, Disk], None] = write_atomically) -> Iterator[bool]:
    """For each call of a write that may fail, once and for good: whether the file was corrupt."""
    old, new = b"old" * 1000, b"new" * 1000
    for persistent in (False, True):
        for at in range(1, 12):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "file"
                write(path, old, Disk())
                disk, failed = FailingDisk(at, persistent), False
                try:
                    write(path, new, disk)
                except OSError:
                    failed = True
                content = path.read_bytes()
                if not failed and disk.calls < at:
                    break
                yield content not in (old, new) or (not failed and content != new)
