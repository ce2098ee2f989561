"""`rng` in plain Python: for a debugger, for coverage, or where a model stays plain."""

from __future__ import annotations

from collections.abc import Sequence
from operator import index
from typing import Any

import numpy as np

from planners.query import choosing, genetics
from planners.query.choosing import KINDS
from planners.query.errors import ModelError
from planners.query.memory import Memory, random_state
from planners.query.reading import Text, refuse_slash, two_kinds


class Sources:
    """The names that a model has used so far, their numbers and their distributions."""

    def __init__(self, memory: Memory) -> None:
        self.memory = memory
        self.numbers: dict[str, int] = {}
        self.kinds: dict[str, str] = {}
        self.at_root: dict[str, int] = {}  # streams that have room, by source
        self._addresses: dict[int, tuple[tuple[str, int], str]] = {}  # by cell

    def expect(self, text: Text) -> None:
        """Number what a model's text names, as its native form has it."""
        for name in text.names:
            self.number(name)
        for name, kind in text.sources.items():
            while self.stream(-1, name, kind) < 0:
                self.memory.grow("most_streams")

    def number(self, name: str) -> int:
        """The number of a source or path name; a new one is written down."""
        if name not in self.numbers:
            if not isinstance(name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
                raise ModelError(f"the name of a source or a path is {name!r}; give a string")
            refuse_slash(name)
            self.numbers[name] = len(self.numbers)
        return self.numbers[name]

    def stream(self, path: int, name: str, kind: str) -> int:
        """The stream of a source below a path, or LOST while there is no room for it."""
        number = self.number(name)
        if self.kinds.setdefault(name, kind) != kind:
            raise two_kinds(name, self.kinds[name], kind)
        found = choosing.stream_of(self.memory.address, path, number, -1)
        if path == -1 and found >= 0:
            self.at_root[name] = found
        return found

    def locate(self, address: tuple[str, int], kind: str) -> int:
        """The cell of an address like ("plan/3/walk", 0); the tables grow if need be."""
        *path, name = address[0].split("/")
        while True:
            stream = self._descend(path, name, kind)
            cell = choosing.cell_of(self.memory.address, stream, address[1], KINDS.index(kind))
            if cell >= 0:
                return cell
            if stream < 0:
                self.memory.grow("most_streams")
            else:
                self.memory.grow("width" if address[1] >= self.memory["width"] else "most_cells")

    def _descend(self, path: Sequence[str], name: str, kind: str) -> int:
        at = -1
        for scope, place in zip(path[::2], path[1::2], strict=True):
            at = choosing.stream_of(self.memory.address, at, self.number(scope), int(place))
        return self.stream(at, name, kind)

    def address_of(self, cell: int) -> tuple[tuple[str, int], str]:
        """The address of a cell, and its distribution."""
        if cell not in self._addresses:
            self._addresses[cell] = self._found_address(cell)
        return self._addresses[cell]

    def _found_address(self, cell: int) -> tuple[tuple[str, int], str]:
        blocks = self.memory.blocks
        stream, call, kind = (int(n) for n in blocks["homes"][cell])
        names = list(self.numbers)
        parts: list[str] = []
        parent, number, place = (int(n) for n in blocks["streams"][stream])
        parts.append(names[number])
        while parent >= 0:
            parent, number, place = (int(n) for n in blocks["streams"][parent])
            parts += [str(place), names[number]]
        return ("/".join(reversed(parts)), call), KINDS[kind]


class Rng:
    """Answers a model's requests for choices, which it draws, or takes from a query's genomes.

    `Rng(seed)` draws everything: `model(Rng(7), world)` is one random plan.
    """

    __slots__ = ("_address", "_alone", "_path", "_sources")

    def __init__(self, seed: int) -> None:
        memory = Memory(1, 8)
        memory["random"] = random_state(seed)
        genetics.breed(memory.address, 0)
        self._sources, self._address, self._path = Sources(memory), memory.address, -1
        self._alone = True

    @classmethod
    def of(cls, sources: Sources, path: int = -1, *, alone: bool = False) -> Rng:
        """The one that a query's models get; `alone`: without a query, which counts choices."""
        made = cls.__new__(cls)
        made._sources, made._address, made._path = sources, sources.memory.address, path
        made._alone = alone
        return made

    def at(self, name: str, place: int = 0) -> Rng:
        """A place below: its choices have addresses like "plan/3/walk"."""
        if place < 0:
            raise ValueError("rng.at(name, place) was asked with a place < 0")
        number = self._sources.number(name)
        path = choosing.stream_of(self._address, self._path, number, int(index(place)))
        return Rng.of(self._sources, path, alone=self._alone)

    def flip(self, source: str, p: float = 0.5) -> bool:
        """True with probability p."""
        return choosing.flip(self._address, self._stream(source, "flip"), float(p))

    def randint(self, source: str, n: int) -> int:
        """An integer in [0, n), each as probable."""
        return choosing.randint(self._address, self._stream(source, "randint"), index(n))

    def gaussian(self, source: str, mean: float = 0.0, sigma: float = 1.0) -> float:
        """Normally distributed."""
        stream = self._stream(source, "gaussian")
        return choosing.gaussian(self._address, stream, float(mean), float(sigma))

    def uniform(self, source: str, low: float = 0.0, high: float = 1.0) -> float:
        """Uniform between low and high."""
        stream = self._stream(source, "uniform")
        return choosing.uniform(self._address, stream, float(low), float(high))

    def categorical(self, source: str, weights: Sequence[float]) -> int:
        """The place of one of the weights, in proportion to it."""
        stream = self._stream(source, "categorical")
        return choosing.categorical(self._address, stream, np.array(weights, np.float64))

    def exponential(self, source: str, scale: float = 1.0) -> float:
        """Exponentially distributed with this mean."""
        stream = self._stream(source, "exponential")
        return choosing.exponential(self._address, stream, float(scale))

    def lognormal(self, source: str, mean: float = 0.0, sigma: float = 1.0) -> float:
        """exp of a normal variable with this mean and deviation."""
        stream = self._stream(source, "lognormal")
        return choosing.lognormal(self._address, stream, float(mean), float(sigma))

    def _stream(self, source: str, kind: str) -> int:
        if self._alone:  # there are no runs here, whose choices would be too many
            self._sources.memory["length"] = 0
        if self._path == -1 and self._sources.kinds.get(source) == kind:
            known = self._sources.at_root.get(source)
            if known is not None:
                return known
        return self._sources.stream(self._path, source, kind)


class Replay:
    """An `rng` that gives the choices it was given, in pure Python. See `Model.replay`."""

    def __init__(self, choices: Any, path: str = "", counts: dict[str, int] | None = None) -> None:
        self._choices = choices
        self._path = path
        self._counts: dict[str, int] = {} if counts is None else counts

    def at(self, name: str, place: int = 0) -> Replay:
        return Replay(self._choices, f"{self._path}{name}/{int(place)}/", self._counts)

    def _take(self, source: str, *parameters: Any) -> Any:
        name = self._path + source
        call = self._counts.get(name, 0)
        self._counts[name] = call + 1
        if (name, call) not in self._choices:
            raise ModelError(
                f"the model asks for ({name!r}, {call}), which is not among the choices: another "
                "model, or a world in which it goes another way"
            )
        return self._choices[name, call]

    flip = randint = gaussian = uniform = categorical = exponential = lognormal = _take
