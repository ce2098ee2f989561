"""Programs as data: which module is called on what. Reading them from Python is the compiler's."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from anytime import calling
from anytime.errors import AnytimeError
from anytime.joins import Best, Rule
from anytime.modules import Module
from anytime.pictures import clipped


class Reading:
    """A program being read: its nodes are collected here in the order of their making."""

    def __init__(self, program: str) -> None:
        self.program = program
        self.nodes: list[Call | Join] = []
        self.parallels: list[Parallel] = []

    def call(self, module: Module, arguments: tuple[object, ...]) -> Call | Join:
        """A new call; plain arguments become constants, the label is numbered when it repeats.

        A module with knobs is called in every setting, and whichever is worth most is chosen.

        Raises AnytimeError for the wrong number of arguments, and for two modules of one name:
        profiles are kept by name.
        """
        if len(arguments) != len(module.parameters):
            raise AnytimeError(
                f"program {self.program!r} calls {module.name} with {len(arguments)} arguments; "
                f"it takes {len(module.parameters)}: {', '.join(module.parameters)}"
            )
        if module.knobs:
            # Settings go from hasty to thorough: of several that ran the last is taken, unless
            # estimates tell which is the best.
            made = [self.call(each, arguments) for each in module.settings()]
            return self.chosen(made[::-1])
        calls = [node for node in self.nodes if isinstance(node, Call)]
        if any(c.module.name == module.name and c.module is not module for c in calls):
            raise AnytimeError(
                f"two different modules are named {module.name!r}; give one @anytime.module(name=…)"
            )
        for argument in arguments:
            hidden = None if isinstance(argument, _Symbol) else _symbol_in(argument)
            if hidden is not None:
                raise AnytimeError(
                    f"program {self.program!r} calls {module.name} with {hidden!r} inside a "
                    f"{type(argument).__name__}; give it as an argument of its own"
                )
        nodes = tuple(a if isinstance(a, _Symbol) else Constant(a) for a in arguments)
        label = self._label(module.name)
        made = Call(module, nodes, label)  # pyright: ignore[reportArgumentType]
        self.nodes.append(made)
        return made

    def chosen(self, alternatives: Sequence[Call | Join]) -> Call | Join:
        """The best of several results by their estimates; the first that is there without them."""
        made = (call for each in alternatives for call in makers(each))
        rule = Best(all(call.module.estimate is not None for call in made))
        *rest, best = alternatives
        for alternative in reversed(rest):
            best = self.join(rule, (alternative, best))
        return best

    def join(self, rule: Rule, arguments: tuple[Source, ...]) -> Join:
        """A new result made of others by a rule."""
        made = Join(rule, arguments, self._label(rule.kind))
        self.nodes.append(made)
        return made

    def _label(self, name: str) -> str:
        taken = {node.label for node in self.nodes}
        numbered = (f"{name}_{count}" for count in itertools.count(2))
        return name if name not in taken else next(n for n in numbered if n not in taken)


@contextmanager
def reading(program: str) -> Generator[Reading, None, None]:
    """While this is open, calling a module makes a `Call` instead of running it."""
    opened = Reading(program)
    token = calling.current.set(opened)
    try:
        yield opened
    finally:
        calling.current.reset(token)


class _Symbol:
    """A value that is not known while a program is read; using it as one is refused."""

    def _refuse(self, what: str, cure: str) -> NoReturn:
        opened = calling.current.get()
        where = f"program {opened.program!r}" if isinstance(opened, Reading) else "a program"
        raise AnytimeError(
            f"{where} {what} {self!r}, whose value is not known when it is compiled; {cure}"
        )

    def __getitem__(self, key: object) -> NoReturn:
        self._refuse(f"takes item {key!r} of", "do it inside a module")

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):
            raise AttributeError(name)
        self._refuse(
            f"takes attribute .{name} of", "make it an input of its own or do it inside a module"
        )

    def __bool__(self) -> NoReturn:
        self._refuse(
            "branches on (or negates)",
            "use compiler.branch for if, all_of for and, any_of for or, or do it inside a module",
        )

    def __iter__(self) -> NoReturn:
        self._refuse("iterates over", "do it inside a module")

    def __call__(self, *_: object, **__: object) -> NoReturn:
        self._refuse("calls", "only modules can be called in a program")

    def __add__(self, *_: object) -> NoReturn:
        self._refuse("computes with", "do it inside a module")

    __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __add__
    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __pow__ = __rpow__ = __add__
    __matmul__ = __rmatmul__ = __neg__ = __pos__ = __abs__ = __add__
    __lt__ = __gt__ = __le__ = __ge__ = __add__  # pyright: ignore
    __len__ = __contains__ = __float__ = __int__ = __index__ = __complex__ = __add__
    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __invert__ = __add__
    __lshift__ = __rlshift__ = __rshift__ = __rrshift__ = __divmod__ = __rdivmod__ = __add__
    __round__ = __trunc__ = __floor__ = __ceil__ = __array__ = __add__

    def __str__(self) -> str:
        if isinstance(calling.current.get(), Reading):
            self._refuse("writes out", "do it inside a module")
        return repr(self)

    def __eq__(self, other: object) -> bool:
        if self is not other and isinstance(calling.current.get(), Reading):
            self._refuse("compares", "do it inside a module")
        return self is other

    __hash__ = object.__hash__


@dataclass(frozen=True, eq=False)
class Input(_Symbol):
    """An input of the program, known only when it runs."""

    name: str

    def __repr__(self) -> str:
        return self.name


@dataclass(frozen=True, eq=False)
class Constant(_Symbol):
    """A value written in the program."""

    value: Any

    def __repr__(self) -> str:
        return repr(self.value)


@dataclass(frozen=True, eq=False)
class Call(_Symbol):
    """One call of a module. Compared by identity: a result used twice is one node, two equal
    calls are two. `label` is the module's name, numbered when the program calls it again."""

    module: Module
    arguments: tuple[Input | Constant | Call | Join, ...]
    label: str

    def __repr__(self) -> str:
        return f"{self.label}({', '.join(map(repr, self.arguments))})"


@dataclass(frozen=True, eq=False)
class Join(_Symbol):
    """A result that a rule makes of others in no time: a branch, a choice, several at once."""

    rule: Rule
    arguments: tuple[Source, ...]
    label: str

    def __repr__(self) -> str:
        return f"{self.label}({', '.join(map(repr, self.arguments))})"


Source = Input | Call | Join  # where a result comes from


@dataclass(frozen=True)
class Parallel:
    """Results that are made at once, on so many processors; each arm's by its label."""

    labels: tuple[str, ...]
    processors: int


@dataclass(frozen=True)
class Program:
    """A composition of anytime modules.

    inputs: names, in order. nodes: every call and join, each after those it uses. output: the
    last. parallels: what is made at once.
    """

    name: str
    inputs: tuple[str, ...]
    nodes: tuple[Call | Join, ...]
    output: Call | Join
    parallels: tuple[Parallel, ...] = ()

    @property
    def calls(self) -> tuple[Call, ...]:
        """Every call of a module, in order."""
        return tuple(node for node in self.nodes if isinstance(node, Call))

    def __call__(self, *_: object, **__: object) -> NoReturn:
        raise AnytimeError(
            f"{self.name} is a program: compile it, schedule = compiler.compile({self.name}, "
            "library), then schedule.run(seconds=…, …), or call the schedule in another program"
        )

    @property
    def written(self) -> str:
        """The program in one line, whole."""
        return f"program {self.name}({', '.join(self.inputs)}) = {self.output!r}"

    def __repr__(self) -> str:
        return clipped(self.written)

    def call(self, label: str) -> Call:
        """The call with this label. Raises AnytimeError naming the labels there are."""
        for call in self.calls:
            if call.label == label:
                return call
        raise AnytimeError(
            f"program {self.name!r} has no call {label!r}; "
            f"it has {', '.join(call.label for call in self.calls)}"
        )


def _symbol_in(value: Any, depth: int = 4) -> _Symbol | None:
    """A symbol that a constant holds, where lists, tuples, sets, dicts and arrays lead to it."""
    if isinstance(value, _Symbol):
        return value
    if depth == 0:
        return None
    inner: Iterable[Any] = ()
    if isinstance(value, dict):
        content = cast("dict[Any, Any]", value)
        inner = [*content, *content.values()]
    elif isinstance(value, list | tuple | set | frozenset):
        inner = cast("Iterable[Any]", value)
    elif isinstance(value, np.ndarray):
        array = cast("NDArray[Any]", value)
        inner = array.ravel().tolist() if array.dtype == object else ()
    found = (_symbol_in(each, depth - 1) for each in inner)
    return next((symbol for symbol in found if symbol is not None), None)


def upstream(call: Call) -> dict[str, Call | Join]:
    """The nodes that feed `call`, by the parameter of its module that they arrive at."""
    return {
        name: argument
        for name, argument in zip(call.module.parameters, call.arguments, strict=True)
        if isinstance(argument, Call | Join)
    }


def makers(node: Call | Join) -> tuple[Call, ...]:
    """The calls whose results may arrive from a node: itself, or those that a join passes on."""
    if isinstance(node, Call):
        return (node,)
    passed = (a for i, a in enumerate(node.arguments) if i not in node.rule.tests)
    found = (maker for a in passed if not isinstance(a, Input) for maker in makers(a))
    return tuple(dict.fromkeys(found))


def program_of(module: Module) -> Program:
    """A lone module as the program that calls it on inputs of its parameters' names."""
    with reading(module.name) as opened:
        output = opened.call(module, tuple(Input(name) for name in module.parameters))
    return Program(module.name, module.parameters, tuple(opened.nodes), output)
