"""Contracts in turn on several processors and for several problems. [BFZ03], [LAH14]."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from anytime.errors import AnytimeError


@dataclass(frozen=True)
class Contract:
    """One contract: which problem, on which processor, from `start` for `length` seconds."""

    problem: int
    processor: int
    start: float
    length: float

    @property
    def end(self) -> float:
        return self.start + self.length


def round_robin(
    first: float, *, processors: int = 1, problems: int = 1, base: float | None = None
) -> Iterator[Contract]:
    """Contracts for m processors and n problems, without end: each problem in turn, each processor
    in turn, each contract `base` times as long as the last.

    first: seconds of the first contract, the shortest that is of use. With the default base,
    ((m + n) / n)^(1 / m), the acceleration ratio is the least that is possible, `optimal_ratio`;
    with one processor and one problem it doubles. Raises AnytimeError for counts below 1 and for a
    base that does not grow.
    """
    _check(processors, problems)
    best = math.pow((processors + problems) / problems, 1 / processors)
    growth = best if base is None else base
    if not (first > 0 and 1 < growth < math.inf):
        raise AnytimeError(f"first={first}, base={base}; give seconds > 0 and a base > 1")
    return _in_turn(first, processors, problems, growth)


def _in_turn(first: float, processors: int, problems: int, base: float) -> Iterator[Contract]:
    free = [0.0] * processors
    for index in itertools.count():
        processor = index % processors
        made = Contract(index % problems, processor, free[processor], first * base**index)
        free[processor] = made.end
        yield made


def optimal_ratio(processors: int = 1, problems: int = 1) -> float:
    """The least acceleration ratio on m processors for n problems: (n/m) ((m+n)/n)^((m+n)/m).

    4 for one of each. [LAH14] proves that no other schedule has less. Raises AnytimeError for
    counts below 1.
    """
    _check(processors, problems)
    m, n = processors, problems
    return n / m * ((m + n) / n) ** ((m + n) / m)


def simulated_ratio(contracts: Sequence[Contract]) -> float:
    """The acceleration ratio of these contracts, lived through from the moment when each problem
    has a result until the last contract that is begun in order has ended.

    At a moment t a problem's answer is that of its longest contract that is done; the ratio is t
    over that length, for the worst problem and at the worst moment, which is just before a contract
    ends.
    """
    problems = {contract.problem for contract in contracts}
    longest = dict.fromkeys(problems, 0.0)
    known = min(
        max(c.end for c in contracts if c.processor == processor)
        for processor in {contract.processor for contract in contracts}
    )  # later on a processor might end what is not listed
    worst = 0.0
    for contract in sorted(contracts, key=lambda contract: contract.end):
        if contract.end > known:
            break
        least = min(longest.values())
        if least > 0:
            worst = max(worst, contract.end / least)
        longest[contract.problem] = max(longest[contract.problem], contract.length)
    return worst


def _check(processors: int, problems: int) -> None:
    if processors < 1 or problems < 1:
        raise AnytimeError(
            f"{processors} processors, {problems} problems; give at least one of each"
        )
