"""Optimisation queries: the choices with which a model returns the least. [PRP16] §2, §4."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import Clock, Deadline, WorkClock, is_number
from anytime.errors import AnytimeError
from planners.query import choosing, genetics
from planners.query.background import Share, Worker
from planners.query.choices import Address, Choices, Solution
from planners.query.errors import NativeError
from planners.query.memory import Memory, random_state
from planners.query.models import Model
from planners.query.operators import Operators
from planners.query.reading import Text
from planners.query.sources import Rng, Sources
from planners.query.worlds import World

TURN = 5e-4
"""Seconds between two looks at the world and at who waits, if no generation takes longer."""

_MOST = 64  # generations of a turn, however short they are

_LONGEST = 8192  # choices: a longer run is invalid, and the tables do not grow for it


class Query:
    """Searches for the choices with which a model returns the least, as long as it is let.

    world: what the model is evaluated in, a mapping of names to numbers and arrays; the query's
    own `world` may be changed at any time. population: individuals, beside the scouts. native: None
    means compiled; False runs the model plain. All of it can be used from several threads.
    Raises ModelError for a model that asks a source for two distributions, NativeError for one
    that has no native form.
    """

    def __init__(
        self,
        model: Model,
        world: Mapping[str, Any] | None = None,
        *,
        population: int = 60,
        seed: int = 0,
        operators: Operators | None = None,
        native: bool = True,
    ) -> None:
        if not isinstance(model, Model):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(f"{model!r} is no model; decorate a function with @query.model")
        islands = (operators or Operators()).islands
        if population < 4 * islands or population % islands:
            raise AnytimeError(
                f"population={population}; give a multiple of the {islands} islands, 4 each or more"
            )
        self.model = model
        self.operators = operators or Operators()
        self.world = World(world)
        self._native = model.native(self.world) if native else None
        self._memory = _memory(population, seed, self.operators)
        self._sources = Sources(self._memory)
        if (text := _text(model)) is not None:
            self._sources.expect(text)
        # A search takes the lock again and again; who asks holds the gate until he has had it, and
        # a search passes through that, so that nobody waits for longer than one turn. Both are
        # taken by `with` alone: an interrupt between taking and releasing would keep them for ever.
        self._gate, self._lock = threading.Lock(), threading.Lock()
        self._best: Solution | None = None
        self.turn = 1  # generations of a turn

    @property
    def evaluations(self) -> int:
        """How often the model was run so far."""
        return self._memory["evaluations"]

    @property
    def generations(self) -> int:
        """How many generations there were so far."""
        return self._memory["generation"]

    @property
    def size(self) -> int:
        """Evaluations of a generation: the population and the scouts."""
        return self._memory["size"]

    @property
    def best(self) -> Solution:
        """The best of the last generation, valued in the world that it saw.

        Raises AnytimeError before the first generation.
        """
        with self._gate, self._lock:
            if self._best is None:
                self._best = self._solution(self._memory["best"])
            return self._best

    @property
    def values(self) -> NDArray[np.float64]:
        """What each individual of the last generation was worth, float64 [size], scouts last."""
        with self._gate, self._lock:
            begin = self._memory["side"] * (self.size + 1)
            return self._memory.blocks["values"][begin : begin + self.size].copy()

    @property
    def value(self) -> float:
        """The value of the best; inf before the first generation."""
        return self._value(self._memory["best"])

    def step(self, generations: int = 1, until: float = -math.inf) -> int:
        """Make some generations; fewer if the best value comes to `until`. How many were made.

        Raises AnytimeError for a number of generations that is no integer.
        """
        if not is_number(generations) or generations % 1 != 0:
            raise AnytimeError(f"generations is {generations!r}; give an integer")
        made = 0
        while made < generations:
            with self._gate:
                pass
            with self._lock:
                self.world.take_over()
                begun = time.perf_counter()
                done = self._evolve(min(self.turn, generations - made), until)
                each = (time.perf_counter() - begun) / done
                self.turn = max(1, min(_MOST, int(TURN / each))) if each > 0 else _MOST
                self._best = None
                made += done
                if self.value <= until:
                    break
        return made

    @contextmanager
    def background(self, clock: Clock | None = None) -> Generator[Query]:
        """Search while the block runs: a control loop, a mission.

        On the wall clock in a thread, without Python's lock while a native model is evaluated. On a
        work clock no thread starts: whenever time passes there, the query makes the evaluations
        that its model's rate on the clock's machine allows, in whole generations, and keeps the
        rest for the next time. What a model raises is raised when the block ends.
        Raises AnytimeError if the machine has no rate > 0 for the model.
        """
        if isinstance(clock, WorkClock):
            each = clock.machine.seconds(self.model.name, 1.0)
            if not each > 0:
                raise AnytimeError(
                    f"{self.model.name!r} takes no time on machine {clock.machine.name!r}, so a "
                    "search would never end; give it a rate > 0"
                )
            with clock.beside(Share(self, each)):
                yield self
            return
        worker = Worker(self)
        worker.start()
        try:
            yield self
        finally:
            worker.end()

    def run(
        self,
        seconds: float = math.inf,
        *,
        evaluations: float = math.inf,
        until: float = -math.inf,
    ) -> Solution:
        """Search until the time is up, the evaluations are spent or the value is reached.

        Zero or negative seconds mean stop now; what was found before is returned.
        Raises AnytimeError if none of the three is given, or nothing was found.
        """
        if any(math.isnan(each) for each in (seconds, evaluations, until)):
            raise AnytimeError(
                f"seconds={seconds}, evaluations={evaluations}, until={until}; give numbers"
            )
        if seconds == math.inf and evaluations == math.inf and until == -math.inf:
            raise AnytimeError(
                "give seconds=…, evaluations=… or until=…: a query never ends itself"
            )
        if self.generations == 0 and evaluations < self.size:
            raise AnytimeError(
                f"evaluations={evaluations}, but the first generation takes {self.size}; give as "
                "many, or make the population smaller"
            )
        deadline = Deadline.after(seconds)
        last = self.evaluations + evaluations
        while not deadline.expired() and (left := last - self.evaluations) >= self.size:
            self.step(int(min(self.turn, left // self.size)), until)
            if self.value <= until:
                break
        return self.best

    def constrain(self, choices: Mapping[Address, Any]) -> None:
        """From now on these choices are made as given, and no others are constrained.

        What a robot has executed stays: `query.constrain(query.best.choices.first(3))`. A choice
        outside the range that the model asks for is drawn anew nevertheless.
        Raises AnytimeError for an address that the model never asked for.
        """
        with self._gate, self._lock:
            fixed = [(self._cell(at), _chosen(at, value)) for at, value in choices.items()]
            self._memory.blocks["fixed"][:] = np.nan
            for cell, value in fixed:
                self._memory.blocks["fixed"][cell] = value
            self._memory["constrained"] = int(bool(fixed))

    def suggest(self, choices: Mapping[Address, Any]) -> None:
        """Put known choices into the population, in the place of its worst: yesterday's plan, or
        what an expert would do. Choices that the model asks for beyond them are drawn, those that
        are constrained stay as they are.

        Raises AnytimeError for an address that the model never asked for.
        """
        if self.generations == 0:
            self.step()
        with self._gate, self._lock:
            self.world.take_over()
            genetics.adopt(self._memory.address, self._valued(choices, constrained=True))
            self._best = None

    def value_of(self, choices: Mapping[Address, Any]) -> float:
        """What the model returns for these choices in the newest world; others are drawn.

        inf for NaN, and for a run of more than 8192 choices. Raises AnytimeError for an address
        that the model never asked for.
        """
        with self._gate, self._lock:
            self.world.take_over()
            return self._valued(choices)

    # --- One generation after the other.

    def _evolve(self, generations: int, until: float) -> int:
        memory = self._memory
        if self._native is None:
            done = self._evolve_plain(generations, until)
        else:
            done = genetics.evolve(
                memory.address, self._native.address, self.world.address, generations, until
            )
        self._grow()
        return done

    def _evolve_plain(self, generations: int, until: float) -> int:
        memory, world = self._memory, self.world.plain
        for done in range(generations):
            for row in range(memory["size"]):
                self._evaluate_plain(row, world)
            genetics.close(memory.address)
            if memory["grow"] or self._value(memory["best"]) <= until:
                return done + 1
        return generations

    def _evaluate_plain(self, row: int, world: Any) -> None:
        genetics.breed(self._memory.address, row)
        value = self.model(Rng.of(self._sources), world)
        genetics.settle(self._memory.address, row, float(value))

    def _grow(self) -> bool:
        """Make the tables larger that were too small, if they may be; whether one was."""
        memory, reasons = self._memory, self._memory["grow"]
        due = {
            "most_streams": reasons & choosing.FEW_STREAMS,
            "most_cells": reasons & choosing.FEW_CELLS,
            "width": reasons & choosing.NARROW and memory["width"] < _LONGEST,
            "longest": reasons & choosing.SHORT and memory["longest"] < _LONGEST,
        }
        for table in filter(due.get, due):
            memory.grow(table)
        memory["grow"] = 0
        return any(due.values())

    # --- What the tables hold.

    def _value(self, row: int) -> float:
        memory = self._memory
        return float(memory.blocks["values"][memory["side"] * (memory["size"] + 1) + row])

    def _solution(self, row: int) -> Solution:
        memory, blocks = self._memory, self._memory.blocks
        if memory["generation"] == 0:
            raise AnytimeError("nothing was found yet; call step or run first")
        at = memory["side"] * (memory["size"] + 1) + row
        values: dict[Address, Any] = {}
        kinds: dict[Address, str] = {}
        for cell in blocks["logs"][at, : blocks["lengths"][at]]:
            address, kind = self._sources.address_of(int(cell))
            values[address] = _typed(kind, float(blocks["genomes"][at, cell]))
            kinds[address] = kind
        return Solution(self._value(row), Choices(values, kinds))

    def _cell(self, address: Address) -> int:
        try:
            source, index = address
            *path, name = source.split("/")
        except (AttributeError, TypeError, ValueError):
            raise AnytimeError(
                f'{address!r} is no address; give (source, call), like ("walk", 0)'
            ) from None
        kind = self._sources.kinds.get(name)
        known = kind is not None and len(path) % 2 == 0
        known = known and all(scope in self._sources.numbers for scope in path[::2])
        known = known and all(place.isdecimal() and len(place) < 19 for place in path[1::2])
        if not known or not is_number(index) or index != int(index) or not 0 <= index < _LONGEST:
            asked = ", ".join(self._sources.kinds)
            raise AnytimeError(f"the model has no choice ({source!r}, {index}); it asks {asked}")
        assert kind is not None
        return self._sources.locate((source, int(index)), kind)

    def _valued(self, choices: Mapping[Address, Any], *, constrained: bool = False) -> float:
        """Run the model once beside the populations: in the spare row of the children.

        constrained: make the choices that are constrained as they are. inf for a run that is longer
        than any can be.
        """
        memory = self._memory
        cells = {self._cell(at): _chosen(at, value) for at, value in choices.items()}
        if constrained:
            fixed = memory.blocks["fixed"]
            cells |= {int(cell): float(fixed[cell]) for cell in np.flatnonzero(~np.isnan(fixed))}
        kept = {name: memory[name] for name in ("random", "evaluations", "constrained")}
        memory["constrained"] = 0
        try:
            while True:
                value = self._valued_once(cells)
                memory["random"] = kept["random"]
                memory["grow"] = memory["overflow"]
                if not self._grow():
                    break
        finally:
            for name, before in kept.items():
                memory[name] = before
        return math.inf if math.isnan(value) or memory["overflow"] else value

    def _valued_once(self, cells: Mapping[int, float]) -> float:
        memory, row = self._memory, self._memory["size"]
        genetics.prepare(memory.address, row)
        genome = memory.blocks["genomes"][(1 - memory["side"]) * (row + 1) + row]
        genome[:] = np.nan
        for cell, value in cells.items():
            genome[cell] = value
        if self._native is None:
            return float(self.model(Rng.of(self._sources), self.world.plain))
        return genetics.call(memory.address, self._native.address, self.world.address)


def _text(model: Model) -> Text | None:
    """The text of a model, or None of one that can only be plain."""
    try:
        return model.text
    except NativeError:
        return None


def _memory(population: int, seed: int, operators: Operators) -> Memory:
    scouts = round(population * operators.scouts)
    memory = Memory(population + scouts, 8, operators.islands)
    memory["main"] = population
    memory["kept"] = max(1, round(population // operators.islands * operators.elites))
    memory["scouts_kept"] = min(scouts, max(1, round(scouts * operators.elites)))
    memory["random"] = random_state(seed)
    memory["calm"] = 1.0
    for name in ("crossover", "line", "difference", "cloud", "pair", "structure", "immigrants"):
        memory[name] = getattr(operators, name)
    memory["mutations"], memory["exclusion"] = operators.mutations, operators.exclusion
    memory["smallest_step"], memory["largest_step"] = operators.steps
    memory["steps_range"] = math.log(operators.steps[0] / operators.steps[1])
    memory["restart"] = operators.restart
    memory["adaptive"], memory["dormant"] = int(operators.adaptive), int(operators.dormant)
    return memory


def _chosen(address: Address, value: Any) -> float:
    if not is_number(value) and not isinstance(value, bool | np.bool_):
        raise AnytimeError(f"the choice {address!r} is {value!r}; give a number")
    return float(value)


def _typed(kind: str, value: float) -> Any:
    if kind == "flip":
        return value != 0.0
    return int(value) if kind in ("randint", "categorical") else value
