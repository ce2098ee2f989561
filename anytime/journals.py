"""Append-only files of records: one a line, behind a line that says what they are of."""

from __future__ import annotations

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import BinaryIO, Generic, TypeVar

import msgspec

from anytime.errors import AnytimeError
from anytime.files import Stored

Line = TypeVar("Line", bound=Stored)


class Journal(Generic[Line]):
    """An open file of records. kept: those that it held when it was opened."""

    def __init__(self, file: BinaryIO, kept: tuple[Line, ...], header: bytes) -> None:
        self._file = file
        self.kept = kept
        self._header = header  # still to be written, in the place of all that is there

    def append(self, line: Line) -> None:
        """Add a record; it survives the death of this process."""
        if self._header:
            self._file.truncate(0)
        self._file.write(self._header + msgspec.json.encode(line) + b"\n")
        self._file.flush()
        self._header = b""


@contextlib.contextmanager
def opened(
    path: Path, of: Stored, kind: type[Line], *, anew: bool = False
) -> Generator[Journal[Line]]:
    """The journal at a path, made if there is none; a torn last line is dropped.

    of: what makes its records comparable, which is its first line. anew: what it holds makes way
    for the first record that is added, whatever it was of; until then nothing is lost. Raises
    AnytimeError for a journal of something else, one that another process writes to, and for what
    is no journal.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        _lock(file, path)
        file.seek(0)
        content = file.read()
        whole = content[: content.rfind(b"\n") + 1]
        header = msgspec.json.encode(of) + b"\n"
        if not whole and not header.startswith(content):
            raise AnytimeError(f"{path}: not one of our files; give one that is not there yet")
        if whole and anew:
            _header(path, whole.splitlines()[0], of)
            yield Journal(file, (), header)
            return
        kept = _read(path, whole, of, kind)
        file.truncate(len(whole))
        if not whole:
            file.write(header)
            file.flush()
        yield Journal(file, kept, b"")


def _lock(file: BinaryIO, path: Path) -> None:
    try:
        import fcntl
    except ImportError:  # not every system has it
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise AnytimeError(f"{path}: another process writes to it; wait for it to end") from None


def _header(path: Path, line: bytes, of: Stored) -> Stored:
    """What a journal says that it is of."""
    try:
        return msgspec.json.decode(line, type=type(of))
    except msgspec.MsgspecError as error:
        raise AnytimeError(f"{path}:1: not one of our runs: {error}") from None


def _read(path: Path, content: bytes, of: Stored, kind: type[Line]) -> tuple[Line, ...]:
    first, *lines = content.splitlines() or [msgspec.json.encode(of)]
    found, kept = _header(path, first, of), list[Line]()
    for name in of.__struct_fields__:
        here, asked = getattr(found, name), getattr(of, name)
        if here != asked:
            raise AnytimeError(
                f"{path}: holds runs with {name} {here!r}, asked is {asked!r}; start anew, or "
                "ask for the same"
            )
    for number, line in enumerate(lines, 2):
        try:
            kept.append(msgspec.json.decode(line, type=kind))
        except msgspec.MsgspecError as error:
            raise AnytimeError(f"{path}:{number}: not one of our runs: {error}") from None
    return tuple(kept)
