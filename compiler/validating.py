"""Promised against achieved, on problems that the profiles never saw."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import Clock, Deadline, WallClock
from anytime.errors import AnytimeError
from anytime.measuring import measure, problem_keys
from anytime.pictures import clipped, duration, figure, line_chart, number
from anytime.programs import Call, Input, Program, upstream
from anytime.results import Change, Result
from anytime.running import seed_of
from anytime.sampling import scored
from compiler.intervals import mean_interval
from compiler.sufficiency import Finding, Lives, findings

Floats = NDArray[np.float64]
BUDGETS = 6


class Runnable(Protocol):
    """What is validated: a compiled program."""

    @property
    def name(self) -> str: ...
    @property
    def program(self) -> Program: ...
    def promise(self, seconds: float) -> float: ...
    def interval(self, seconds: float) -> tuple[float, float]: ...
    def run(
        self,
        seconds: float | None = None,
        *,
        deadline: Deadline | None = None,
        rng: np.random.Generator | None = None,
        on_result: Callable[[str, Any, Change], None] | None = None,
        **inputs: Any,
    ) -> Result: ...


@dataclass(frozen=True)
class Reliability:
    """One budget: what was promised and what was achieved on average, each with its 95 %
    interval (low, high)."""

    seconds: float
    promised: float
    promised_within: tuple[float, float]
    achieved: float
    achieved_within: tuple[float, float]

    @property
    def holds(self) -> bool:
        """Whether the two intervals have a quality in common."""
        return (
            self.promised_within[0] <= self.achieved_within[1] + 1e-9
            and self.achieved_within[0] <= self.promised_within[1] + 1e-9
        )


@dataclass(frozen=True)
class Validation:
    """A program run on new problems. findings: whether quality is enough to describe the inputs
    of each module that others feed."""

    program: str
    problems: int
    rows: tuple[Reliability, ...]
    findings: tuple[Finding, ...]

    @property
    def error(self) -> float:
        """The greatest difference between promised and achieved quality."""
        return max(abs(row.promised - row.achieved) for row in self.rows)

    @property
    def holds(self) -> bool:
        return all(row.holds for row in self.rows)

    def __repr__(self) -> str:
        kept = sum(row.holds for row in self.rows)
        lines = [
            f"{self.program} on {self.problems} problems never seen: promises hold at {kept} of "
            f"{len(self.rows)} budgets, off by {number(self.error)} at most",
            f"{'budget':>10}  promised  95 %          achieved  95 %          0{' ' * 22}1",
        ]
        for row in self.rows:
            lines.append(
                f"{duration(row.seconds):>10}  {number(row.promised):>8}  "
                f"{_within(row.promised_within):<12}  {number(row.achieved):>8}  "
                f"{_within(row.achieved_within):<12}  {_strip(row)} {'' if row.holds else '✗'}"
            )
        lines.append("  ░ promised 95 %   │ promised   ● achieved")
        lines += [f"  {finding}" for finding in self.findings]
        return "\n".join(clipped(line.rstrip()) for line in lines)

    def _repr_html_(self) -> str:
        """Reliability: achieved over promised, with the interval of what is achieved."""
        promised = [row.promised for row in self.rows]
        series = {
            "achieved": (promised, [row.achieved for row in self.rows]),
            "as promised": ([0.0, 1.0], [0.0, 1.0]),
        }
        low, high = zip(*(row.achieved_within for row in self.rows), strict=True)
        svg = line_chart(
            series,
            bands={"achieved": (promised, low, high)},
            dashed=("as promised",),
            x_label="promised quality",
            y_label="achieved quality",
            title=f"{self.program}: {self.problems} problems never seen",
        )
        return figure(svg, repr(self))


def validate(
    compiled: Runnable,
    problems: Iterable[Any],
    *,
    budgets: Sequence[float],
    clock: Callable[[], Clock] = WallClock,
    seed: int = 0,
) -> Validation:
    """Run a compiled program on problems that its profiles never saw.

    problems: as `anytime.measure` takes them. budgets: seconds. clock: makes the clock of each
    run. What comes after the deadline does not count. For a program with costs the problems are
    measured as well, so that the cheapest result of each is known.
    Raises AnytimeError for less than two problems or one without a needed attribute.
    """
    listed = list(problems)
    lives = lived(compiled, listed, budgets, clock, seed)
    output = np.nan_to_num(lives.qualities[compiled.program.output.label])
    rows = tuple(
        _reliability(compiled, float(budget), values)
        for budget, values in zip(budgets, output, strict=True)
    )
    return Validation(compiled.name, len(listed), rows, findings(compiled.program, lives))


def lived(
    compiled: Runnable,
    listed: Sequence[Any],
    budgets: Sequence[float],
    clock: Callable[[], Clock],
    seed: int,
) -> Lives:
    """What each call achieves at each budget on each problem, as `validate` has it."""
    if len(listed) < 2:
        raise AnytimeError("give two problems at least, which the profiles never saw")
    program = compiled.program
    if not isinstance(program.output, Call):
        raise AnytimeError(
            f"{compiled.name} ends in {program.output!r}; give a program that ends in a "
            "call, whose module can score the result"
        )
    for place, problem in enumerate(listed):
        missing = [name for name in program.inputs if not hasattr(problem, name)]
        if missing:
            raise AnytimeError(
                f"problems[{place}] has no .{missing[0]}; the inputs of {compiled.name} are "
                f"{', '.join(program.inputs)}"
            )
    shape = (len(budgets), len(listed))
    raw = {call.label: np.full(shape, np.nan) for call in program.calls}
    spent = {call.label: np.full(shape, np.nan) for call in program.calls}
    known: dict[str, list[dict[str, float]]] = {call.label: [] for call in program.calls}
    cheapest = _cheapest(program, listed, float(max(budgets)), clock, seed)
    for column, problem in enumerate(listed):
        for row, budget in enumerate(budgets):
            values, parts = in_time(compiled, problem, float(budget), clock, seed_of(seed, column))
            for call in program.calls:
                if call.label in values:
                    value = values[call.label]
                    raw[call.label][row, column] = scored(call.module, value, problem, str(column))
                    spent[call.label][row, column] = parts[call.label].elapsed
            if row == len(budgets) - 1:  # the best inputs that there are
                for call in program.calls:
                    known[call.label].append(_features(call, problem, values))
    qualities = {
        call.label: _qualities(raw[call.label], cheapest.get(call.module.name))
        for call in program.calls
    }
    return Lives(qualities, spent, known, _attributes(listed))


def in_time(
    compiled: Runnable, problem: Any, budget: float, clock: Callable[[], Clock], seed: int = 0
) -> tuple[dict[str, Any], Mapping[str, Result]]:
    """Run a program on a problem: the last result of each call before the deadline, by label, and
    the parts of the result."""
    deadline = Deadline.after(budget, clock())
    values: dict[str, Any] = {}

    def keep(label: str, value: Any, change: Change) -> None:
        if label != compiled.program.output.label or deadline.remaining() >= -1e-9:
            values[label] = value

    inputs = {name: getattr(problem, name) for name in compiled.program.inputs}
    rng = np.random.default_rng(seed)
    return values, compiled.run(deadline=deadline, rng=rng, on_result=keep, **inputs).parts


def _reliability(compiled: Runnable, budget: float, values: Floats) -> Reliability:
    low, high = mean_interval(values[:, None])
    return Reliability(
        budget,
        compiled.promise(budget),
        compiled.interval(budget),
        float(values.mean()),
        (float(low[0]), float(high[0])),
    )


def _cheapest(
    program: Program,
    problems: Sequence[Any],
    seconds: float,
    clock: Callable[[], Clock],
    seed: int,
) -> dict[str, Floats]:
    """The cheapest known result of each module with a cost, [problems], found with the effort that
    measuring took: else qualities here would not be those that were promised."""
    if all(call.module.cost is None for call in program.calls):
        return {}
    library = measure(program, problems, seconds=seconds, clock=clock, seed=seed)
    keys = problem_keys(program, problems)
    return {
        name: np.array([profile.references[key] for key in keys])
        for name, profile in library.items()
        if profile.references
    }


def _qualities(raw: Floats, cheapest: Floats | None) -> Floats:
    """Qualities [budgets, problems] of scores; NaN where there is no result."""
    if cheapest is None:
        return raw
    least = np.fmin(cheapest, np.fmin.reduce(raw, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.isnan(raw), np.nan, np.where(raw > 0, least / raw, 1.0))


def _features(call: Call, problem: Any, values: Mapping[str, Any]) -> dict[str, float]:
    """The features of a call's inputs, by name; none where an input did not arrive."""
    feeds = [source.label for source in upstream(call).values()]
    if call.module.features is None or any(label not in values for label in feeds):
        return {}
    arguments = [
        getattr(problem, a.name)
        if isinstance(a, Input)
        else values[a.label]
        if isinstance(a, Call)
        else a.value
        for a in call.arguments
    ]
    return {name: float(value) for name, value in call.module.features(*arguments).items()}


def _attributes(problems: Sequence[Any]) -> dict[str, Floats]:
    """Every number that all problems have as an attribute, by name, [problems]."""
    found: dict[str, Floats] = {}
    for name in dir(problems[0]):
        if name.startswith("_"):
            continue
        values = [getattr(problem, name, None) for problem in problems]
        if all(isinstance(value, int | float | np.number) for value in values):
            found[name] = np.array(values, dtype=float)
    return found


def _within(ends: tuple[float, float]) -> str:
    return f"[{number(ends[0])}, {number(ends[1])}]"


def _strip(row: Reliability, width: int = 24) -> str:
    """The row on a line from 0 to 1."""

    def place(quality: float) -> int:
        return min(int(quality * width), width - 1)

    marks = [" "] * width
    low, high = row.promised_within
    for at in range(place(low), place(high) + 1):
        marks[at] = "░"
    marks[place(row.promised)] = "│"
    marks[place(row.achieved)] = "●"
    return "".join(marks)
