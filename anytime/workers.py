"""Worker processes: one that works and one that is warm, because any of them may have to die."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from anytime import naming
from anytime.mail import ClosedError, Letter, Mailbox
from anytime.worker_letters import DONE, GRACE, READY

KEPT = 2  # processes: one to work and one that is warm
STILLBORNS = 4  # workers that die before they are ready, after which no more are tried for a run
_LOOK = 0.002  # seconds between two looks at who is ready


def _program(descriptor: int, known: list[naming.Address]) -> str:
    """The text of a Python program that serves at this descriptor."""
    return (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        f"from anytime.worker_process import main; main({descriptor}, {known!r})"
    )


class Worker:
    """A process that runs modules, from this side."""

    def __init__(self, known: list[naming.Address]) -> None:
        ours, theirs = socket.socketpair()
        try:
            # A session of its own: a Ctrl-C at the terminal is the caller's, and whatever the
            # module starts dies with the worker.
            self.process = subprocess.Popen(
                [sys.executable, "-c", _program(theirs.fileno(), known)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        finally:
            theirs.close()
        self.mailbox = Mailbox(ours)
        self.ready = False
        self.idle = False
        self.ends = float("inf")  # of the job that it is at
        self.knows = set(known)

    def look(self) -> None:
        """Take what it has posted since it was cut; that came too late. Raises ClosedError."""
        while not self.idle and (letter := self.mailbox.receive(0.0)) is not None:
            self.ready = True
            self.idle = letter.kind in (READY, DONE)

    def receive(self, until: float) -> Letter | None:
        """Its next letter. Raises ClosedError when it died."""
        letter = self.mailbox.receive(until)
        if letter is not None and letter.kind == DONE:
            self.idle = True
        return letter

    def died(self) -> str:
        """How it died, of one whose line is closed."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(0.05)
        code = self.process.poll()
        if code is None:
            return "the worker hung up"
        if code < 0:
            return f"the worker died of {signal.Signals(-code).name}"
        return f"the worker exited with {code}"

    def kill(self) -> None:
        """Kill it and all that it started. A large process takes a while to be gone."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.kill()
        self.mailbox.close()


class Workers:
    """The worker processes of this process."""

    def __init__(self) -> None:
        self._kept: list[Worker] = []
        self._dying: list[Worker] = []
        self._known: list[naming.Address] = []
        self._lock = threading.Lock()
        self._stillborn = ""  # how the last one died that was never ready …
        self._stillborns = 0  # … and how many did

    def take(
        self,
        module: naming.Address,
        until: float,
        interrupted: Callable[[], bool] = lambda: False,
    ) -> Worker | None:
        """A worker that is ready, until a time of `time.perf_counter` or an interruption; None if
        none became so, see `missing`, or if one after the other dies. Whoever takes one gives it
        back or ends it.
        """
        with self._lock:
            self._learn(module)
            before = self._stillborns
        while not interrupted() and self._stillborns - before < STILLBORNS:
            with self._lock:
                worker = self._ready(module)
                if worker is not None:
                    self._kept.remove(worker)
                self._fill(KEPT if worker is None else KEPT - 1)
            if worker is not None:
                return worker
            left = until - time.perf_counter()
            if left <= 0:
                break
            time.sleep(min(left, _LOOK))
        return None

    def missing(self) -> str:
        """Why `take` may have found none."""
        died = self._stillborn and f"; of the last that was never ready: {self._stillborn}"
        return f"no worker process became ready in time{died}"

    def give(self, worker: Worker) -> None:
        """Give back a worker, idle or not."""
        with self._lock:
            self._kept.insert(0, worker)
            while len(self._kept) > KEPT:
                self._bury(self._kept.pop())

    def bury(self, worker: Worker) -> None:
        """End a worker that was taken."""
        with self._lock:
            self._bury(worker)

    def close(self) -> None:
        """End all worker processes, and wait for that; the next run starts new ones."""
        with self._lock:
            for worker in self._kept:
                self._bury(worker)
            for worker in self._dying:
                worker.process.wait()
            self._kept, self._dying = [], []

    def forget(self) -> None:
        """In a child of this process: the workers are its parent's."""
        self._kept, self._dying, self._lock = [], [], threading.Lock()

    def _learn(self, module: naming.Address) -> None:
        if module not in self._known:
            self._known.append(module)
            if module[0] == "__main__":
                sys.modules.setdefault(naming.SCRIPT, sys.modules["__main__"])

    def _ready(self, module: naming.Address) -> Worker | None:
        """An idle worker, one that knows the module if there is any; the dead are buried."""
        for worker in tuple(self._kept):
            try:
                worker.look()
                hung = not worker.idle and time.perf_counter() > worker.ends + GRACE
            except ClosedError:
                hung = True
            if hung or worker.process.poll() is not None:
                if not worker.ready:
                    self._stillborn = worker.died()
                    self._stillborns += 1
                self._kept.remove(worker)
                self._bury(worker)
        idle = [worker for worker in self._kept if worker.idle]
        return next((worker for worker in idle if module in worker.knows), next(iter(idle), None))

    def _bury(self, worker: Worker) -> None:
        worker.kill()
        self._dying = [each for each in (*self._dying, worker) if each.process.poll() is None]

    def _fill(self, count: int) -> None:
        while len(self._kept) < count:
            self._kept.append(Worker(list(self._known)))


workers = Workers()
"""Those that isolated modules run in."""

atexit.register(workers.close)
os.register_at_fork(after_in_child=workers.forget)
