"""Campaigns: many seeded runs on any executor, which survive workers that die and runs that kill.

A run depends on what is run alone, never on the worker or the order (`running.seed_of`), so every
executor gives the same bytes when time is counted in work.
"""

from __future__ import annotations

import functools
import os
import pickle
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import Any

from anytime import naming
from anytime.errors import AnytimeError
from anytime.executors import Make
from anytime.outcomes import Outcome
from anytime.programs import Program
from anytime.sampling import COMBINATIONS, CONTRACTS, How, sampled

BATCH = 0.2  # seconds of work that are sent at a time
LARGEST = 64  # problems that are sent at a time, at most
AHEAD = 8  # batches that are sent before the first comes back
TRIES = 2  # workers that a run may kill before it is left out
HOPELESS = 5  # problems left out, while none has succeeded, that end a campaign
PATIENCE = 60.0  # seconds, beyond what its runs may take, after which a problem counts as hung


def lived(
    program: Program,
    problems: Mapping[str, Any],
    how: How,
    make: Make | None,
    keep: Callable[[Outcome], None],
    *,
    hopeful: bool = False,
) -> None:
    """Run a program on problems and hand each outcome to `keep`, as they come.

    make: makes the executor, anew when its workers died; None runs here, as does what cannot be
    sent. hopeful: whether others have succeeded before. Raises AnytimeError when the first problems
    all fail, unless it is hopeful, with the reason.
    """
    counted = keep if hopeful else _hopeful(keep)
    if make is None:
        _here(program, problems, problems, how, counted)
        return
    try:
        job = _job(program, how)
        cargo = {key: pickle.dumps(problem) for key, problem in problems.items()}
    except Exception as error:
        reason = " ".join(str(error).split())
        warnings.warn(f"{program.name} is measured serially: {reason}", stacklevel=4)
        _here(program, problems, problems, how, counted)
        return
    _Crew(job, cargo, make, _longest(program, how)).work(counted)


def _here(
    program: Program,
    keys: Iterable[str],
    problems: Mapping[str, Any],
    how: How,
    keep: Callable[[Outcome], None],
) -> None:
    for key in keys:
        keep(_outcome(program, key, problems[key], how))


def _outcome(program: Program, key: str, problem: Any, how: How) -> Outcome:
    try:
        return sampled(program, key, problem, how)
    except (Exception, SystemExit) as error:  # one problem's trouble is not the campaign's
        return _failed(key, error)


def _failed(key: str, error: BaseException) -> Outcome:
    told = str(error) if isinstance(error, AnytimeError) else f"{type(error).__name__}: {error}"
    told = told.encode(errors="backslashreplace").decode()  # a store is UTF-8
    return Outcome(key, failed=" ".join(told.split())[:300])


def _hopeful(keep: Callable[[Outcome], None]) -> Callable[[Outcome], None]:
    """`keep`, until so many have failed that nothing else is to be expected."""
    count = Counter[bool]()

    def counted(outcome: Outcome) -> None:
        keep(outcome)
        count[outcome.failed is None] += 1
        if not count[True] and count[False] >= HOPELESS:
            raise AnytimeError(f"the first {HOPELESS} problems all failed: {outcome.failed}")

    return counted


def _longest(program: Program, how: How) -> float:
    """Seconds after which the runs on one problem have hung."""
    runs = sum(COMBINATIONS * (CONTRACTS if call.module.contract else 1) for call in program.calls)
    return PATIENCE + 2 * runs * (how.seconds + how.rest)


def _job(program: Program, how: How) -> bytes:
    """A program as it travels: its modules by their names. Raises what says why it cannot."""
    addresses = [naming.address(call.module.function) for call in program.calls]
    for module, _, file in addresses:
        if not file:
            raise AnytimeError(f"{module} has no file that another process could find")
    try:
        pickle.dumps(how.clock)
    except Exception:
        raise AnytimeError(
            "its clock cannot be sent to another process; give "
            "functools.partial(anytime.WorkClock, machine), no lambda"
        ) from None
    return pickle.dumps((addresses, pickle.dumps((program, how))))


def _perform(
    job: bytes, batch: list[tuple[str, bytes]], longest: float, sender: int
) -> list[Outcome]:
    """What a worker does. One that hangs is ended by a watchdog, which is a worker that died; but
    not a thread of the process that sent it, which would be ended with it."""
    import faulthandler

    program, how = _unpacked(job)
    done: list[Outcome] = []
    for key, content in batch:
        if os.getpid() != sender:
            faulthandler.dump_traceback_later(longest, exit=True, file=2)
        try:
            problem = pickle.loads(content)
        except Exception as error:
            done.append(_failed(key, error))
        else:
            done.append(_outcome(program, key, problem, how))
        finally:
            faulthandler.cancel_dump_traceback_later()
    return done


@functools.lru_cache(maxsize=4)
def _unpacked(job: bytes) -> tuple[Program, How]:
    addresses, content = pickle.loads(job)
    for address in addresses:  # their files first: problems may be of classes in there
        naming.found(*address)
    return pickle.loads(content)


class _Crew:
    """The workers of a campaign, from this side.

    When workers die, nobody knows which run killed them: all that were on their way are suspects,
    and run alone. One that kills its worker when it is alone, twice, is left out.
    """

    def __init__(self, job: bytes, cargo: Mapping[str, bytes], make: Make, longest: float) -> None:
        self._job, self._cargo, self._make, self._longest = job, cargo, make, longest
        self._queue = deque(cargo)
        self._suspects: deque[str] = deque()
        self._kills = Counter[str]()
        self._sent: dict[Future[list[Outcome]], list[str]] = {}
        self._size = 1
        self._since = time.perf_counter()

    def work(self, keep: Callable[[Outcome], None]) -> None:
        executor = self._make()
        try:
            while self._queue or self._suspects or self._sent:
                if not self._fill(executor) or self._collect(keep):
                    self._lost(self._sent.values(), keep)
                    self._sent.clear()
                    executor.shutdown(wait=False, cancel_futures=True)
                    executor = self._make()
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            raise
        executor.shutdown()

    def _fill(self, executor: Executor) -> bool:
        """Send batches; whether the executor took them."""
        try:
            if self._suspects:
                if not self._sent:
                    self._send(executor, [self._suspects.popleft()])
                return True
            while self._queue and len(self._sent) < AHEAD:
                count = min(self._size, len(self._queue))
                self._send(executor, [self._queue.popleft() for _ in range(count)])
        except BrokenExecutor:
            return False
        return True

    def _send(self, executor: Executor, keys: list[str]) -> None:
        batch = [(key, self._cargo[key]) for key in keys]
        try:
            future = executor.submit(_perform, self._job, batch, self._longest, os.getpid())
        except BrokenExecutor:
            self._suspects.extend(keys)
            raise
        self._sent[future] = keys

    def _collect(self, keep: Callable[[Outcome], None]) -> bool:
        """Keep what has come back; whether the executor is broken."""
        came, _ = wait(self._sent, return_when=FIRST_COMPLETED)
        broken, lost = False, list[list[str]]()
        for future in came:
            try:
                outcomes = future.result()
            except BrokenExecutor:
                broken = True
                continue
            except Exception:  # how other executors say that a worker died
                lost.append(self._sent.pop(future))
                continue
            keys = self._sent.pop(future)
            self._measure(len(keys))
            for outcome in outcomes:
                keep(outcome)
        self._lost(lost, keep)
        return broken

    def _measure(self, count: int) -> None:
        """Suit the size of a batch to how long problems take."""
        now = time.perf_counter()
        each, self._since = (now - self._since) / count, now
        self._size = max(1, min(LARGEST, 2 * self._size, round(BATCH / max(each, 1e-6))))

    def _lost(self, batches: Iterable[list[str]], keep: Callable[[Outcome], None]) -> None:
        every = list(batches)
        alone = len(every) == 1 and len(every[0]) == 1
        for key in (key for batch in every for key in batch):
            self._kills[key] += alone
            if self._kills[key] < TRIES:
                self._suspects.append(key)
                continue
            keep(
                Outcome(
                    key,
                    failed=f"its worker died {TRIES} times; a script needs its work under "
                    'if __name__ == "__main__":',
                    fatal=True,
                )
            )
