"""Faults on purpose: what goes wrong, when, and how often, from a seed.

Nothing here acts unless somebody hands a schedule in; the command line does so with `--faults`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from anytime.clocks import WorkClock
from anytime.errors import AnytimeError
from anytime.files import read_toml
from anytime.machines import Machine
from anytime.modules import Module
from anytime.running import charge, seed_of

MODULE = {
    "raises": "an exception at its first step",
    "exits": "SystemExit at its first step",
    "interrupts": "KeyboardInterrupt at its first step",
    "late-raise": "an exception after its first result",
    "nothing": "it completes without a result",
    "rubbish": "a text in place of its result",
    "wrong-quality": "it estimates NaN",
    "lies": "it estimates 1, whatever its result",
    "slow": "it works ten times as much for each result",
    "floods": "a million check-points for nothing",
    "mutates": "it overwrites the arrays that it is given",
}
"""What a module may do, by name."""

CLOCK = {"suspended": "the process stands still from then on, until the fault is over"}
"""What may happen to a clock."""

_FLOOD = 1_000_000
_SLOW = 10.0


class Injected(RuntimeError):  # noqa: N818 (an event, and nobody's error)
    """Raised on purpose."""


@dataclass(frozen=True)
class Fault:
    """Something that is wrong between two times, in seconds since it was made faulty.

    what: a module's name, `robot`, `clock` or `log`. chance: of each call in that time.
    Raises AnytimeError for a time or a chance that cannot be.
    """

    kind: str
    begins: float = 0.0
    ends: float = math.inf
    what: str = "robot"
    chance: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.begins < self.ends:
            raise AnytimeError(
                f"{self.kind} from {self.begins} to {self.ends} s; it must be 0 <= from < to"
            )
        if not 0.0 < self.chance <= 1.0:
            raise AnytimeError(f"{self.kind} has the chance {self.chance}; it must be in (0, 1]")


class Schedule:
    """Faults and the seed that decides on each of their chances; the same seed, the same faults."""

    def __init__(self, faults: Iterable[Fault], seed: int = 0) -> None:
        self.faults = tuple(faults)
        self.seed = seed
        self._drawn: dict[Fault, np.random.Generator] = {
            fault: np.random.default_rng(seed_of("fault", seed, index, fault))
            for index, fault in enumerate(self.faults)
        }

    def of(self, what: str) -> tuple[Fault, ...]:
        """The faults of one thing."""
        return tuple(fault for fault in self.faults if fault.what == what)

    def strikes(self, what: str, time: float) -> set[str]:
        """The kinds that are wrong with it in a call at that time."""
        return {
            fault.kind
            for fault in self.of(what)
            if fault.begins <= time < fault.ends and self._drawn[fault].random() < fault.chance
        }


class _Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    what: str
    kind: str
    begins: float = msgspec.field(default=0.0, name="from")
    ends: float = msgspec.field(default=math.inf, name="to")
    chance: float = 1.0


class _File(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    fault: list[_Table]
    seed: int = 0


def read_schedule(path: Path, known: Mapping[str, Iterable[str]]) -> Schedule:
    """Read a TOML file of `[[fault]]` tables with what, kind, from, to, chance, and a seed.

    known: the kinds there are, by what may be faulty. Raises AnytimeError, in one line.
    """
    stored = read_toml(path, _File, "file of faults")
    try:
        faults = [
            Fault(each.kind, each.begins, each.ends, each.what, each.chance)
            for each in stored.fault
        ]
    except ValueError as error:
        raise AnytimeError(f"{path}: {error}") from None
    for fault in faults:
        if fault.what == "clock" and math.isinf(fault.ends):
            raise AnytimeError(f"{path}: {fault.kind} has no end; say until when, `to`")
        if fault.what not in known:
            raise AnytimeError(
                f"{path}: nothing called {fault.what!r}; there are {', '.join(known)}"
            )
        if fault.kind not in known[fault.what]:
            kinds = ", ".join(known[fault.what])
            raise AnytimeError(
                f"{path}: no fault {fault.kind!r} of {fault.what}; there are {kinds}"
            )
    return Schedule(faults, stored.seed)


def faulty_module(module: Module, schedule: Schedule, now: Callable[[], float]) -> Module:
    """A module that goes wrong as scheduled; now: seconds since the schedule began."""
    if not module.generator:
        raise AnytimeError(f"{module.name!r} is no generator; only generators are made faulty")

    def faulty(*inputs: Any, **filled: Any) -> Iterator[Any]:
        kinds = schedule.strikes(module.name, now())
        begun.clear()
        begun.update(kinds)
        return _faulty(module, kinds, inputs, filled)

    begun: set[str] = set()
    plain = module.estimate

    def estimate(value: Any) -> float:
        if "wrong-quality" in begun:
            return math.nan
        if "lies" in begun:
            return 1.0
        return 0.0 if plain is None or isinstance(value, str) else plain(value)

    return replace(
        module,
        function=faulty,
        estimate=estimate if plain or schedule.of(module.name) else None,
        isolated=None,
    )


def _faulty(
    module: Module, kinds: set[str], inputs: tuple[Any, ...], filled: dict[str, Any]
) -> Iterator[Any]:
    if "raises" in kinds:
        raise Injected(f"{module.name} raises, as it was told to")
    if "exits" in kinds:
        raise SystemExit(1)
    if "interrupts" in kinds:
        raise KeyboardInterrupt
    if "mutates" in kinds:
        for value in inputs:
            if isinstance(value, np.ndarray):
                value[...] = 0
    if "nothing" in kinds:
        charge(1.0)
        return
    if "floods" in kinds:
        for _ in range(_FLOOD):
            charge(0.0)
            yield
    steps = module.function(*inputs, **filled)
    for value in steps:
        if "slow" in kinds:
            charge(_SLOW)
        yield "rubbish" if "rubbish" in kinds and value is not None else value
        if "late-raise" in kinds and value is not None:
            raise Injected(f"{module.name} raises after a result, as it was told to")


class FaultyClock(WorkClock):
    """A work clock on which the process stands still for a while, as scheduled."""

    def __init__(self, machine: Machine, schedule: Schedule) -> None:
        super().__init__(machine)
        self._due = sorted(schedule.of("clock"), key=lambda fault: fault.begins)
        self._schedule = schedule

    def _pass(self, seconds: float) -> None:
        super()._pass(seconds)
        while self._due and self.now() >= self._due[0].begins:
            fault = self._due.pop(0)
            if math.isfinite(fault.ends) and self._schedule.strikes("clock", fault.begins):
                super()._pass(max(0.0, fault.ends - self.now()))
