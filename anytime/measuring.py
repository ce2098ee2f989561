"""Measuring: running modules on problems, off line, and scoring what they registered."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

from anytime import executors
from anytime.campaigns import lived
from anytime.clocks import Clock, WallClock, WorkClock, is_number
from anytime.digests import digest_of
from anytime.errors import AnytimeError
from anytime.library import ProfileLibrary
from anytime.machines import Machine, Rate, charged_rate, processor, stepped_rate
from anytime.modules import Module
from anytime.outcomes import Campaign, Outcome, Pace, Store, opened
from anytime.profiles import Profile
from anytime.programs import Constant, Program, program_of, upstream
from anytime.sampling import How, sampled

FIRST_LOOK = 20  # problems after which it is first asked whether they are enough


def measure(
    what: Module | Program,
    problems: Iterable[Any],
    *,
    seconds: float,
    clock: Callable[[], Clock] = WallClock,
    rest: float = 0.0,
    seed: int = 0,
    executor: Executor | str | None = None,
    store: str | Path | None = None,
    resume: bool = True,
    progress: Callable[[int, int], None] | None = None,
    until: Callable[[ProfileLibrary], bool] | None = None,
) -> ProfileLibrary:
    """Measure how the results of a module, or of each module of a program, improve with time.

    problems: objects whose attributes are the inputs by name, plus what `quality` wants.
    seconds: how long each run may take. clock: makes the clock of a run; a `WorkClock` measures
    in simulated time. rest: seconds of idling before each run, as a control loop does (profiles
    measured hot fail in a cold loop). A contract module is run for `seconds` and for shares of it,
    because what it gives in less time is another run. progress: called with (problems done,
    problems).

    executor: where runs are made, `"processes:4"`, `"dask://127.0.0.1:8786"` or any executor of
    yours; modules travel by their names, and what cannot travel is measured here, with a warning
    that says why. store: a file that each problem's runs are added to as they come; what it holds
    already is not run again, but for what raised. resume: false if all that it holds is to make way
    for the first runs that come. until: asked now and then, with the profiles so far, whether that
    is enough (`compiler.UntilRegret`); then no more problems are begun. With any of them, a problem
    that fails, or kills its worker twice, is left out with a warning; without them the first that
    fails is raised.

    In a program, what each module really delivers feeds the next: at most `STRATA` runs a call
    and problem, on results equally spaced in achieved quality plus the last; of several inputs,
    `COMBINATIONS` of such results. Quality is scored after the clock has stopped, and a cost is
    normalised by the cheapest known for its problem when all of its runs are done.
    Raises AnytimeError for a problem without a needed attribute, for a module without a score, and
    for a store of another campaign.
    """
    if not isinstance(what, Module | Program):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"measure takes a module or a program, not {what!r}")
    if not isinstance(problems, Iterable):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"problems is {problems!r}; give a list of problems")
    program = what if isinstance(what, Program) else program_of(what)
    listed = list(problems)
    if not listed:
        raise AnytimeError("no problems to measure on; give at least one")
    if not is_number(seconds) or not seconds > 0:
        raise AnytimeError(f"seconds={seconds!r}; give the time that each run may take, > 0")
    if not is_number(rest) or not 0 <= rest < math.inf:
        raise AnytimeError(f"rest={rest!r}; give the idle seconds before each run, >= 0")
    if executor is not None and not isinstance(executor, str) and not hasattr(executor, "submit"):
        raise AnytimeError(
            f"executor={executor!r}; give {executors.SPECIFICATIONS}, or an Executor"
        )
    if not callable(clock):
        raise AnytimeError(
            f"clock={clock!r}; give what makes a run's clock, like `lambda: WorkClock(machine)`"
        )
    keys = problem_keys(program, listed, told_apart=store is not None)
    named = dict(zip(keys, listed, strict=True))
    how = How(float(seconds), clock, float(rest), int(seed))
    made = clock()
    known = made.machine if isinstance(made, WorkClock) else None
    if executor is None and store is None and until is None:
        found = _one_by_one(program, named, how, progress)
    else:
        watch = None
        if until is not None:
            watch = _Watch(keys, lambda good: until(_library(program, good, known)))
        file = None if store is None else Path(store)
        campaign = _described(program, how)
        kept = nullcontext() if file is None else opened(file, campaign, anew=not resume)
        found = _campaign(program, named, how, executor or "serial", kept, progress, watch)
    _tell(program, found)
    return _library(program, found, known)


def _tell(program: Program, outcomes: Sequence[Outcome]) -> None:
    """Warn of modules that raised after a result, and of those that nothing ever reached."""
    for name in dict.fromkeys(call.module.name for call in program.calls):
        faults = [outcome.faults[name] for outcome in outcomes if name in outcome.faults]
        if faults:
            warnings.warn(
                f"{name} failed on {len(faults)} of {len(outcomes)} problems, with what it had by "
                f"then as its result: {faults[0]}",
                stacklevel=3,
            )
    for call in program.calls:
        if not any(outcome.recordings[call.label] for outcome in outcomes):
            warnings.warn(
                f"{call.label} was not run: nothing reached it on {len(outcomes)} problems; give "
                "more seconds",
                stacklevel=3,
            )


def _one_by_one(
    program: Program,
    problems: Mapping[str, Any],
    how: How,
    progress: Callable[[int, int], None] | None,
) -> list[Outcome]:
    """Outcomes of all problems. Raises AnytimeError at the first that fails."""
    found: list[Outcome] = []
    for key, problem in problems.items():
        found.append(sampled(program, key, problem, how))
        if progress is not None:
            progress(len(found), len(problems))
    return found


def _campaign(
    program: Program,
    problems: Mapping[str, Any],
    how: How,
    executor: Executor | str,
    kept: AbstractContextManager[Store | None],
    progress: Callable[[int, int], None] | None,
    watch: _Watch | None,
) -> list[Outcome]:
    """Outcomes of all problems but those that fail, in the order of the problems; up to where the
    watch has seen enough."""
    make = executors.maker(executor) if isinstance(executor, str) else executors.lent(executor)
    with kept as store:
        before = store.kept.items() if store else ()
        # What failed may have been mended since; what killed its worker might kill this process.
        found = {
            key: outcome
            for key, outcome in before
            if key in problems and (outcome.failed is None or outcome.fatal)
        }

        def keep(outcome: Outcome) -> None:
            found[outcome.problem] = outcome
            if store:
                store.append(outcome)
            if progress is not None:
                progress(len(found), len(problems))
            if watch is not None:
                watch.look(found)

        left = {key: problem for key, problem in problems.items() if key not in found}
        used = list(problems)
        try:
            if watch is not None:
                watch.look(found)
            lived(
                program,
                left,
                how,
                make,
                keep,
                hopeful=any(outcome.failed is None for outcome in found.values()),
            )
        except _EnoughError:
            used = used[: watch.seen] if watch else used
    for outcome in found.values():
        if outcome.failed is not None:
            warnings.warn(f"problem {outcome.problem} is left out: {outcome.failed}", stacklevel=3)
    good = [found[key] for key in used if found[key].failed is None]
    if not good:
        raise AnytimeError(f"every problem failed: {next(iter(found.values())).failed}")
    return good


class _EnoughError(Exception):
    """Ends a campaign."""


class _Watch:
    """Asks whether the problems so far are enough, at numbers of them that grow by a quarter.

    Problems count in their own order and not as they come, for quick ones come first; so the same
    ones are used wherever they are run.
    """

    def __init__(self, keys: Sequence[str], enough: Callable[[Sequence[Outcome]], bool]) -> None:
        self._keys, self._enough = keys, enough
        self._good: list[Outcome] = []
        self._next = FIRST_LOOK
        self.seen = 0

    def look(self, found: Mapping[str, Outcome]) -> None:
        """Raises _EnoughError when the first `seen` problems are enough."""
        while self.seen < len(self._keys) and self._keys[self.seen] in found:
            outcome = found[self._keys[self.seen]]
            self.seen += 1
            if outcome.failed is not None:
                continue
            self._good.append(outcome)
            if len(self._good) == self._next:
                self._next += -(-self._next // 4)
                if self._enough(self._good):
                    raise _EnoughError


def _described(program: Program, how: How) -> Campaign:
    made = how.clock()
    clock = type(made).__name__
    if isinstance(made, WorkClock):  # in words, and to the last digit
        machine = made.machine
        clock = (
            f"{machine!r}, {digest_of(sorted((n, astuple(r)) for n, r in machine.rates.items()))}"
        )
    written = program.written
    constants = [a.value for c in program.calls for a in c.arguments if isinstance(a, Constant)]
    if constants:
        with suppress(TypeError):  # then what they are written as must do
            written += f", {digest_of(*constants)}"
    return Campaign(program=written, seconds=how.seconds, rest=how.rest, seed=how.seed, clock=clock)


def _library(
    program: Program, outcomes: Sequence[Outcome], machine: Machine | None
) -> ProfileLibrary:
    profiles: dict[str, Profile] = {}
    rates: dict[str, Rate] = {}
    for call in program.calls:
        name, feeding = call.module.name, upstream(call)
        recordings = [run for outcome in outcomes for run in outcome.recordings[call.label]]
        known = profiles.get(name)
        if known is not None and recordings:
            if set(known.inputs) != set(feeding):
                raise AnytimeError(
                    f"program {program.name!r} calls {name} in two ways, fed by other modules at "
                    f"({', '.join(known.inputs)}) and at ({', '.join(feeding)}); give one of them "
                    "a module of its own"
                )
            profiles[name] = replace(known, recordings=(*known.recordings, *recordings))
        elif recordings:
            best = {o.problem: o.references[name] for o in outcomes if name in o.references}
            here = machine.name if machine else "this"
            profiles[name] = Profile(name, tuple(feeding), tuple(recordings), best, here)
        rates[name] = _rate([pace for outcome in outcomes for pace in outcome.paces[name]])
    return ProfileLibrary(profiles=profiles, machine=machine or Machine("this", rates, processor()))


def _rate(paces: Sequence[Pace]) -> Rate:
    """Seconds per work from the runs: per unit if the module counts its own, else per step."""
    if any(pace.charged for pace in paces):
        return charged_rate(piece for pace in paces if pace.charged for piece in pace.pieces)
    return stepped_rate((int(step), took) for pace in paces for step, took in pace.pieces)


def problem_keys(program: Program, problems: Sequence[Any], told_apart: bool = False) -> list[str]:
    """A key for each problem: its name, or a digest of its attributes; equal ones are numbered.

    Raises AnytimeError for a problem without an input, and, if they must be `told_apart` wherever
    they are made, for one that has no name and cannot be pickled.
    """
    keys: dict[str, None] = {}
    for place, problem in enumerate(problems):
        missing = [name for name in program.inputs if not hasattr(problem, name)]
        if missing:
            raise AnytimeError(
                f"problems[{place}] has no .{missing[0]}; the inputs of {program.name} are "
                f"{', '.join(program.inputs)}"
            )
        key = getattr(problem, "name", None)
        if not isinstance(key, str):
            try:
                key = _digest(program, problem)
            except TypeError as error:
                if told_apart:
                    raise AnytimeError(
                        f"problems[{place}] has no name, and {error}; give it a .name by which a "
                        "store knows it again"
                    ) from None
                key = type(problem).__name__
        numbered = (f"{key}#{count}" for count in itertools.count(2))
        keys[key if key not in keys else next(k for k in numbered if k not in keys)] = None
    return list(keys)


def _digest(program: Program, problem: Any) -> str:
    slots = [getattr(kind, "__slots__", ()) for kind in type(problem).__mro__]
    names = {*getattr(problem, "__dict__", ()), *getattr(problem, "_fields", ())}
    names.update(*((each,) if isinstance(each, str) else each for each in slots))
    others = sorted(name for name in names - {*program.inputs} if hasattr(problem, name))
    inputs = [getattr(problem, name) for name in program.inputs]
    return digest_of(*inputs, *(part for name in others for part in (name, getattr(problem, name))))
