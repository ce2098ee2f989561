"""Lessons: what missions lived before this one taught, kept for the next time it is presented."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from anytime.errors import AnytimeError
from anytime.files import Stored, read_record, write_record

SCHEMA = "anytime.lesson/1"
KEPT = 64  # lessons in a folder; older ones make room
PACKAGES = ("anytime", "compiler", "monitor", "planners", "sensing", "numpy")

Lesson = TypeVar("Lesson")


class _Lesson(Stored):
    content: Any


@dataclass(frozen=True)
class Memory:
    """A folder of lessons.

    A lesson follows from what it was learnt from and from the code that learnt it. So its file is
    named by a digest of both, and is right for as long as it is there. folder: None remembers
    nothing.
    """

    folder: Path | None = None

    def recall(
        self, what: str, learnt_from: bytes, kind: type[Lesson], learn: Callable[[], Lesson]
    ) -> Lesson:
        """The lesson as it was learnt before, or learn it now and keep it.

        kind: a type of dataclasses, tuples and finite numbers that JSON can hold. A file that
        cannot be read or written is as good as none.
        """
        if self.folder is None:
            return learn()
        digest = hashlib.sha256(code_digest() + learnt_from).hexdigest()[:32]
        path = self.folder / f"{digest}-{what}.json"
        with contextlib.suppress(AnytimeError, msgspec.ValidationError):
            return msgspec.convert(read_record(path, SCHEMA, _Lesson).content, kind)
        lesson = learn()
        with contextlib.suppress(AnytimeError, OSError):
            write_record(path, SCHEMA, _Lesson(content=msgspec.to_builtins(lesson)))
            self._make_room()
        return lesson

    def _make_room(self) -> None:
        assert self.folder is not None
        files = sorted(self.folder.glob("*.json"), key=lambda path: path.stat().st_mtime)
        for path in files[:-KEPT]:
            path.unlink(missing_ok=True)


NO_MEMORY = Memory()
"""Learns everything anew."""


def user_memory() -> Memory:
    """The user's own: in the folder `$ANYTIME_CACHE`, or in `anytime` of the user's caches; none
    for a user without a home."""
    folder = os.environ.get("ANYTIME_CACHE")
    if not folder:
        caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        if not os.path.isabs(caches):  # the system knows no home of this user
            return NO_MEMORY
        folder = os.path.join(caches, "anytime")
    return Memory(Path(folder) / "lessons")


def code_digest() -> bytes:
    """Digest of the names, sizes and times of all source files that a lesson depends on."""
    found = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec is not None else []:
            inner = () if package == "numpy" else Path(folder).rglob("*.py")
            for path in sorted((Path(folder) / "version.py", *inner)):
                if path.exists():
                    state = path.stat()
                    found.update(f"{path} {state.st_size} {state.st_mtime_ns}\n".encode())
    return found.digest()
