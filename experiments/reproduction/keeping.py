"""What a reproduction has found so far, kept so that one that was ended goes on where it was."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

from anytime import journals
from anytime.files import Stored
from anytime.journals import Journal

FILE = "reproduce.jsonl"
"""Beside the page."""


class Asked(Stored):
    """What makes findings comparable; those of something else are not taken for them."""

    claims: list[str]
    seed: int
    schema: str = "anytime.reproduction/1"


class _Finding(Stored):
    name: str
    found: Any


class Kept:
    """Findings by name, each what JSON can say."""

    def __init__(self, journal: Journal[_Finding]) -> None:
        self._journal = journal
        self._found: dict[str, Any] = {line.name: line.found for line in journal.kept}

    def __contains__(self, name: str) -> bool:
        return name in self._found

    def __getitem__(self, name: str) -> Any:
        return self._found[name]

    def keep(self, name: str, found: Any) -> None:
        """Add a finding; it survives the death of this process."""
        self._journal.append(_Finding(name=name, found=found))
        self._found[name] = found

    def once(self, name: str, find: Callable[[], Any]) -> Any:
        """A finding, made only if it is not there."""
        if name not in self:
            self.keep(name, find())
        return self[name]


@contextlib.contextmanager
def opened(folder: Path, asked: Asked) -> Generator[Kept]:
    """The findings in a folder, none if it has no file of them.

    Raises AnytimeError for the findings of another reproduction, and while another process
    writes to them.
    """
    with journals.opened(folder / FILE, asked, _Finding) as journal:
        yield Kept(journal)
