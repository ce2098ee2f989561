"""What the runs on one problem came to, and the append-only file that keeps it."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import msgspec
import numpy as np

from anytime.errors import AnytimeError
from anytime.files import Stored
from anytime.profiles import Recording

SCHEMA = "anytime.runs/1"


@dataclass(frozen=True)
class Pace:
    """How fast a run worked: (work, seconds) pieces of one that charged, else (step, seconds)."""

    charged: bool
    pieces: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Outcome:
    """What the runs of a program's calls on one problem came to.

    recordings: by call. references: of each module with a cost, the cheapest known result. paces:
    by module. failed: why there is nothing, of a problem that is left out.
    """

    problem: str
    recordings: Mapping[str, tuple[Recording, ...]] = field(
        default_factory=dict[str, tuple[Recording, ...]]
    )
    references: Mapping[str, float] = field(default_factory=dict[str, float])
    paces: Mapping[str, tuple[Pace, ...]] = field(default_factory=dict[str, tuple[Pace, ...]])
    failed: str | None = None


class Campaign(Stored):
    """What makes the runs of one store comparable: all but the problems."""

    program: str
    seconds: float
    rest: float
    seed: int
    clock: str
    schema: str = SCHEMA


class _Row(Stored):
    inputs: dict[str, float]
    features: dict[str, float]
    seconds: list[float]
    work: list[float]
    raw: list[float]
    estimates: list[float | None]
    end: tuple[float, float]
    complete: bool


class _Line(Stored):
    problem: str
    recordings: dict[str, list[_Row]]
    references: dict[str, float]
    paces: dict[str, list[tuple[bool, list[tuple[float, float]]]]]
    failed: str | None


class Store:
    """An open file of outcomes, one a line behind a line that says which campaign they are of."""

    def __init__(self, file: BinaryIO, kept: Mapping[str, Outcome]) -> None:
        self._file = file
        self.kept = kept

    def append(self, outcome: Outcome) -> None:
        """Add an outcome; it survives the death of this process."""
        self._file.write(_encoded(outcome))
        self._file.flush()


@contextlib.contextmanager
def opened(path: Path, campaign: Campaign) -> Generator[Store]:
    """The store at a path, made if there is none; a torn last line is dropped.

    Raises AnytimeError for a store of another campaign, one that another process writes to, and
    for what is not a store.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        _lock(file, path)
        file.seek(0)
        content = file.read()
        whole = content[: content.rfind(b"\n") + 1]
        kept = _read(path, whole, campaign)
        file.truncate(len(whole))
        if not whole:
            file.write(msgspec.json.encode(campaign) + b"\n")
            file.flush()
        yield Store(file, kept)


def _lock(file: BinaryIO, path: Path) -> None:
    try:
        import fcntl
    except ImportError:  # not every system has it
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise AnytimeError(f"{path}: another process writes to it; wait for it to end") from None


def _read(path: Path, content: bytes, campaign: Campaign) -> dict[str, Outcome]:
    lines = content.splitlines()
    kept: dict[str, Outcome] = {}
    for number, line in enumerate(lines, 1):
        try:
            if number > 1:
                outcome = _decoded(line)
                kept[outcome.problem] = outcome
                continue
            found = msgspec.json.decode(line, type=Campaign)
        except msgspec.MsgspecError as error:
            raise AnytimeError(f"{path}:{number}: not one of our runs: {error}") from None
        for name in campaign.__struct_fields__:
            here, asked = getattr(found, name), getattr(campaign, name)
            if here != asked:
                raise AnytimeError(
                    f"{path}: holds runs with {name} {here!r}, asked is {asked!r}; start a new "
                    "campaign, or ask for the same"
                )
    return kept


def _encoded(outcome: Outcome) -> bytes:
    line = _Line(
        problem=outcome.problem,
        recordings={
            label: [_row(run) for run in runs] for label, runs in outcome.recordings.items()
        },
        references=dict(outcome.references),
        paces={
            name: [(pace.charged, list(pace.pieces)) for pace in paces]
            for name, paces in outcome.paces.items()
        },
        failed=outcome.failed,
    )
    return msgspec.json.encode(line) + b"\n"


def _row(run: Recording) -> _Row:
    return _Row(
        inputs=dict(run.inputs),
        features=dict(run.features),
        seconds=run.seconds.tolist(),
        work=run.work.tolist(),
        raw=run.raw.tolist(),
        estimates=[None if np.isnan(value) else float(value) for value in run.estimates],
        end=run.end,
        complete=run.complete,
    )


def _decoded(line: bytes) -> Outcome:
    stored = msgspec.json.decode(line, type=_Line)
    recordings = {
        label: tuple(_recording(stored.problem, label, row) for row in rows)
        for label, rows in stored.recordings.items()
    }
    paces = {
        name: tuple(Pace(charged, tuple(pieces)) for charged, pieces in rows)
        for name, rows in stored.paces.items()
    }
    return Outcome(stored.problem, recordings, stored.references, paces, stored.failed)


def _recording(problem: str, label: str, row: _Row) -> Recording:
    return Recording(
        problem,
        label,
        row.inputs,
        row.features,
        np.array(row.seconds, dtype=float),
        np.array(row.work, dtype=float),
        np.array(row.raw, dtype=float),
        np.array([np.nan if value is None else value for value in row.estimates], dtype=float),
        row.end,
        row.complete,
    )
