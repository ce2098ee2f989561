"""Rules that make one result of several, in no time: the combining functions of [ZR93] §4.

A rule says of itself
    kind: the word for it, which labels its place in a program;
    tests: the arguments that are only asked, yes or no, and never passed on;
    outcome: off line, the distribution of the quality that comes of its arguments';
    unneeded: at run time, the arguments that need not be made any more;
    value: the result; None while, or if, there is none.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from anytime.errors import AnytimeError

Quality = float | None  # None: there is no result
Outcome = tuple[tuple[float, Quality], ...]  # probability, quality
NOTHING: Outcome = ((1.0, None),)
_ANSWERS = tuple(itertools.product((True, False), repeat=2))  # what is true, what is told


class Known(NamedTuple):
    """A result that is there, and what may be seen of its quality."""

    value: Any
    estimate: float | None = None


@dataclass(frozen=True)
class Branch:
    """(test, …, then, otherwise): one of two, by a test, or by several joined by *and* or *or*.

    chances: that each test is true, independently; a test's quality is the probability that it is
    right. everyone: all must be true; otherwise any. What the wrong arm gives is worth the share
    `wrong` of its quality. Tests are asked in turn until the answer is settled.
    """

    chances: tuple[float, ...]
    wrong: float = 0.0
    everyone: bool = True
    kind: ClassVar[str] = "branch"

    def __post_init__(self) -> None:
        if not self.chances:
            raise AnytimeError("a branch has no test; give one")
        for chance in self.chances:
            _share("chance", chance)
        _share("wrong", self.wrong)

    @property
    def tests(self) -> tuple[int, ...]:
        return tuple(range(len(self.chances)))

    def outcome(self, qualities: Sequence[Quality]) -> Outcome:
        return (*self.answered(qualities, True), *self.answered(qualities, False))

    def answered(self, qualities: Sequence[Quality], answer: bool) -> Outcome:
        """The part of the outcome in which the tests answer this; the rest of the chance is in
        the other part."""
        *rights, then, otherwise = qualities
        if any(right is None for right in rights):
            return NOTHING if answer else ()
        found: list[tuple[float, Quality]] = []
        for answers in itertools.product(_ANSWERS, repeat=len(rights)):
            odds = 1.0
            for (true, told), chance, right in zip(answers, self.chances, rights, strict=True):
                odds *= (chance if true else 1 - chance) * _odds(right, true == told)
            true, told = (self._joined([a[place] for a in answers]) for place in (0, 1))
            if told != answer:
                continue
            arm = then if told else otherwise
            found.append((odds, arm if true == told else _scaled(arm, self.wrong)))
        return tuple(found)

    def unneeded(self, known: Sequence[Known | None]) -> frozenset[int]:
        answer = self.answer(known)
        if answer is None:
            return frozenset()
        arms = len(self.chances)
        late = (place for place in self.tests if known[place] is None)
        return frozenset({arms + 1 if answer else arms, *late})

    def value(self, known: Sequence[Known | None]) -> Known | None:
        answer = self.answer(known)
        return None if answer is None else known[len(self.chances) + (0 if answer else 1)]

    def answer(self, known: Sequence[Known | None]) -> bool | None:
        """What the tests say, as far as they have been asked; None while it is open."""
        for place in self.tests:
            test = known[place]
            if test is None:
                return None
            if bool(test.value) != self.everyone:
                return not self.everyone
        return self.everyone

    def _joined(self, answers: Sequence[bool]) -> bool:
        return all(answers) if self.everyone else any(answers)


@dataclass(frozen=True)
class Best:
    """(one, other): the better of two by their estimates; without them the first that is there."""

    compare: bool
    kind: ClassVar[str] = "choose"
    tests: ClassVar[tuple[int, ...]] = ()

    def outcome(self, qualities: Sequence[Quality]) -> Outcome:
        there = [quality for quality in qualities if quality is not None]
        if not there:
            return NOTHING
        return ((1.0, max(there) if self.compare else there[0]),)

    def unneeded(self, known: Sequence[Known | None]) -> frozenset[int]:
        return frozenset()

    def value(self, known: Sequence[Known | None]) -> Known | None:
        there = [result for result in known if result is not None]
        if not there:
            return None
        return max(there, key=lambda result: result.estimate or 0.0) if self.compare else there[0]


@dataclass(frozen=True)
class Until:
    """(result, next): the first if it is seen to be good enough, or if there is no next."""

    quality: float
    kind: ClassVar[str] = "until"
    tests: ClassVar[tuple[int, ...]] = ()

    def __post_init__(self) -> None:
        _share("until", self.quality)

    def outcome(self, qualities: Sequence[Quality]) -> Outcome:
        first, following = qualities
        if first is None:
            return NOTHING
        return ((1.0, first if first >= self.quality or following is None else following),)

    def unneeded(self, known: Sequence[Known | None]) -> frozenset[int]:
        return frozenset({1}) if self._enough(known[0]) else frozenset()

    def value(self, known: Sequence[Known | None]) -> Known | None:
        first, following = known
        return first if following is None or self._enough(first) else following

    def _enough(self, first: Known | None) -> bool:
        return first is not None and (first.estimate or 0.0) >= self.quality


@dataclass(frozen=True)
class Tests:
    """(test, …): tests joined by *and* or *or*, asked in turn until the answer is settled.

    chances, everyone: as of a branch. The quality is the probability that the answer is right.
    """

    chances: tuple[float, ...]
    everyone: bool

    @property
    def kind(self) -> str:
        return "all_of" if self.everyone else "any_of"

    @property
    def tests(self) -> tuple[int, ...]:
        return self._branch.tests

    @property
    def _branch(self) -> Branch:
        return Branch(self.chances, 0.0, self.everyone)

    def outcome(self, qualities: Sequence[Quality]) -> Outcome:
        return self._branch.outcome([*qualities, 1.0, 1.0])

    def unneeded(self, known: Sequence[Known | None]) -> frozenset[int]:
        arms = len(self.chances)
        return self._branch.unneeded([*known, None, None]) - {arms, arms + 1}

    def value(self, known: Sequence[Known | None]) -> Known | None:
        return self._branch.value([*known, Known(True), Known(False)])


@dataclass(frozen=True)
class Several:
    """Several results at once, each with a weight and, if it has one, a deadline of its own.

    deadlines: seconds from the start; inf where there is none. The quality is the weighted mean,
    to which a result that is not there gives 0.
    """

    weights: tuple[float, ...]
    deadlines: tuple[float, ...]
    kind: ClassVar[str] = "several"
    tests: ClassVar[tuple[int, ...]] = ()

    def __post_init__(self) -> None:
        for weight, deadline in zip(self.weights, self.deadlines, strict=True):
            if not 0 < weight < float("inf"):
                raise AnytimeError(f"weight={weight}; give a finite number > 0")
            if not deadline > 0:
                raise AnytimeError(f"deadline={deadline}; give seconds > 0 from the start")

    def outcome(self, qualities: Sequence[Quality]) -> Outcome:
        if all(quality is None for quality in qualities):
            return NOTHING
        total = sum(w * (q or 0.0) for w, q in zip(self.weights, qualities, strict=True))
        return ((1.0, min(1.0, total / sum(self.weights))),)

    def unneeded(self, known: Sequence[Known | None]) -> frozenset[int]:
        return frozenset()

    def value(self, known: Sequence[Known | None]) -> Known | None:
        if all(result is None for result in known):
            return None
        return Known(tuple(None if result is None else result.value for result in known))


Rule = Branch | Tests | Best | Until | Several


def _share(name: str, value: float) -> None:
    if not 0 <= value <= 1:
        raise AnytimeError(f"{name}={value}; give a number in [0, 1]")


def _odds(right: Quality, is_right: bool) -> float:
    return (right or 0.0) if is_right else 1 - (right or 0.0)


def _scaled(quality: Quality, factor: float) -> Quality:
    return None if quality is None else quality * factor
