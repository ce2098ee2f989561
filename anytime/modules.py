"""Modules: what improves its result while it is given time."""

from __future__ import annotations

import inspect
import os
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from anytime import calling, naming
from anytime.errors import AnytimeError
from anytime.knobs import MOST, Knob, setting_name, settings

Score = Callable[..., float]
FILLED = ("seconds", "rng", "memory")
_POSIX = os.name == "posix"


@dataclass(frozen=True)
class Limits:
    """What a worker process may take. memory: bytes beyond what an idle one has."""

    memory: int = 2**30

    def __post_init__(self) -> None:
        if self.memory < 2**20:
            raise AnytimeError(f"memory={self.memory} bytes; a module needs at least {2**20}")


@dataclass(frozen=True, eq=False)
class Module:
    """An anytime module, made by the decorator `anytime.module`.

    name: the key of its profile.
    function: a generator (`yield` registers a result, a bare `yield` is a check-point, `return`
        completes), or a plain function that calls `anytime.register` and `anytime.expired`.
    parameters: names of its positional parameters; profiles are conditioned on them.
    filled: the keyword-only parameters among `seconds`, `rng`, `memory`, which a run fills in.
    quality, cost: called with (result, problem), or (result), off line and never on the clock.
    estimate: called with (result); what may be seen of its quality at run time.
    problems: called with (rng), yields problems to measure on; the command line uses it.
    features: called with the inputs; named properties of them to condition the profile on.
    isolated: what it may take, for a module that runs in a worker process; None for the others.
    knobs: its keyword-only parameters that may be set, see `anytime.knob`. chosen: what they are.
    """

    name: str
    function: Callable[..., Any]
    parameters: tuple[str, ...]
    filled: frozenset[str] = frozenset()
    quality: Score | None = None
    cost: Score | None = None
    estimate: Score | None = None
    problems: Callable[..., Any] | None = None
    features: Callable[..., Mapping[str, float]] | None = None
    generator: bool = False
    isolated: Limits | None = None
    knobs: Mapping[str, Knob] = field(default_factory=dict[str, Knob])
    chosen: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def set(self, **values: Any) -> Module:
        """This module with all of its knobs set, under a name of its own: find_path@weight=3.

        Raises AnytimeError for a knob that it does not have, is not given, or has no such value.
        """
        for name, value in values.items():
            if name not in self.knobs or value not in self.knobs[name].values:
                known = ", ".join(f"{name} {list(k.values)}" for name, k in self.knobs.items())
                raise AnytimeError(
                    f"{self.name} has no knob {name} with {value!r}; it has {known or 'none'}"
                )
        missing = [name for name in self.knobs if name not in values]
        if missing:
            raise AnytimeError(f"{self.name}.set needs {missing[0]}=…; all of its knobs are set")
        chosen = {name: values[name] for name in self.knobs}
        return replace(self, name=setting_name(self.name, chosen), knobs={}, chosen=chosen)

    def settings(self) -> tuple[Module, ...]:
        """The module with its knobs set in every way; itself where it has none."""
        if not self.knobs:
            return (self,)
        return tuple(self.set(**chosen) for chosen in settings(self.knobs))

    @property
    def contract(self) -> bool:
        """Whether it must be told its time in advance (it has a parameter `seconds`)."""
        return "seconds" in self.filled

    def score(self, result: object, problem: object) -> float:
        """The raw quality or cost of a result, from the truth. Only off line."""
        function = self.quality or self.cost
        if function is None:
            raise AnytimeError(
                f"module {self.name!r} cannot be scored; give @anytime.module(quality=…) or cost=…"
            )
        return function(result, problem) if _takes_two(function) else function(result)

    def __call__(self, *arguments: object, **named: object) -> Any:
        caller = calling.current.get()
        if caller is None:
            raise AnytimeError(
                f"{self.name} is a module: use anytime.run({self.name}, …, seconds=…), "
                "or call it in a function decorated with @compiler.program"
            )
        return caller.call(self, self._in_order(arguments, named))

    def _in_order(
        self, arguments: tuple[object, ...], named: dict[str, object]
    ) -> tuple[object, ...]:
        """Arguments given by position and by name, in the order of the parameters."""
        rest = self.parameters[len(arguments) :]
        if named.keys() - set(rest):
            unknown = sorted(named.keys() - set(rest))
            raise AnytimeError(
                f"{self.name} is called with {unknown[0]}=…; by name it takes "
                f"{', '.join(rest) or 'nothing more'}"
            )
        return (*arguments, *(named[name] for name in rest if name in named))

    def __reduce__(self) -> tuple[Callable[..., object], tuple[Any, ...]]:
        """Another process finds a module by its name, as it does a function, and sets it."""
        address = naming.address(self.function)
        try:
            known = naming.found(*address)
            if known is self:
                return naming.found, address
            if not self.knobs and self.chosen and known.set(**self.chosen).name == self.name:
                return _set, (*address, dict(self.chosen))
        except AnytimeError as error:
            raise pickle.PicklingError(str(error)) from None
        raise pickle.PicklingError(f"{'.'.join(address[:2])} is not the module {self.name!r}")

    def __repr__(self) -> str:
        kind = "contract module" if self.contract else "module"
        return f"<{kind} {self.name}({', '.join(self.parameters)})>"


def module(
    function: object = None,
    /,
    *,
    quality: Score | None = None,
    cost: Score | None = None,
    estimate: Score | None = None,
    problems: Callable[..., Any] | None = None,
    features: Callable[..., Mapping[str, float]] | None = None,
    name: str | None = None,
    isolated: bool | Limits = False,
) -> Callable[[Callable[..., Any]], Module]:
    """Make an anytime module of a generator or of a function with callbacks.

    quality: (result, problem) or (result) -> [0, 1], the truth, used off line only.
    cost: the same, any number >= 0; quality is then cheapest known for this problem / this one.
    estimate: (result) -> [0, 1], what may be seen at run time.
    problems: (rng) -> an iterable of problems, for `anytime profile`.
    features: (*inputs) -> named numbers that tell easy inputs from hard ones.
    isolated: run it in a worker process, so that nothing it does can hold the caller. Its inputs
        and results are sent as pickles, what it prints is dropped, and it keeps no memory.
    Raises AnytimeError for a signature that cannot be run.
    """
    if function is not None:
        raise AnytimeError("write @anytime.module(quality=…) or (cost=…), with parentheses")
    for what, score in (("quality", quality), ("cost", cost), ("estimate", estimate)):
        if score is not None and not callable(score):
            raise AnytimeError(f"{what} must be a function of a result, not {score!r}")
    if quality is not None and cost is not None:
        raise AnytimeError("a module has a quality or a cost, not both; drop one of them")
    if callable(quality) and isinstance(quality, Module):
        raise AnytimeError("quality must be a plain function, not a module")

    def decorate(function: Callable[..., Any]) -> Module:
        label = name or function.__name__
        if inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function):
            raise AnytimeError(f"module {label!r} is async; write a generator or a plain function")
        positional, filled, knobs = _signature(label, function)
        if len(list(settings(knobs))) > MOST:
            raise AnytimeError(
                f"module {label!r} has too many settings; at most {MOST} are measured"
            )
        is_generator = inspect.isgeneratorfunction(inspect.unwrap(function))
        if isolated and not _POSIX:
            raise AnytimeError(
                f"module {label!r} is isolated, for which this system lacks what cuts a process; "
                "it takes Linux or macOS"
            )
        if isolated and "memory" in filled:
            raise AnytimeError(
                f"module {label!r} is isolated and has a memory; a worker may die at any time, so "
                "pass in and return what is to be kept"
            )
        if isolated and "<locals>" in function.__qualname__:
            raise AnytimeError(
                f"module {label!r} is isolated; define it at the top level of a file, where a "
                "worker process can find it by its name"
            )
        return Module(
            label,
            function,
            positional,
            filled,
            quality,
            cost,
            estimate,
            problems,
            features,
            is_generator,
            Limits() if isolated is True else isolated or None,
            knobs,
            {name: each.values[0] for name, each in knobs.items()},
        )

    return decorate


def _set(module: str, name: str, file: str, chosen: Mapping[str, Any]) -> Module:
    return naming.found(module, name, file).set(**chosen)


def _signature(
    name: str, function: Callable[..., Any]
) -> tuple[tuple[str, ...], frozenset[str], dict[str, Knob]]:
    positional: list[str] = []
    filled: set[str] = set()
    knobs: dict[str, Knob] = {}
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise AnytimeError(
                f"module {name!r} has *{parameter.name}; name its inputs one by one, "
                "because profiles are conditioned on them by name"
            )
        if isinstance(parameter.default, Knob):
            if parameter.kind is not parameter.KEYWORD_ONLY:
                raise AnytimeError(
                    f"module {name!r} has the knob {parameter.name!r} among its inputs; put it "
                    "behind a *"
                )
            knobs[parameter.name] = parameter.default
        elif parameter.kind is not parameter.KEYWORD_ONLY:
            positional.append(parameter.name)
        elif parameter.name in FILLED:
            filled.add(parameter.name)
        elif parameter.default is parameter.empty:
            raise AnytimeError(
                f"module {name!r} has the keyword-only parameter {parameter.name!r}, which nothing "
                f"fills in; filled in are {', '.join(FILLED)}"
            )
    return tuple(positional), frozenset(filled), knobs


def _takes_two(function: Callable[..., Any]) -> bool:
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # some built-ins have no signature
        return False
    if any(p.kind is p.VAR_POSITIONAL for p in parameters):
        return True
    required = [
        p
        for p in parameters
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty
    ]
    return len(required) >= 2
