"""Running a module in a worker process, so that nothing it does can hold the caller."""

from __future__ import annotations

import contextlib
import math
import pickle
import struct
import time
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Any

from anytime import naming
from anytime.clocks import WallClock
from anytime.errors import AnytimeError
from anytime.mail import ClosedError
from anytime.results import Fault
from anytime.worker_letters import BEGINS, BEGUN, DONE, GO, JOB, LEAVE, POST, POSTED, STOP, Job

if TYPE_CHECKING:
    from anytime.mail import Letter
    from anytime.modules import Module
    from anytime.running import Run
    from anytime.workers import Worker

STARTS = 60.0  # seconds that a worker process may take to import a module
HUNG = 5.0  # seconds of real time without progress, after which a run on a work clock is cut
STUBBORN = 16  # check-points after it was told to stop, after which such a run is cut
_LISTENS = 0.002  # seconds between two questions whether a deadline's event has come
_DRAIN = 0.002  # seconds past a deadline in which what was posted in time may still arrive


class _Process:
    """What this process is to isolated modules."""

    is_worker = False
    is_serving = False


def within() -> bool:
    """Whether this process is a worker, so that what it runs is isolated already.

    Raises AnytimeError in a worker that has no job: a script that is run again to be imported.
    """
    if _Process.is_worker and not _Process.is_serving:
        raise AnytimeError(
            "a worker process imports the script that its module is in; put what the script does "
            'under `if __name__ == "__main__":`'
        )
    return _Process.is_worker


def become_worker() -> None:
    """This process is a worker from now on."""
    _Process.is_worker = True


@contextlib.contextmanager
def serving() -> Generator[None]:
    """The worker is at a job."""
    _Process.is_serving = True
    try:
        yield
    finally:
        _Process.is_serving = False


def warm(module: Module) -> None:
    """Have a worker process that has imported an isolated module, if one can be had."""
    if module.isolated is None or within():
        return
    from anytime.workers import workers

    address = naming.address(module.function)
    until = time.perf_counter() + STARTS
    while (worker := workers.take(address, until)) is not None:
        if address in worker.knows:
            workers.give(worker)
            return
        workers.bury(worker)


def perform(
    current: Run,
    inputs: tuple[Any, ...],
    filled: dict[str, Any],
    may_step: Callable[[Run], bool],
) -> tuple[bool, Fault | None]:
    """Let a run's module work in a worker process; whether it completed, and what went wrong.

    In real time the worker keeps the time itself and control is back at the deadline, whatever it
    does. On a work clock the worker is told the time after each check-point, so that the run is
    that of this process bit for bit; one that makes no progress is charged its whole contract.
    """
    from anytime.workers import workers  # only who isolates pays for them

    real = isinstance(current.deadline.clock, WallClock)
    until = current.deadline.at if real else time.perf_counter() + HUNG
    try:
        address = naming.address(current.module.function)
        job = _job(current, address, inputs, filled, None if real else current.deadline.clock.now())
        interrupted = current.deadline.interrupted
        while (worker := workers.take(address, until, interrupted)) is not None:
            run = _Isolated(current, worker, may_step)
            try:
                complete, fault = run.live(job, until) if real else run.live_told(job, until)
            except BaseException:
                workers.bury(worker)
                raise
            (workers.bury if run.broken else workers.give)(worker)
            if run.begun or not run.broken:  # else it had died before
                return complete and not current.cut, fault
    except (AnytimeError, OSError) as error:
        return False, Fault.of(error)
    finally:
        current.close()
    if interrupted():
        return False, None
    return False, Fault("TimeoutError", workers.missing())


def _job(
    current: Run,
    address: naming.Address,
    inputs: tuple[Any, ...],
    filled: dict[str, Any],
    told: float | None,
) -> bytes:
    limits = current.module.isolated
    assert limits is not None
    job = Job(address, inputs, filled, limits.memory, current.deadline.at, told)
    try:
        return pickle.dumps(job, protocol=pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        raise AnytimeError(
            f"the inputs of the isolated module {current.module.name!r} cannot be sent: {error}"
        ) from error


class _Isolated:
    """One run in a worker process, from this side."""

    def __init__(self, current: Run, worker: Worker, may_step: Callable[[Run], bool]) -> None:
        self.run, self.worker, self.may_step = current, worker, may_step
        self.begun = False
        self.broken = False
        self._values: list[bytes] = []  # the last that were posted and not looked at

    def live(self, job: bytes, until: float) -> tuple[bool, Fault | None]:
        """In real time."""
        worker, deadline = self.worker, self.run.deadline
        worker.idle, worker.ends = False, deadline.at
        complete, fault = False, None
        try:
            worker.mailbox.send(JOB, job, until=until)
            while (letter := self._heard()) is not None:
                self.begun = True
                if letter.kind == BEGUN:
                    self.run.begin(self._moment(*BEGINS.unpack(letter.content)))
                    continue
                if letter.kind in (DONE, LEAVE):
                    complete, fault = pickle.loads(letter.content)
                    break
                if time.perf_counter() > deadline.at + _DRAIN:
                    break
                try:
                    self._adopt(letter.content)
                except Exception as error:  # a value that cannot be read, or who looks on failed
                    fault = Fault.of(error)
                    self._stop()
                    break
                if letter.kind == POST and not self.may_step(self.run):
                    self._stop()
                    break
            else:
                if deadline.interrupted():
                    self._stop()
        except (ClosedError, TimeoutError, struct.error, pickle.UnpicklingError) as error:
            fault = self._died(error)
        return complete, self._unpacked() or fault

    def _stop(self) -> None:
        self.worker.ends = time.perf_counter()
        self.worker.mailbox.send(STOP, until=self.worker.ends)

    def _heard(self) -> Letter | None:
        """The worker's next letter; None when the time is up, or when the event has come."""
        deadline = self.run.deadline
        until = deadline.at
        while not deadline.interrupted():
            if deadline.event is not None:
                until = min(deadline.at, time.perf_counter() + _LISTENS)
            letter = self.worker.receive(until)
            if letter is not None or until >= deadline.at:
                return letter
        return None

    def live_told(self, job: bytes, until: float) -> tuple[bool, Fault | None]:
        """On the caller's clock: each check-point waits for its answer."""
        worker, deadline, run = self.worker, self.run.deadline, self.run
        worker.idle = False
        complete, fault, stops = False, None, 0
        try:
            worker.mailbox.send(JOB, job, until=until)
            while (letter := worker.receive(time.perf_counter() + HUNG)) is not None:
                self.begun = True
                if letter.kind == BEGUN:
                    continue
                if letter.kind in (DONE, LEAVE):
                    complete, error = pickle.loads(letter.content)
                    fault = fault or error
                    break
                go = True
                try:
                    self._replay(letter.content)
                    if letter.kind != POST:
                        continue
                    go = self.may_step(run) if run.module.generator else not deadline.expired()
                    go = go and not deadline.interrupted()
                except Exception as error:
                    go, fault = False, Fault.of(error)
                now = struct.pack("<d", deadline.clock.now())
                worker.mailbox.send(GO if go else STOP, now, until=time.perf_counter() + HUNG)
                run.cut = run.cut or not go
                stops += not go
                if stops > STUBBORN:
                    self.broken = True
                    return False, self._unpacked() or Fault(
                        "Hung", "it was told to stop, and goes on"
                    )
            else:
                raise TimeoutError(f"no progress for {HUNG:g} s")
        except (ClosedError, TimeoutError, struct.error, pickle.UnpicklingError) as error:
            fault = self._died(error)
            if isinstance(error, TimeoutError):
                deadline.clock.advance(max(0.0, deadline.remaining()))
        return complete, self._unpacked() or fault

    def _died(self, error: BaseException) -> Fault:
        self.broken = True
        if isinstance(error, ClosedError):
            return Fault("Died", self.worker.died())
        return Fault("Hung" if isinstance(error, TimeoutError) else "Garbled", str(error))

    def _adopt(self, content: bytes) -> None:
        """Take over a check-point that the worker's clock has counted."""
        at, seen, charges, value = self._read(content)
        at = self._moment(at)
        self.run.adopt(at, charges)
        if value is not None:
            self.run.keep(self._seen(value), seen, at)

    def _moment(self, at: float) -> float:
        """A time that the worker says, within the run."""
        return min(max(at, self.run.started), self.run.deadline.clock.now())

    def _replay(self, content: bytes) -> None:
        """Let a check-point happen on this side's clock."""
        _, seen, charges, value = self._read(content)
        for work in charges:
            self.run.charge(work)
        self.run.check()
        if value is not None:
            self.run.keep(self._seen(value), seen)

    def _seen(self, value: bytes) -> Any:
        """A value, which is looked at now if somebody wants to see each, else at the end."""
        if self.run.observed:
            return pickle.loads(value)
        self._values = [*self._values[-1:], value]
        return None

    def _read(self, content: bytes) -> tuple[float, float | None, tuple[float, ...], bytes | None]:
        at, valued, seen, count = POSTED.unpack_from(content)
        ends = POSTED.size + 8 * count
        charges = struct.unpack(f"<{count}d", content[POSTED.size : ends])
        return at, None if math.isnan(seen) else seen, charges, content[ends:] if valued else None

    def _unpacked(self) -> Fault | None:
        """Look at the last value, at the end alone. Where it cannot be read that before it stands;
        of earlier ones nothing is left."""
        fault = None
        while self._values:
            try:
                self.run.value = pickle.loads(self._values[-1])
                return fault
            except Exception as error:
                fault = fault or Fault.of(error)
                self._values.pop()
                self.run.history.pop()
        if fault is not None:
            self.run.history.clear()
        return fault
