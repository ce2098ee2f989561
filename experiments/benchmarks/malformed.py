"""Hostile files for every reader: trees with a wrong node and a right checksum, and raw bytes.

A changed byte hardly ever gets past the checksum or the syntax, so most of the corpus is changed as
a tree and written again as the reader wants it.
"""

from __future__ import annotations

import contextlib
import copy
import io
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anytime.__main__ import main
from anytime.errors import AnytimeError
from experiments.benchmarks.file_kinds import Kind, all_kinds
from experiments.benchmarks.malformed_trees import bytes_changed, tree_changed

RAW = 0.1  # share of the corpus that is raw bytes
COMMANDS = 0.01  # share of the corpus that the command line reads as well


@dataclass
class Counts:
    """What came of reading the corpus. tree: files that were changed as a tree."""

    count: int = 0
    tree: int = 0
    tracebacks: int = 0
    bad_exit: int = 0
    slowest: float = 0.0
    first: str = ""


def read_all(count: int, seed: int) -> Counts:
    """Read so many malformed files, over all readers in turn."""
    counts = Counts()
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        kinds = list(all_kinds(Path(folder)))
        for number in range(count):
            kind = kinds[number % len(kinds)]
            content, tree = malformed(kind, rng)
            path = Path(folder) / f"hostile.{kind.name}"
            path.write_bytes(content)
            counts.count += 1
            counts.tree += tree
            began = time.perf_counter()
            try:
                kind.read(path)
            except AnytimeError:
                pass
            except Exception as error:
                counts.tracebacks += 1
                counts.first = counts.first or f"{kind.name} {number}: {error!r}"
            counts.slowest = max(counts.slowest, time.perf_counter() - began)
            if kind.command and rng.random() < COMMANDS * len(kinds):
                counts.bad_exit += _exit_code((*kind.command, str(path))) not in (0, 1, 2)
    return counts


def _exit_code(words: tuple[str, ...]) -> int:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            return main(words)
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 1


def malformed(kind: Kind, rng: np.random.Generator) -> tuple[bytes, bool]:
    """A malformed file of a kind, and whether it was changed as a tree."""
    if kind.parse is None or kind.write is None or rng.random() < RAW:
        return bytes_changed(kind.good, rng), False
    tree = copy.deepcopy(kind.parse(kind.good))
    for _ in range(int(rng.integers(1, 4))):
        tree = tree_changed(tree, rng)
    try:
        return kind.write(tree), True
    except (TypeError, ValueError, AttributeError):  # no such tree can be written
        return bytes_changed(kind.good, rng), False


EVENTS = ("exec", "compile", "import", "pickle.find_class", "marshal.loads", "os.system")
"""What Python does when it runs code that it did not run before."""


class Watch:
    """Counts the events of running code, while it is asked to. A hook can never be taken away."""

    def __init__(self) -> None:
        self.on = False
        self.events: list[str] = []
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.on and (event in EVENTS or event.startswith("subprocess")):
            self.events.append(f"{event} {arguments[:1]!r}"[:80])


def code_run(count: int, seed: int) -> list[str]:
    """The events of running code while a hostile corpus is read, after a good file of each kind."""
    rng = np.random.default_rng(seed)
    watch = Watch()
    with tempfile.TemporaryDirectory() as folder:
        kinds = list(all_kinds(Path(folder)))
        for number in range(count + 20 * len(kinds)):
            kind = kinds[number % len(kinds)]
            path = Path(folder) / f"hostile.{kind.name}"
            first = number < len(kinds)
            path.write_bytes(kind.good if first else malformed(kind, rng)[0])
            watch.on = number >= 20 * len(kinds)  # what is imported late is imported by then
            with contextlib.suppress(Exception):
                kind.read(path)
            watch.on = False
    return watch.events
