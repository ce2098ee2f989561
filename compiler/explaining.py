"""Why a budget is divided as it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.pictures import clipped, duration, elided, figure, line_chart, number, sparkline
from anytime.programs import Program
from compiler.calibrating import AS_IT_IS, Calibration
from compiler.costs import stretched
from compiler.division import Frontier, divide
from compiler.objectives import EXPECTED, Objective
from compiler.policies import Plan, Policy
from compiler.stopping import endings, transitions
from compiler.tables import Table

Floats = NDArray[np.float64]
COLUMNS = 12  # budgets of the sparkline of a share


@dataclass(frozen=True)
class Price:
    """What one call gets, and the value of `step` seconds more given to it for nothing.

    a_second: the same as a rate, quality a second. shares: [COLUMNS] share of the budget that it
    gets at budgets from the least to that beyond which nothing is gained.
    """

    label: str
    share: float
    gain: float
    a_second: float
    shares: tuple[float, ...]


@dataclass(frozen=True)
class Explanation:
    """Who gets how much of a budget, and why.

    step: seconds that prices are quoted for; less, more: promised with 10 % less or more time.
    within: the 95 % interval of the promise. regret: no division is better by more, at 95 %.
    budgets: of the shares over time. decided: what an adaptive schedule decides while it runs;
    the shares and prices are then those of the best fixed division.
    """

    program: str
    seconds: float
    promised: float
    prices: tuple[Price, ...]
    step: float
    less: float
    more: float
    within: tuple[float, float]
    regret: float
    budgets: tuple[float, ...]
    decided: str = ""

    def __repr__(self) -> str:
        low, high = self.within
        width = min(max(16, *(len(price.label) for price in self.prices)), 20)
        lines = [
            f"{self.program} in {duration(self.seconds)}: promised {number(self.promised)}"
            f" [{number(low)}, {number(high)}]; "
            f"10 % less time {number(self.less)}, 10 % more {number(self.more)}",
            f"  {'call':<{width}} {'gets':>9} {'':<16}  {duration(self.step):>8} more  a second"
            f"  shares {duration(self.budgets[0])} … {duration(self.budgets[-1])}",
        ]
        for price in self.prices:
            share = price.share / self.seconds if self.seconds > 0 else 0.0
            bar = "█" * round(16 * share)
            lines.append(
                f"  {elided(price.label, width):<{width}} {duration(price.share):>9} {bar:<16}  "
                f"{price.gain:>+13.4f}  {price.a_second:>+8.2f}  {sparkline(price.shares)}"
            )
        lines.append(self.decided or certificate(self.regret))
        return "\n".join(clipped(line) for line in lines)

    def _repr_html_(self) -> str:
        """Shares against the budget, one above the other."""
        x = list(self.budgets)
        below = np.zeros(len(x))
        series: dict[str, tuple[Sequence[float], Sequence[float]]] = {}
        bands: dict[str, tuple[Sequence[float], Sequence[float], Sequence[float]]] = {}
        for price in self.prices:
            above = below + np.array(price.shares)
            series[price.label] = (x, above.tolist())
            bands[price.label] = (x, below.tolist(), above.tolist())
            below = above
        svg = line_chart(
            series, bands=bands, x_label="budget [s]", y_label="share", title=self.program
        )
        return figure(svg, repr(self))


def certificate(regret: float) -> str:
    """What the profiles' bands say of the division, as a line."""
    if regret >= 1:
        return "  too few problems to bound how much better another division may be"
    return f"  no division is better by more than {number(regret)} (95 %, from the profiles' bands)"


def decided(program: Program, tables: Sequence[Table], policy: Policy, plan: Plan) -> str:
    """What a plan decides while the program runs, of its first call in numbers, as a line."""
    first = plan.choices[0]
    if first.state or first.within is None:
        return "  decided while it runs: the share of each call, by what came before"
    (call,) = first.calls
    table = next(table for table in tables if table.label == call)
    share = policy.share(program, plan, call, plan.budget, {})
    chances = endings(table.chances[0], transitions(table), share.ends).sum(axis=-1)
    there = share.moments[chances > 1e-3].tolist()
    mean = duration(float(chances @ share.moments))
    return (
        f"  decided while it runs: {call} ends after {duration(there[0])} … "
        f"{duration(there[-1])} ({mean} on average) by what it shows"
    )


def explain(
    name: str,
    tables: Sequence[Table],
    frontier: Frontier,
    seconds: float,
    calibration: Calibration = AS_IT_IS,
    regret: float = 1.0,
    objective: Objective = EXPECTED,
) -> Explanation:
    """The division of a budget with the price of a little more time for each call.

    The price is V(budget, with `step` seconds given to this call alone, re-divided) − V(budget):
    at a fixed division a ladder of results has no meaningful price. Raises AnytimeError below the
    least budget.
    """
    shares = shares_at(tables, frontier, seconds)
    if shares is None:
        raise AnytimeError(
            f"{duration(seconds)} is below the least budget of {name!r}, "
            f"{duration(float(frontier.budgets[0]))}"
        )
    promised = frontier.promise(seconds)
    step = 0.05 * seconds
    budgets = np.geomspace(frontier.budgets[0] or 1e-9, frontier.budgets[-1] or 1e-9, COLUMNS)
    every = [shares_at(tables, frontier, float(budget)) or shares for budget in budgets]
    over = np.array([[known[label] for label in shares] for known in every])
    over = over / np.maximum(over.sum(axis=1, keepdims=True), 1e-300)
    prices: list[Price] = []
    for place, table in enumerate(tables):
        if table.rule is not None:
            continue
        again = divide([*tables[:place], table.ahead(step), *tables[place + 1 :]], objective)
        # The division that is promised now still fits, so that the promise cannot be lower.
        gain = max(calibration.promise(again.promise(seconds)) - promised, 0.0)
        rate = gain / step if step > 0 else 0.0
        course = tuple(over[:, len(prices)].tolist())
        prices.append(Price(table.label, shares[table.label], gain, rate, course))
    return Explanation(
        name,
        seconds,
        promised,
        tuple(prices),
        step,
        frontier.promise(0.9 * seconds),
        frontier.promise(1.1 * seconds),
        calibration.interval(promised),
        regret,
        tuple(budgets.tolist()),
    )


def shares_at(
    tables: Sequence[Table], frontier: Frontier, seconds: float
) -> dict[str, float] | None:
    """Seconds of each call for a budget, with what is left of it; None below the least."""
    index = frontier.index(seconds)
    if index < 0:
        return None
    return dict(stretched(tables, frontier.shares[index].tolist(), seconds))
