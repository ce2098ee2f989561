"""What a reproduction has found so far, kept so that one that was ended goes on where it was."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import msgspec

from anytime import journals
from anytime.files import Stored
from anytime.journals import Journal

FILE = "reproduce.jsonl"
"""Beside the page."""


class _About(Stored):
    schema: str = "anytime.reproduction/1"


class _Finding(Stored):
    name: str
    found: Any


class Kept:
    """Findings by name, each what JSON can say; a name says all that the finding depends on."""

    def __init__(self, journal: Journal[_Finding]) -> None:
        self._journal = journal
        self._found: dict[str, Any] = {line.name: line.found for line in journal.kept}

    def get(self, name: str) -> Any:
        """A finding, None if it is not there."""
        return self._found.get(name)

    def keep(self, name: str, found: Any) -> None:
        """Add a finding; it survives the death of this process."""
        # as one that goes on will read it, so that both find the same
        plain = msgspec.json.decode(msgspec.json.encode(found, enc_hook=_number))
        self._journal.append(_Finding(name=name, found=plain))
        self._found[name] = plain

    def once(self, name: str, find: Callable[[], Any]) -> Any:
        """A finding, made only if it is not there."""
        if name not in self._found:
            self.keep(name, find())
        return self._found[name]


def _number(value: Any) -> float | int:
    """One of numpy's as Python's own. Raises AttributeError for what is no number."""
    return value.item()


@contextlib.contextmanager
def opened(folder: Path, *, anew: bool = False) -> Generator[Kept]:
    """The findings in a folder, none if it has no file of them.

    anew: those that are there make way for the first new one; until then nothing is lost. Raises
    AnytimeError for what is no such file, and while another process writes to it.
    """
    with journals.opened(folder / FILE, _About(), _Finding, anew=anew) as journal:
        yield Kept(journal)
