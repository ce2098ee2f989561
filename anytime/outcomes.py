"""What the runs on one problem came to, and the append-only file that keeps it."""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from anytime import journals
from anytime.files import Stored
from anytime.journals import Journal
from anytime.recordings import Recording

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
    by module. faults: by module, what a run raised after a result. failed: why there is nothing, of
    a problem that is left out. fatal: whether that ended its worker, so that it is not tried again
    unasked.
    """

    problem: str
    recordings: Mapping[str, tuple[Recording, ...]] = field(
        default_factory=dict[str, tuple[Recording, ...]]
    )
    references: Mapping[str, float] = field(default_factory=dict[str, float])
    paces: Mapping[str, tuple[Pace, ...]] = field(default_factory=dict[str, tuple[Pace, ...]])
    faults: Mapping[str, str] = field(default_factory=dict[str, str])
    failed: str | None = None
    fatal: bool = False


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
    results: int = 0
    steps: int = 0


class _Line(Stored):
    problem: str
    recordings: dict[str, list[_Row]]
    references: dict[str, float]
    paces: dict[str, list[tuple[bool, list[tuple[float, float]]]]]
    failed: str | None
    fatal: bool = False
    faults: dict[str, str] = msgspec.field(default_factory=dict[str, str])


class Store:
    """An open file of outcomes. kept: those that it held, by problem."""

    def __init__(self, journal: Journal[_Line]) -> None:
        self._journal = journal
        self.kept: Mapping[str, Outcome] = {line.problem: _outcome(line) for line in journal.kept}

    def append(self, outcome: Outcome) -> None:
        """Add an outcome; it survives the death of this process."""
        self._journal.append(_line(outcome))


@contextlib.contextmanager
def opened(path: Path, campaign: Campaign, *, anew: bool = False) -> Generator[Store]:
    """The store at a path, made if there is none; a torn last line is dropped.

    anew: what it holds makes way for the first outcome. Raises AnytimeError for a store of another
    campaign, one that another process writes to, and for what is not a store.
    """
    with journals.opened(path, campaign, _Line, anew=anew) as journal:
        yield Store(journal)


def _line(outcome: Outcome) -> _Line:
    return _Line(
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
        fatal=outcome.fatal,
        faults=dict(outcome.faults),
    )


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
        results=run.results,
        steps=run.steps,
    )


def _outcome(stored: _Line) -> Outcome:
    recordings = {
        label: tuple(_recording(stored.problem, label, row) for row in rows)
        for label, rows in stored.recordings.items()
    }
    paces = {
        name: tuple(Pace(charged, tuple(pieces)) for charged, pieces in rows)
        for name, rows in stored.paces.items()
    }
    return Outcome(
        stored.problem,
        recordings,
        stored.references,
        paces,
        stored.faults,
        stored.failed,
        stored.fatal,
    )


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
        row.results,
        row.steps,
    )
