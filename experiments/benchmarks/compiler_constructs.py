"""Branches, loops, choices, parallels and several outputs against living every division.

A random sketch of a program is read by the compiler, and lived here by an interpreter of its own,
which knows the sketch alone: for every division of time it follows every way that the tests may
come out, adds up what is run, and keeps the best quality for every budget.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import compiler
from anytime.modules import Module
from anytime.programs import Join, Program, upstream
from anytime.structure import paths
from compiler.division import divide
from compiler.tables import Table, table_of

KINDS = ("branch", "loop", "choose", "parallel", "outputs", "tests")


Live = Callable[..., float | None]  # quality of a call, by its label and what it is fed
Ways = Iterator[tuple[float, float | None, float]]  # chance, quality or None, seconds


@dataclass(frozen=True)
class Sketch:
    """A random program: `say` writes it with the compiler's words, `live` knows what it does.

    live: called with (quality of a call by its label and what it is fed, seconds by label), yields
    (chance, quality or None, seconds) for every way that it may go.
    """

    say: Callable[[Any], Any]
    live: Callable[[Live, dict[str, float]], Ways]
    deadlines: tuple[float, ...] = ()


def mismatches(kind: str, count: int, seed: int) -> int:
    """Of so many random programs of a kind, those whose promise differs from the best of all
    divisions at any budget."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    return sum(_differs(sketch(kind, rng), rng) for _ in range(count))


def sketch(kind: str, rng: np.random.Generator) -> Sketch:
    """A random program of a kind."""
    chance, wrong = float(rng.uniform(0.1, 0.9)), float(rng.choice([0.0, rng.random()]))
    if kind == "branch":
        after = bool(rng.random() < 0.5)
        return _branch(chance, wrong, after)
    if kind == "loop":
        return _loop(str(rng.choice(["times", "until", "asked"])), chance, float(rng.random()))
    if kind == "choose":
        return _choose(bool(rng.random() < 0.5))
    if kind == "parallel":
        processors = int(rng.integers(1, 4))
        shapes = (_parallel, _joined, _nested, _after_each_other)
        return shapes[int(rng.integers(len(shapes)))](processors)
    if kind == "outputs":
        drawn = rng.integers(2, 16, size=2)
        deadlines = tuple(float(d) if d < 9 else math.inf for d in drawn)
        return _outputs(
            (1.0, float(rng.uniform(0.5, 3))), tuple(deadlines), bool(rng.random() < 0.5)
        )
    return _tests(bool(rng.random() < 0.5), chance, float(rng.uniform(0.1, 0.9)), wrong)


def _branch(chance: float, wrong: float, after: bool) -> Sketch:
    def say(image: Any) -> Any:
        seen = see(image)
        taken = compiler.branch(
            test(seen), near(seen), far(near_2(image)), chance=chance, wrong=wrong
        )
        return last(taken) if after else taken

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        seen = quality("see")
        right = quality("test", seen)
        before = seconds["see"] + seconds["test"] + (seconds["last"] if after else 0.0)
        arms = quality("near", seen), quality("far", quality("near_2"))
        spent = seconds["near"], seconds["near_2"] + seconds["far"]
        for true, told_right in itertools.product((True, False), (True, False)):
            if right is None:
                yield 1.0, None, before
                return
            odds = (chance if true else 1 - chance) * (right if told_right else 1 - right)
            arm = 0 if true == told_right else 1
            found = arms[arm]
            if found is not None and not told_right:
                found *= wrong
            yield odds, quality("last", found) if after else found, before + spent[arm]

    return Sketch(say, live)


def _loop(how: str, chance: float, enough: float) -> Sketch:
    def say(image: Any) -> Any:
        if how == "times":
            return compiler.loop(last, see(image), times=2)
        if how == "until":
            return compiler.loop(last, see(image), times=3, until=enough)
        return compiler.loop(last, see(image), until=test, chances=(chance,))

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        one = quality("last", quality("see"))
        two = quality("last_2", one)
        spent = seconds["see"] + seconds["last"]
        if how == "times":
            yield 1.0, two, spent + seconds["last_2"]
        elif how == "until":
            found, all_spent = one, spent
            for label in ("last_2", "last_3"):
                all_spent += seconds[label]
                if found is not None and found >= enough:
                    continue
                further = quality(label, found)
                if further is None:
                    break
                found = further
            yield 1.0, found, spent + seconds["last_2"] + seconds["last_3"]
        else:
            right = quality("test", one)
            spent += seconds["test"]
            if right is None:
                yield 1.0, None, spent
                return
            ends = chance * right + (1 - chance) * (1 - right)
            yield ends, one, spent
            yield 1 - ends, two, spent + seconds["last_2"]

    return Sketch(say, live)


def _choose(after: bool) -> Sketch:
    def say(image: Any) -> Any:
        seen = see(image)
        best = compiler.choose(near(seen), far(seen), near_2(image))
        return last(best) if after else best

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        seen = quality("see")
        found = [quality("near", seen), quality("far", seen), quality("near_2")]
        best = max((q for q in found if q is not None), default=None)
        yield 1.0, quality("last", best) if after else best, sum(seconds.values())

    return Sketch(say, live)


def _parallel(processors: int) -> Sketch:
    def say(image: Any) -> Any:
        seen = see(image)
        made = compiler.parallel(near(seen), far(near_2(seen)), test(image), processors=processors)
        return merge(*made)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        seen = quality("see")
        made = quality("near", seen), quality("far", quality("near_2", seen)), quality("test")
        arms = [seconds["near"], seconds["near_2"] + seconds["far"], seconds["test"]]
        ends = min(
            max(sum(s for s, on in zip(arms, places, strict=True) if on == p) for p in range(3))
            for places in itertools.product(range(processors), repeat=3)
        )
        yield 1.0, quality("merge", *made), seconds["see"] + ends + seconds["merge"]

    return Sketch(say, live)


def _joined(processors: int) -> Sketch:
    """With alternatives within an arm."""

    def say(image: Any) -> Any:
        seen = see(image)
        best = compiler.choose(near(seen), far(seen))
        return merge(*compiler.parallel(last(best), test(image), processors=processors), seen)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        seen = quality("see")
        found = [q for q in (quality("near", seen), quality("far", seen)) if q is not None]
        made = quality("last", max(found, default=None)), quality("test")
        arms = [seconds["near"] + seconds["far"] + seconds["last"], seconds["test"]]
        ends = sum(arms) if processors == 1 else max(arms)
        yield 1.0, quality("merge", *made, seen), seconds["see"] + ends + seconds["merge"]

    return Sketch(say, live)


def _nested(processors: int) -> Sketch:
    """With a parallel within an arm."""

    def say(image: Any) -> Any:
        seen = see(image)
        inner = compiler.parallel(near(seen), far(image), processors=processors)
        both = compiler.parallel(merge(*inner, seen), test(image))
        return compiler.choose(*both)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        seen = quality("see")
        found = quality("merge", quality("near", seen), quality("far"), seen), quality("test")
        inner = seconds["near"], seconds["far"]
        arm = (sum(inner) if processors == 1 else max(inner)) + seconds["merge"]
        best = max((q for q in found if q is not None), default=None)
        yield 1.0, best, seconds["see"] + max(arm, seconds["test"])

    return Sketch(say, live)


def _after_each_other(processors: int) -> Sketch:
    """A parallel of what another one made."""

    def say(image: Any) -> Any:
        first = compiler.parallel(near(image), near_2(image))
        made = compiler.parallel(far(first[0]), last(first[1]), processors=processors)
        return compiler.choose(*made)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        found = quality("far", quality("near")), quality("last", quality("near_2"))
        second = seconds["far"], seconds["last"]
        spent = max(seconds["near"], seconds["near_2"])
        spent += sum(second) if processors == 1 else max(second)
        yield 1.0, max((q for q in found if q is not None), default=None), spent

    return Sketch(say, live)


def _outputs(weights: tuple[float, float], deadlines: tuple[float, ...], shared: bool) -> Sketch:
    if shared:
        deadlines = (math.inf, math.inf)

    def say(image: Any) -> Any:
        first = see(image)
        second = near(first) if shared else near_2(image)
        given = zip((last(first), far(second)), weights, deadlines, strict=True)
        return tuple(compiler.output(r, weight=w, deadline=d) for r, w, d in given)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        first = quality("see")
        second = quality("near", first) if shared else quality("near_2")
        found = quality("last", first), quality("far", second)
        spent = [seconds["see"] + seconds["last"]]
        spent.append(seconds["near" if shared else "near_2"] + seconds["far"])
        total, clock = 0.0, 0.0
        for place in sorted((0, 1), key=lambda place: deadlines[place]):
            clock += spent[place]
            if found[place] is not None and clock <= deadlines[place]:
                total += weights[place] * (found[place] or 0.0)
        yield 1.0, total / sum(weights), sum(seconds.values())

    return Sketch(say, live, deadlines)


def _tests(everyone: bool, one: float, other: float, wrong: float) -> Sketch:
    def say(image: Any) -> Any:
        joined = (compiler.all_of if everyone else compiler.any_of)(
            see(image), test(image), chances=(one, other)
        )
        return compiler.branch(joined, near(image), far(image), wrong=wrong)

    def live(quality: Live, seconds: dict[str, float]) -> Ways:
        rights = [quality("see"), quality("test")]
        arms = quality("near"), quality("far")
        if None in rights:
            yield 1.0, None, sum(seconds.values())
            return
        sure = [right or 0.0 for right in rights]
        for truth in itertools.product((True, False), repeat=2):
            for right in itertools.product((True, False), repeat=2):
                odds = 1.0
                for place, chance in enumerate((one, other)):
                    odds *= chance if truth[place] else 1 - chance
                    odds *= sure[place] if right[place] else 1 - sure[place]
                told = [true == is_right for true, is_right in zip(truth, right, strict=True)]
                join = all if everyone else any
                arm = 0 if join(told) else 1
                found = arms[arm]
                if found is not None and join(told) != join(truth):
                    found *= wrong
                spent = seconds["see"] + seconds["test"] + seconds[("near", "far")[arm]]
                yield odds, found, spent

    return Sketch(say, live)


def _named(name: str, *parameters: str) -> Module:
    def never(*inputs: object) -> None:
        raise AssertionError("only its table is used")

    return Module(name, never, parameters, quality=lambda value: 1.0, estimate=lambda value: 1.0)


see, test, near, near_2, far, last = (
    _named(name, "value") for name in ("see", "test", "near", "near_2", "far", "last")
)
merge = _named("merge", "one", "two", "three")


def read(sketch: Sketch) -> Program:
    """The program of a sketch, as the compiler reads it."""
    return compiler.program(lambda image: sketch.say(image))


def random_tables(program: Program, rng: np.random.Generator) -> tuple[Table, ...]:
    """A deterministic table for every call of a program, and those of its joins by their rules."""
    made: dict[str, Table] = {}
    arms = paths(program)
    for node in program.nodes:
        if isinstance(node, Join):
            made[node.label] = table_of(node, made, output=node is program.output)
            continue
        feeds = tuple(dict.fromkeys(source.label for source in upstream(node).values()))
        count = int(rng.integers(2, 4))
        times = np.concatenate([[0.0], np.cumsum(rng.integers(1, 4, size=int(rng.integers(1, 4))))])
        shape = tuple(len(made[feed].levels) for feed in feeds)
        reached = rng.integers(0, count, size=(*shape, len(times)))
        reached[..., 0] = 0
        for axis in range(len(shape)):
            reached[(slice(None),) * axis + (0,)] = 0  # no input, no result
        drawn = rng.choice(1000, count - 1, replace=False)  # no two levels are the same quality
        levels = np.concatenate([[0.0], np.sort(drawn) / 1000])
        chances = (reached[..., None] == np.arange(count)).astype(float)
        made[node.label] = Table(
            node.label, node.module.name, feeds, levels, times, chances, 1.0, arms[node.label]
        )
    return tuple(made.values())


def best_of_all(
    program: Program, tables: Sequence[Table], sketch: Sketch
) -> list[tuple[float, float]]:
    """For each budget at which it rises, the best expected quality of any division."""
    calls = [table for table in tables if table.rule is None]
    by_label = {table.label: table for table in tables}
    found: dict[float, float] = {}
    for moments in itertools.product(*(range(len(table.times)) for table in calls)):
        at = dict(zip((table.label for table in calls), moments, strict=True))
        seconds = {label: float(by_label[label].times[moment]) for label, moment in at.items()}

        def quality(label: str, *fed: float | None, at: dict[str, int] = at) -> float | None:
            if label not in at or any(one is None for one in fed):
                return None
            table = by_label[label]
            cell = tuple(
                _level(by_label[feed], value) for feed, value in zip(table.feeds, fed, strict=True)
            )
            level = int(table.chances[(*cell, at[label])].argmax())
            return float(table.levels[level]) if level else None

        filled = {**dict.fromkeys(("see", "test", "near", "near_2", "far", "last"), 0.0), **seconds}
        ways = list(sketch.live(quality, filled))
        budget = max(spent for chance, _, spent in ways if chance > 0)
        value = sum(chance * (found_quality or 0.0) for chance, found_quality, _ in ways)
        found[budget] = max(value, found.get(budget, 0.0))
    rising = []
    best = 0.0
    for budget in sorted(found):
        if found[budget] > best + 1e-12:
            best = found[budget]
        rising.append((budget, best))
    return rising


def _level(table: Table, value: float | None) -> int:
    """The level of a quality; the first is of no result, whatever number stands there."""
    assert value is not None
    return 1 + int(np.abs(table.levels[1:] - value).argmin())


def _differs(sketch: Sketch, rng: np.random.Generator) -> bool:
    program = read(sketch)
    tables = random_tables(program, rng)
    frontier = divide(tables)
    for budget, best in best_of_all(program, tables, sketch):
        promised = frontier.promise(budget) if len(frontier.budgets) else 0.0
        if abs(promised - best) > 1e-9:
            return True
    return False
