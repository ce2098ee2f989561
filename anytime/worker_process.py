"""What runs in a worker process: one module after the other, for whoever holds the other end.

A job says whether the worker keeps the time itself (real time), or asks after each check-point and
is told the time (a work clock, which only the caller has).
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import math
import os
import pickle
import resource
import socket
import struct
import threading
import time
from dataclasses import replace
from typing import Any

from anytime import isolation, naming
from anytime.clocks import Clock, Deadline, WallClock
from anytime.errors import AnytimeError
from anytime.mail import ClosedError, Mailbox
from anytime.modules import Module
from anytime.results import Fault
from anytime.running import RECENT, Run, perform
from anytime.worker_letters import (
    BEGINS,
    BEGUN,
    DONE,
    GRACE,
    JOB,
    LAST,
    LEAVE,
    POST,
    POSTED,
    READY,
    STOP,
    Job,
)

_ALONE = 120.0  # seconds without an answer after which a worker takes its caller for dead
_TOLD = 2000  # characters of what a fault says
_LONGEST = 1e6  # seconds that the watchdog can be set to


class _ToldClock:
    """The caller's clock as it was when it last answered."""

    def __init__(self, now: float) -> None:
        self.time = now

    def now(self) -> float:
        return self.time

    def spend(self, module: str, work: float, step: int | None) -> None:
        """The caller charges it."""

    def advance(self, seconds: float) -> None:
        """The caller lets time pass."""


class _PostingRun(Run):
    """A run that posts each check-point to its caller."""

    def __init__(self, module: Module, deadline: Deadline, mailbox: Mailbox) -> None:
        super().__init__(module, deadline)
        self._mailbox = mailbox
        self._turn = threading.RLock()  # the module may have threads, and a letter is whole
        self._charged: list[float] = []
        self._due = False
        self._fresh: bytes | None = None
        self._stopped = False
        self._watched = 0.0

    def charge(self, work: float) -> None:
        with self._turn:
            super().charge(work)
            self._charged.append(work)

    def check(self) -> None:
        super().check()
        self._due = True
        del self.step_seconds[:-RECENT]

    def record(self, value: Any) -> None:
        super().record(value)
        self._fresh = pickled(value)
        self._due = True
        del self.history[:-1]

    def register(self, value: Any, *ignored: object) -> None:
        with self._turn:
            self.check()
            self.record(value)
            self._post(POST)
            if self._stopped or self.deadline.expired():
                self.stop()

    def expired(self) -> bool:
        with self._turn:
            self.check()
            self._post(POST)
            self.cut = self.cut or self._stopped or self.deadline.expired()
            return self.cut

    def may_step(self) -> bool:
        self._post(POST)
        if self._stopped:
            self.cut = True
            return False
        return isinstance(self.deadline.clock, _ToldClock) or super().may_step()

    def finish(self) -> None:
        """Post what came with the end; it is too late for that when the time is up."""
        told = isinstance(self.deadline.clock, _ToldClock)
        self.cut = self.cut or (self._due and not told and self.deadline.expired())
        self._post(LAST)

    def _post(self, kind: bytes) -> None:
        """Tell the caller of a check-point; on its clock, wait for what it says."""
        told = self.deadline.clock if isinstance(self.deadline.clock, _ToldClock) else None
        if self._due and (told or not self.deadline.expired()):
            estimate = self.history[-1].estimate if self._fresh is not None else None
            seen = math.nan if estimate is None else estimate
            now = self.deadline.clock.now()
            head = POSTED.pack(now, self._fresh is not None, seen, len(self._charged))
            charges = struct.pack(f"<{len(self._charged)}d", *self._charged)
            try:
                self._mailbox.send(kind, head + charges + (self._fresh or b""))
                if told and kind == POST:
                    self._answer(told)
            except ClosedError:  # nobody is there; a module must not be able to swallow that
                os._exit(0)
        elif not told and self._mailbox.waiting():
            self._stopped = True
        self._due, self._fresh = False, None
        self._charged.clear()

    def _answer(self, clock: _ToldClock) -> None:
        now = time.perf_counter()
        if now > self._watched + _ALONE / 4:
            self._watched = now
            watch(_ALONE)
        letter = self._mailbox.receive(math.inf)
        assert letter is not None
        (clock.time,) = struct.unpack("<d", letter.content)
        self._stopped = letter.kind == STOP


def watch(seconds: float) -> None:
    """End this process in so many seconds, whatever it is doing by then: the watchdog's thread
    needs neither the interpreter nor a signal."""
    faulthandler.dump_traceback_later(min(seconds, _LONGEST), exit=True, file=2)


def pickled(value: Any) -> bytes:
    """A value as it travels. It is read back once, so that what cannot be read fails here."""
    content = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
    pickle.loads(content)
    return content


def main(descriptor: int, known: list[tuple[str, str, str]]) -> None:
    """Serve the caller until it hangs up."""
    mailbox = Mailbox(socket.socket(fileno=descriptor))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    isolation.become_worker()
    idle = _address_space()
    for address in known:
        with contextlib.suppress(Exception, SystemExit):
            naming.found(*address)
    gc.collect()
    gc.freeze()
    with contextlib.suppress(ClosedError):
        mailbox.send(READY)
        while True:
            letter = mailbox.receive(math.inf)
            assert letter is not None
            if letter.kind == JOB:
                mailbox.send(BEGUN, BEGINS.pack(time.perf_counter()))
                fault, complete = _served(letter.content, mailbox, idle)
                soiled = _left_something()
                mailbox.send(LEAVE if soiled else DONE, pickle.dumps((complete, fault)))
                if soiled:
                    return


def _served(content: bytes, mailbox: Mailbox, idle: int) -> tuple[Fault | None, bool]:
    """Run one job; what it raised, and whether the module completed."""
    try:
        job: Job = pickle.loads(content)
        clock: Clock = WallClock() if job.told is None else _ToldClock(job.told)
        left = max(0.0, job.ends - time.perf_counter()) + GRACE
        watch(_ALONE if job.told is not None else left)
        _limit(idle + job.memory)
        module = naming.found(*job.module)
        if not isinstance(module, Module):
            raise AnytimeError(f"{job.module[1]} is {type(module).__name__}, not a module")
        run = _PostingRun(module, Deadline(clock, job.ends), mailbox)
        with isolation.serving():
            complete, fault = perform(run, job.inputs, job.filled, lambda _: run.may_step())
        run.finish()
        return fault and replace(fault, message=fault.message[:_TOLD]), complete and not run.cut
    except BaseException as error:
        return Fault.of(error), False
    finally:
        faulthandler.cancel_dump_traceback_later()
        _limit(resource.RLIM_INFINITY)


def _limit(memory: int) -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard != resource.RLIM_INFINITY and (memory == resource.RLIM_INFINITY or memory > hard):
        memory = hard
    with contextlib.suppress(OSError, ValueError):  # not every system grants it
        resource.setrlimit(resource.RLIMIT_AS, (memory, hard))


def _address_space() -> int:
    """Bytes of memory that are mapped now; what the limit counts from."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[0]) * resource.getpagesize()
    except OSError:
        return 4 * 2**30


def _left_something() -> bool:
    """Whether the module left threads or processes behind; then this one is not used again."""
    if threading.active_count() > 1:
        return True
    try:
        os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        return False
    return True
