"""Running a module until it completes or its deadline comes."""

from __future__ import annotations

import hashlib
import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np

from anytime import calling, isolation
from anytime.clocks import DECIMALS, INSTANT, Clock, Deadline, WallClock
from anytime.collecting import undisturbed
from anytime.errors import AnytimeError, OutsideRunError
from anytime.modules import Module
from anytime.results import Change, Fault, Result, Status

RECENT = 8  # steps from which the next is expected
STILL = 20_000  # check-points in a row without any time passing, which no clock can ever end


class _Stop(BaseException):
    """Raised by `register` at the deadline; only the run that it carries catches it."""

    def __init__(self, run: Run) -> None:
        super().__init__(run.module.name)
        self.run = run


class Run:
    """One run in progress. `anytime.here()` hands it to a thread; it is closed when it ends."""

    def __init__(
        self,
        module: Module,
        deadline: Deadline,
        observe: Callable[[Any, Change], None] | None = None,
    ) -> None:
        self.module = module
        self.deadline = deadline
        self.started = deadline.clock.now()
        self.value: Any = None
        self.history: list[Change] = []
        self.work = 0.0
        self.step_seconds: list[float] = []
        self.charges = False
        self.mixed = False
        self.cut = False
        self._observe = observe
        self.steps = 0
        self._still = 0
        self._last_step = self.started
        self._closed = False

    def charge(self, work: float) -> None:
        """Count `work` units; from then on checks are free."""
        self._open()
        if not 0 <= work < math.inf:
            raise AnytimeError(
                f"module {self.module.name!r} charged {work}; give a finite number >= 0"
            )
        self.mixed = self.mixed or (self.steps > 0 and not self.charges)
        self.charges = True
        self.work += float(work)
        self.deadline.clock.spend(self.module.name, work, None)

    def check(self) -> None:
        """A check-point: one unit of work, unless the module counts its own."""
        self._open()
        if not self.charges:
            self.work += 1
            self.deadline.clock.spend(self.module.name, 1.0, self.steps)
        now = self.deadline.clock.now()
        self._still = self._still + 1 if now == self._last_step else 0
        if self._still > STILL:
            raise AnytimeError(
                f"module {self.module.name!r} came to {STILL} check-points in no time; it must "
                "charge its work, and its machine must have a rate for it"
            )
        self.step_seconds.append(now - self._last_step)
        self._last_step = now
        self.steps += 1

    def record(self, value: Any) -> None:
        """Keep a result; it replaces the last."""
        estimate = self.module.estimate
        self.keep(value, None if estimate is None else float(estimate(value)))

    def keep(self, value: Any, seen: float | None, at: float | None = None) -> None:
        """Keep a result with what is seen of its quality; at: when it came, now by default."""
        if seen is not None and not 0 <= seen <= 1:
            raise AnytimeError(f"estimate of {self.module.name!r} is {seen}; it must lie in [0, 1]")
        now = self.deadline.clock.now() if at is None else at
        change = Change(now - self.started, self.work, seen)
        self.value = value
        self.history.append(change)
        if self._observe is not None:
            self._observe(value, change)

    def begin(self, at: float) -> None:
        """The module begins in another process: the time until then was no step of it."""
        self._last_step = at

    def adopt(self, at: float, charges: Sequence[float]) -> None:
        """Take over a check-point that another process has counted, and when it was."""
        self.charges = self.charges or bool(charges)
        self.work += sum(charges) if self.charges else 1.0
        self.step_seconds.append(at - self._last_step)
        self._last_step = at
        self.steps += 1

    @property
    def observed(self) -> bool:
        """Whether somebody wants to see each result."""
        return self._observe is not None

    def register(self, value: Any, *ignored: object) -> None:
        """Register a result; at the deadline this does not return."""
        self.check()
        self.record(value)
        if self.deadline.expired():
            self.stop()

    def stop(self) -> NoReturn:
        """End the run here, from within its module."""
        self.cut = True
        raise _Stop(self)

    def expired(self) -> bool:
        """Whether to stop now. Counts as a check-point."""
        self.check()
        self.cut = self.cut or self.deadline.expired()
        return self.cut

    def may_step(self) -> bool:
        """Whether the next step is expected to end in time, from a clipped moving average of the
        steps so far. The first result is never refused before the deadline."""
        left = self.deadline.remaining()
        if left <= 0:
            return False
        if not self.history or not self.step_seconds:
            return True
        recent = self.step_seconds[-RECENT:]
        # From the middle, because what comes first is often at hand and took next to nothing.
        average = sorted(recent)[len(recent) // 2]
        for seconds in recent:
            average += 0.4 * (min(seconds, 4 * average + 1e-6) - average)
        return average <= left + INSTANT

    def call(self, module: Module, arguments: tuple[Any, ...]) -> Any:
        """A module called like a function inside this run: run with what is left."""
        return execute(module, arguments, self.deadline)[0].value

    def close(self) -> None:
        self._closed = True

    def _open(self) -> None:
        if self._closed:
            raise OutsideRunError(
                f"the run of {self.module.name!r} has ended; what comes later is not registered"
            )


def here() -> Run:
    """The current run, to be handed to a thread: its `register`, `expired` and `charge` need no
    context. Raises OutsideRunError outside a run."""
    return _here("here")


def register(value: Any, *ignored: object) -> None:
    """Register a result of the module that runs here; further arguments, which some solvers pass
    to their callbacks, are ignored.

    At the deadline the value is kept and the run ends here. Raises OutsideRunError outside a run.
    """
    _here("register").register(value)


def expired() -> bool:
    """Whether the module that runs here should stop. Raises OutsideRunError outside a run."""
    return _here("expired").expired()


def charge(work: float) -> None:
    """Count `work` units of the module's own currency (expansions, evaluations, exposures).

    Charge before the check-point (`yield`, `register`, `expired`) that the work led to. Raises
    OutsideRunError outside a run.
    """
    _here("charge").charge(work)


def _here(called: str) -> Run:
    run = calling.current.get()
    if not isinstance(run, Run):
        raise OutsideRunError(
            f"anytime.{called}() outside a run; use anytime.run(module, …, seconds=…), "
            "and in a thread the object of anytime.here()"
        )
    return run


def run(
    module: Module,
    *inputs: Any,
    seconds: float | None = None,
    deadline: Deadline | None = None,
    rng: np.random.Generator | None = None,
    memory: dict[str, Any] | None = None,
    on_result: Callable[[Any, Change], None] | None = None,
) -> Result:
    """Run a module until it completes or its time is up, and return the last result.

    seconds: the time it may take; zero or negative means stop now. deadline: the same, absolute;
    give one of them. Inside another run it ends at the earlier deadline. rng, memory: what the
    module's parameters of these names get; fresh ones otherwise, the generator seeded by the
    module's name. What the module raises becomes `Result.fault`.
    Raises AnytimeError for inputs that do not fit the module.
    """
    if not isinstance(module, Module):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(
            f"{type(module).__name__} is not a module; decorate a function with "
            "@anytime.module(…); a compiled program has a run of its own"
        )
    if (seconds is None) == (deadline is None):
        raise AnytimeError(f"give seconds=… or deadline=… to run {module.name!r}, one of them")
    if deadline is not None and not isinstance(deadline, Deadline):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"deadline is {deadline!r}; give Deadline.after(seconds), or seconds=…")
    ends = bounded(seconds, deadline)
    return execute(module, inputs, ends, rng=rng, memory=memory, observe=on_result)[0]


def bounded(
    seconds: float | None, deadline: Deadline | None, clock: Clock | None = None
) -> Deadline:
    """The deadline that is meant; inside another run on the same clock, the earlier of the two.

    Without a clock, `seconds` are those of the run outside, else real time.
    """
    caller = calling.current.get()
    outer = caller if isinstance(caller, Run) else None
    if deadline is None:
        deadline = Deadline.after(
            seconds or 0.0, clock or (outer.deadline.clock if outer else WallClock())
        )
    return deadline if outer is None else deadline.earlier(outer.deadline)


def seed_of(*what: object) -> int:
    """A seed that depends on what is run, never on the order or the process."""
    return int.from_bytes(hashlib.blake2b(repr(what).encode(), digest_size=8).digest(), "big")


def execute(
    module: Module,
    inputs: tuple[Any, ...],
    deadline: Deadline,
    *,
    rng: np.random.Generator | None = None,
    memory: dict[str, Any] | None = None,
    may_step: Callable[[Run], bool] | None = None,
    observe: Callable[[Any, Change], None] | None = None,
) -> tuple[Result, Run]:
    """`run` for those who measure and schedule: also returns the closed `Run`.

    may_step: decides before each step of a generator whether it is still worth starting.
    observe: called off the record with each registered value.
    """
    if len(inputs) != len(module.parameters):
        raise AnytimeError(
            f"module {module.name!r} takes {len(module.parameters)} inputs "
            f"({', '.join(module.parameters)}), not {len(inputs)}"
        )
    filled: dict[str, Any] = dict(module.chosen)
    if "seconds" in module.filled:
        filled["seconds"] = max(0.0, deadline.remaining())
    if "rng" in module.filled:
        filled["rng"] = rng if rng is not None else np.random.default_rng(seed_of(module.name))
    if "memory" in module.filled:
        filled["memory"] = memory if memory is not None else {}
    current = Run(module, deadline, observe)
    complete, fault = False, None
    if not deadline.expired():
        how = may_step or Run.may_step
        with undisturbed(deadline):
            if module.isolated and not isolation.within():
                complete, fault = isolation.perform(current, inputs, filled, how)
            else:
                complete, fault = perform(current, inputs, filled, how)
    return _result(current, complete and not current.cut, fault), current


def perform(
    current: Run,
    inputs: tuple[Any, ...],
    filled: dict[str, Any],
    may_step: Callable[[Run], bool],
) -> tuple[bool, Fault | None]:
    """Let a run's module work in this process; whether it completed, and what it raised.

    Only what interrupts the user's own program, and the end of a run outside, pass through.
    """
    try:
        if current.module.generator:
            return _generate(current, inputs, filled, may_step), None
        return _call(current, inputs, filled), None
    except _Stop as stop:
        if stop.run is not current:
            raise
        return False, None
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return False, Fault.of(error)
    finally:
        current.close()


def _generate(
    current: Run,
    inputs: tuple[Any, ...],
    filled: dict[str, Any],
    may_step: Callable[[Run], bool],
) -> bool:
    steps = current.module.function(*inputs, **filled)
    try:
        while not current.deadline.interrupted() and may_step(current):
            # Around each step alone: a context variable set in a generator leaks to its caller.
            token = calling.current.set(current)
            try:
                value = next(steps)
            except StopIteration as end:
                if end.value is not None:
                    current.check()
                    current.record(end.value)
                return True
            finally:
                calling.current.reset(token)
            current.check()
            if value is not None:
                current.record(value)
        return False
    finally:
        token = calling.current.set(current)
        try:
            steps.close()
        finally:
            calling.current.reset(token)


def _call(current: Run, inputs: tuple[Any, ...], filled: dict[str, Any]) -> bool:
    token = calling.current.set(current)
    try:
        value = current.module.function(*inputs, **filled)
    finally:
        calling.current.reset(token)
    if inspect.isgenerator(value):
        raise AnytimeError(
            f"module {current.module.name!r} returned a generator, which its decorator does not "
            "show; put @anytime.module next to the function that yields"
        )
    if value is not None:
        current.check()
        current.record(value)
    return True


def _result(current: Run, complete: bool, fault: Fault | None) -> Result:
    now = current.deadline.clock.now()
    overrun = round(max(0.0, now - max(current.deadline.at, current.started)), DECIMALS)
    if not current.history:
        status = Status.NO_RESULT
    elif complete and fault is None:
        status = Status.COMPLETE
    else:
        status = Status.INTERRUPTED
    return Result(
        status,
        current.value,
        fault,
        now - current.started,
        overrun,
        tuple(current.history),
        current.work,
    )
