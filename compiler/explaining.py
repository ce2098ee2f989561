"""Why a budget is divided as it is, and what would make the program better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from anytime.errors import AnytimeError
from anytime.pictures import duration, number
from compiler.costs import stretched
from compiler.division import Frontier, divide
from compiler.tables import Table


@dataclass(frozen=True)
class Price:
    """What one call gets, and the value of `step` seconds more given to it for nothing."""

    label: str
    share: float
    gain: float


@dataclass(frozen=True)
class Explanation:
    """Who gets how much of a budget, and why.

    step: seconds that prices are quoted for; less, more: promised with 10 % less or more time.
    """

    program: str
    seconds: float
    promised: float
    prices: tuple[Price, ...]
    step: float
    less: float
    more: float

    def __repr__(self) -> str:
        lines = [
            f"{self.program} in {duration(self.seconds)}: promised {number(self.promised)}; "
            f"10 % less time {number(self.less)}, 10 % more {number(self.more)}"
        ]
        for price in self.prices:
            share = price.share / self.seconds if self.seconds > 0 else 0.0
            bar = "█" * round(24 * share)
            lines.append(
                f"  {price.label:<18.18} {duration(price.share):>9} {bar:<24} "
                f"{duration(self.step)} more for it: {price.gain:+.4f}"
            )
        return "\n".join(line[:100] for line in lines)


@dataclass(frozen=True)
class Change:
    """A change to one module and what the program would then promise."""

    label: str
    what: str
    promised: float
    gain: float


@dataclass(frozen=True)
class Advice:
    """Changes to single modules, the most valuable first."""

    program: str
    seconds: float
    promised: float
    changes: tuple[Change, ...]

    def __repr__(self) -> str:
        lines = [f"{self.program} in {duration(self.seconds)} promises {number(self.promised)}"]
        lines += [
            f"  {change.label} {change.what}: {number(change.promised)} ({change.gain:+.3f})"
            for change in self.changes
        ]
        return "\n".join(line[:100] for line in lines)


def explain(name: str, tables: Sequence[Table], frontier: Frontier, seconds: float) -> Explanation:
    """The division of a budget with the price of a little more time for each call.

    The price is V(budget, with `step` seconds given to this call alone, re-divided) − V(budget):
    at a fixed division a ladder of results has no meaningful price. Raises AnytimeError below the
    least budget.
    """
    index = frontier.index(seconds)
    if index < 0:
        raise AnytimeError(
            f"{duration(seconds)} is below the least budget of {name!r}, "
            f"{duration(float(frontier.budgets[0]))}"
        )
    promised = frontier.promise(seconds)
    step = 0.05 * seconds
    shares = stretched(tables, frontier.shares[index].tolist(), seconds)
    prices = tuple(
        Price(
            table.label,
            shares[table.label],
            _with(tables, place, table.ahead(step), seconds, promised) - promised,
        )
        for place, table in enumerate(tables)
        if table.rule is None
    )
    return Explanation(
        name,
        seconds,
        promised,
        prices,
        step,
        frontier.promise(0.9 * seconds),
        frontier.promise(1.1 * seconds),
    )


def advise(name: str, tables: Sequence[Table], frontier: Frontier, seconds: float) -> Advice:
    """Each call's module made twice as fast, ranked by what the program would then promise."""
    promised = frontier.promise(seconds)
    changes: list[Change] = []
    for place, table in enumerate(tables):
        if table.rule is not None:
            continue
        value = _with(tables, place, table.faster(2.0), seconds, promised)
        changes.append(Change(table.label, "2× faster", value, value - promised))
    changes.sort(key=lambda change: -change.gain)
    return Advice(name, seconds, promised, tuple(changes))


def _with(
    tables: Sequence[Table], place: int, changed: Table, seconds: float, promised: float
) -> float:
    """What the program promises with one table replaced by a faster one, the time divided anew.

    The division that is promised now still fits, so that the promise cannot be lower.
    """
    again = divide([*tables[:place], changed, *tables[place + 1 :]])
    return max(again.promise(seconds), promised)
