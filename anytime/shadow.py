"""Shadow mode: what a running system does with its time, watched and not changed."""

from __future__ import annotations

import functools
import inspect
import random
import threading
import time
from bisect import bisect_right
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ParamSpec, TypeVar, cast

from anytime.clocks import Clock, WallClock
from anytime.errors import AnytimeError

P = ParamSpec("P")
R = TypeVar("R")
Score = Callable[[Any], float]
FRAMES = 1000  # that are kept, drawn evenly from all
RESULTS = 64  # of one call whose times are kept, and whose way to others is known, at most
ATOMS = (bool, int, str, bytes, Enum, type(None))  # whose identity says nothing of who made them


@dataclass(frozen=True)
class Watched:
    """A function that is watched.

    parameters: that may be fed by others. score: of a result, None if nobody scores it. cost:
    whether that is a cost. contract: whether it is told its time, `seconds`.
    """

    name: str
    signature: inspect.Signature
    parameters: tuple[str, ...]
    score: Score | None
    cost: bool

    @property
    def contract(self) -> bool:
        return "seconds" in self.signature.parameters


@dataclass
class Seen:
    """One call: seconds within it at each result, scores, what fed it, and whether it returned.

    numbers: which of its results these are: all, or every second, fourth … of many, and the last.
    fed: parameter → (function, which of its results). given: `seconds`, if it was told its time.
    """

    seconds: list[float] = field(default_factory=list[float])
    scores: list[float] = field(default_factory=list[float])
    numbers: list[int] = field(default_factory=list[int])
    fed: dict[str, tuple[str, int]] = field(default_factory=dict[str, tuple[str, int]])
    end: float = 0.0
    complete: bool = False
    given: float | None = None

    def kept(self, number: int) -> int:
        """The place of a result, or of the last one kept before it."""
        return max(bisect_right(self.numbers, number) - 1, 0)


@dataclass
class Frame:
    """The calls of one turn of the loop, by function, in the order in which they began.

    made: their latest results, by function, with the number of each.
    """

    calls: dict[str, Seen] = field(default_factory=dict[str, Seen])
    made: dict[str, deque[tuple[Any, int]]] = field(
        default_factory=dict[str, "deque[tuple[Any, int]]"]
    )


class Shadow:
    """Watches functions of a running system; they do and return what they did.

    `frame` wraps the function that is one turn of the loop, `watch` those whose time is to be
    divided. What is recorded are times, scores and which result went where, never a result. Which
    result went where is known by identity. At most `FRAMES` frames are kept, drawn evenly, so that
    it may run for days. Threads have frames of their own.

    clock: whose time the functions take; real time by default.
    watched: what is watched, by name. frames: what is kept. count: frames so far. overhead: seconds
    that watching took, scores included. busy: seconds of all frames. odd: what could not be
    recorded, and how often.
    """

    def __init__(self, clock: Clock | None = None) -> None:
        self.clock = clock or WallClock()
        self.watched: dict[str, Watched] = {}
        self.frames: list[Frame] = []
        self.count = 0
        self.calls = 0
        self.overhead = 0.0
        self.busy = 0.0
        self.odd: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._luck = random.Random(0)
        self._frame: ContextVar[Frame | None] = ContextVar("frame", default=None)
        self._call: ContextVar[_Watch | None] = ContextVar("call", default=None)

    def frame(self, function: Callable[P, R]) -> Callable[P, R]:
        """The same function, each call of which is one turn of the loop.

        Raises AnytimeError for what is not a plain function: a call of another returns before its
        turn is over.
        """
        if _is_async(function) or inspect.isgeneratorfunction(function):
            raise AnytimeError(f"cannot watch {function!r} as a frame; give a plain function")

        @functools.wraps(function)
        def turn(*args: P.args, **kwargs: P.kwargs) -> R:
            with self._turn():
                return function(*args, **kwargs)

        return turn

    def watch(
        self,
        function: Callable[P, R],
        *,
        quality: Score | None = None,
        cost: Score | None = None,
    ) -> Callable[P, R]:
        """The same function, watched within frames. Each result of a generator counts, and what is
        given to `register`; the returned value is the last.

        quality, cost: called with (result) in the running system, so let them be quick; without
        either only times are known. What they raise is counted and goes no further.
        Raises AnytimeError for what is not a plain function or generator function, and for a name
        that is watched already.
        """
        name = getattr(function, "__name__", "")
        if not callable(function) or _is_async(function) or not name:
            raise AnytimeError(f"cannot watch {function!r}; give a function or generator function")
        if name in self.watched:
            raise AnytimeError(f"{name!r} is watched already; names must differ")
        if quality and cost:
            raise AnytimeError(f"{name!r}: give quality=… or cost=…, not both")
        try:
            known = inspect.signature(function)
        except ValueError:
            raise AnytimeError(f"cannot watch {name!r}: it tells no parameters; wrap it") from None
        many = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
        kinds = {each: parameter.kind for each, parameter in known.parameters.items()}
        names = tuple(n for n, kind in kinds.items() if kind not in many and n != "seconds")
        watched = Watched(name, known, names, quality or cost, cost is not None)
        self.watched[name] = watched
        made = _generator if inspect.isgeneratorfunction(function) else _function
        return cast("Callable[P, R]", made(self, watched, function))

    def register(self, value: Any, *ignored: object) -> None:
        """A result so far of the watched call that is going on; nothing outside of one."""
        call = self._call.get()
        if call is not None:
            with self.watching():
                call.pause(value)

    def kept(self) -> list[Frame]:
        """The frames that are kept, at this moment."""
        with self._lock:
            return list(self.frames)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Count the real time that passes in here as overhead."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.overhead += time.perf_counter() - began

    @contextmanager
    def _turn(self) -> Iterator[None]:
        if self._frame.get() is not None:  # a turn within a turn is part of it
            yield
            return
        token = self._frame.set(Frame())
        began = time.perf_counter()
        try:
            yield
        finally:
            frame = cast("Frame", self._frame.get())
            self._frame.reset(token)
            self._keep(frame, time.perf_counter() - began)

    def _keep(self, frame: Frame, took: float) -> None:
        frame.made.clear()  # the only references to results
        with self._lock:
            self.count += 1
            self.calls += len(frame.calls)
            self.busy += took
            if len(self.frames) < FRAMES:
                self.frames.append(frame)
                return
            place = self._luck.randrange(self.count)
            if place < FRAMES:
                self.frames[place] = frame

    def begin(self, watched: Watched, args: Any, kwargs: Any) -> _Watch | None:
        """A call that begins; None where it is not recorded."""
        frame = self._frame.get()
        if frame is None:
            self.odd[f"{watched.name} outside of frames"] += 1
            return None
        if self._call.get() is not None:
            self.odd[f"{watched.name} within another"] += 1
            return None
        if watched.name in frame.calls:
            self.odd[f"{watched.name} once more in a frame"] += 1
            return None
        seen = frame.calls[watched.name] = Seen()
        try:
            bound = watched.signature.bind(*args, **kwargs).arguments
        except TypeError:  # the function itself will say so
            bound = {}
        for name, value in bound.items():
            source = _maker(frame, value)
            if name in watched.parameters and source is not None:
                seen.fed[name] = source
        given = bound.get("seconds")
        seen.given = float(given) if isinstance(given, int | float) else None
        return _Watch(self, self._call, watched, frame, seen)


def _is_async(function: Callable[..., Any]) -> bool:
    return inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function)


def _maker(frame: Frame, value: Any) -> tuple[str, int] | None:
    """Which result of this frame a value is: the last that is the very same object."""
    if isinstance(value, ATOMS) or (type(value) is tuple and not value):
        return None
    found = (
        (name, number)
        for name, results in reversed(frame.made.items())
        for made, number in reversed(results)
        if made is value
    )
    return next(found, None)


class _Watch:
    """A watched call in progress. Its time is that spent within it, without what watching takes."""

    def __init__(
        self,
        shadow: Shadow,
        current: ContextVar[_Watch | None],
        watched: Watched,
        frame: Frame,
        seen: Seen,
    ) -> None:
        self._shadow, self._current = shadow, current
        self._watched, self._frame, self._seen = watched, frame, seen
        self._spent = 0.0  # before it was entered this time
        self._entered = 0.0
        self._results, self._stride = 0, 1

    def enter(self) -> Any:
        token = self._current.set(self)
        self._entered = self._shadow.clock.now()
        return token

    def leave(self, token: Any) -> None:
        self._spent += self._shadow.clock.now() - self._entered
        self._current.reset(token)

    def pause(self, value: Any) -> None:
        """Note a result from within the call."""
        self._spent += self._shadow.clock.now() - self._entered
        self.result(value)
        self._entered = self._shadow.clock.now()

    def result(self, value: Any) -> None:
        """Note a result that came just now."""
        seen, score = self._seen, self._watched.score
        try:
            # What nobody scores is there or is not.
            worth = 1.0 if score is None else float(score(value))
            fits = 0 <= worth < float("inf") if self._watched.cost else 0 <= worth <= 1
        except Exception:  # a score that fails is our trouble, not the system's
            fits, worth = False, 0.0
        if not fits:
            self._shadow.odd[f"{self._watched.name} with a score that is none"] += 1
            return
        number, name = self._results, self._watched.name
        self._results += 1
        if seen.numbers and seen.numbers[-1] % self._stride:  # it was kept as the last
            del seen.seconds[-1], seen.scores[-1], seen.numbers[-1]
        seen.seconds.append(round(self._spent, 9))
        seen.scores.append(worth)
        seen.numbers.append(number)
        if len(seen.numbers) > RESULTS:
            self._stride *= 2
            for row in (seen.seconds, seen.scores, seen.numbers):
                del row[1:-1:2]
        parts: tuple[Any, ...] = cast("tuple[Any, ...]", value) if type(value) is tuple else ()
        made = self._frame.made.setdefault(name, deque(maxlen=RESULTS))
        made.extend((part, number) for part in (value, *parts))

    def end(self, complete: bool) -> None:
        self._seen.end, self._seen.complete = round(self._spent, 9), complete


def _function(shadow: Shadow, watched: Watched, function: Callable[..., Any]) -> Any:
    @functools.wraps(function)
    def same(*args: Any, **kwargs: Any) -> Any:
        with shadow.watching():
            call = shadow.begin(watched, args, kwargs)
        if call is None:
            return function(*args, **kwargs)
        token = call.enter()
        try:
            value = function(*args, **kwargs)
        except BaseException:
            call.leave(token)
            call.end(complete=False)
            raise
        call.leave(token)
        with shadow.watching():
            if value is not None:  # what it registered counts
                call.result(value)
            call.end(complete=True)
        return value

    return same


def _generator(shadow: Shadow, watched: Watched, function: Callable[..., Any]) -> Any:
    @functools.wraps(function)
    def same(*args: Any, **kwargs: Any) -> Generator[Any, Any, Any]:
        inner: Generator[Any, Any, Any] = function(*args, **kwargs)
        with shadow.watching():
            call = shadow.begin(watched, args, kwargs)
        if call is None:
            return (yield from inner)
        sent: Any = None
        thrown: BaseException | None = None
        while True:
            token = call.enter()
            try:
                value = inner.send(sent) if thrown is None else inner.throw(thrown)
            except StopIteration as ended:
                call.leave(token)
                with shadow.watching():
                    if ended.value is not None:
                        call.result(ended.value)
                    call.end(complete=True)
                return ended.value
            except BaseException:
                call.leave(token)
                call.end(complete=False)
                raise
            call.leave(token)
            with shadow.watching():
                if value is not None:  # a bare yield is a check-point
                    call.result(value)
                call.end(complete=False)
            sent, thrown = None, None
            try:
                sent = yield value
            except GeneratorExit:
                inner.close()
                raise
            except BaseException as error:
                thrown = error

    return same
