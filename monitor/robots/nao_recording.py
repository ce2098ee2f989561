"""A NAO's run on file: recorded once, replayed into whatever takes a `NaoBody`.

JSON lines: a header, then every call with its arguments and what it gave, in their order. Numbers
are written so that they come back to the bit; NaN and inf, which JSON does not have, as text.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from anytime.files import LARGEST
from monitor.robots.nao_body import Action, LinkLostError, NaoBody, Outcome, Reading

VERSION = 1
"""Of the format."""

Told = TypeVar("Told")


class _RecordedAction:
    def __init__(self, recorder: Recorder, number: int, action: Action) -> None:
        self._recorder = recorder
        self._number = number
        self._action = action

    def poll(self) -> Outcome | None:
        outcome = self._action.poll()
        self._recorder.note("poll", [self._number], outcome and outcome.value)
        return outcome

    def cancel(self) -> None:
        self._recorder.note("cancel", [self._number], None)
        self._action.cancel()


class Recorder:
    """A body whose calls are written to a file. Implements `NaoBody`; `close` closes the file."""

    def __init__(self, body: NaoBody, path: Path) -> None:
        self.body = body
        self._file = path.open("w", encoding="utf-8")
        self._actions = 0
        self._write({"nao_recording": VERSION})

    def now(self) -> float:
        now = self.body.now()
        self.note("now", [], now)
        return now

    def wait(self, seconds: float) -> None:
        self.note("wait", [seconds], None)
        self.body.wait(seconds)

    def read(self) -> Reading:
        try:
            reading = self.body.read()
        except LinkLostError as error:
            self.note("read", [], {"lost": str(error)})
            raise
        self.note("read", [], vars(reading))
        return reading

    def walk(self, x: float, y: float, turn: float) -> _RecordedAction:
        return self._begun("walk", [x, y, turn], self.body.walk(x, y, turn))

    def posture(self, name: str) -> _RecordedAction:
        return self._begun("posture", [name], self.body.posture(name))

    def stop(self) -> None:
        self.note("stop", [], None)
        self.body.stop()

    def close(self) -> None:
        if not self._file.closed:
            self.note("close", [], None)
            self._file.close()
        self.body.close()

    def note(self, call: str, arguments: list[Any], gave: Any) -> None:
        """Write a call; after `close`, nothing."""
        if not self._file.closed:
            self._write({"call": call, "with": _plain(arguments), "gave": _plain(gave)})

    def _begun(self, call: str, arguments: list[Any], action: Action) -> _RecordedAction:
        self._actions += 1
        self.note(call, arguments, self._actions)
        return _RecordedAction(self, self._actions, action)

    def _write(self, line: dict[str, Any]) -> None:
        self._file.write(json.dumps(line, allow_nan=False) + "\n")
        self._file.flush()  # a run that crashes is the one to replay


class _ReplayedAction:
    def __init__(self, replay: Replay, number: int) -> None:
        self._replay = replay
        self._number = number
        self._outcome: Outcome | None = None

    def poll(self) -> Outcome | None:
        if self._replay.over:
            return self._outcome
        self._outcome = self._replay.next("poll", [self._number], Outcome | None)
        return self._outcome

    def cancel(self) -> None:
        if not self._replay.over:
            self._replay.next("cancel", [self._number], None)


class Replay:
    """A body that gives what a recorded one gave. Implements `NaoBody`.

    It must be called as that one was: the first call that differs raises AnytimeError, and so does
    one behind the end. A clock that is given is advanced by what was waited for.
    Raises AnytimeError for a file that is no recording, and for a line that is none when it is come
    to.
    """

    def __init__(self, path: Path, clock: Clock | None = None) -> None:
        self.over = False
        self._path = path
        self._clock = clock
        self._lines = _lines(path)
        self._count = 1
        header = next(self._lines, None)
        if header is None or header.get("nao_recording") != VERSION:
            raise AnytimeError(f"{path}: not a recording of a NAO, version {VERSION}")

    def now(self) -> float:
        return self.next("now", [], float)

    def wait(self, seconds: float) -> None:
        self.next("wait", [seconds], None)
        if self._clock is not None:
            self._clock.advance(seconds)

    def read(self) -> Reading:
        told = self.next("read", [], dict[str, Any])
        if "lost" in told:
            raise LinkLostError(self._as(told["lost"], str))
        return self._as(told, Reading)

    def walk(self, x: float, y: float, turn: float) -> _ReplayedAction:
        return _ReplayedAction(self, self.next("walk", [x, y, turn], int))

    def posture(self, name: str) -> _ReplayedAction:
        return _ReplayedAction(self, self.next("posture", [name], int))

    def stop(self) -> None:
        if not self.over:
            self.next("stop", [], None)

    def close(self) -> None:
        if not self.over:
            self.next("close", [], None)
            self.over = True

    def next(self, call: str, arguments: list[Any], kind: Any) -> Any:
        """What that call gave, which is of a kind, if it is the next one of the recording.

        Raises AnytimeError.
        """
        self._count += 1
        asked = f"{call}({', '.join(map(repr, arguments))})"
        line = next(self._lines, None)
        if line is None:
            raise AnytimeError(f"{self._path}: the recording ends before {asked}")
        # compared as they are written: NaN equals NaN there
        if (line.get("call"), line.get("with")) != (call, _plain(arguments)):
            told, given = line.get("call"), line.get("with")
            told = f"{told}({', '.join(map(repr, given if isinstance(given, list) else []))})"
            raise AnytimeError(
                f"{self._path}, line {self._count}: recorded {told[:200]}, now {asked}"
            )
        return self._as(line.get("gave"), kind)

    def _as(self, told: Any, kind: type[Told]) -> Told:
        try:
            return msgspec.convert(_lively(told), kind)
        except (msgspec.ValidationError, TypeError, ValueError, RecursionError) as error:
            reason = " ".join(str(error).split())
            raise AnytimeError(f"{self._path}, line {self._count}: {reason}") from None


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of the file; one that a crash cut off is left out."""
    try:
        if path.stat().st_size > LARGEST:
            raise AnytimeError(f"{path}: more than {LARGEST} bytes; record a shorter run")
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        raise AnytimeError(f"{path}: no such recording") from None
    except (OSError, UnicodeDecodeError) as error:
        raise AnytimeError(f"{path}: cannot be read: {error}") from None
    for number, line in enumerate(lines, 1):
        try:
            told = json.loads(line)
        except (ValueError, RecursionError):
            if number == len(lines):
                return
            raise AnytimeError(f"{path}, line {number}: not JSON") from None
        if not isinstance(told, dict):
            raise AnytimeError(f"{path}, line {number}: not a recording of a NAO, but {line[:40]}")
        yield told


def _plain(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value  # which JSON does not know
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(float(value))}
    return value


def _lively(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) == {"float"}:
            return float(value["float"])
        return {key: _lively(each) for key, each in value.items()}
    return [_lively(each) for each in value] if isinstance(value, list) else value
