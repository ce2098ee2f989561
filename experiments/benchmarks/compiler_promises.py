"""How true promises are: programs of several families, compiled and run on problems never seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

import anytime
from anytime import Deadline, Machine, WorkClock
from anytime import measure as measure_profiles
from anytime.joins import Known
from anytime.programs import Call, Join, Program
from compiler import CompiledProgram, choose, compile
from compiler import program as read
from compiler.division import expected_quality, moments_within
from experiments.benchmarks.figures import share_interval

PARTS = ("a", "b", "c", "d")
MACHINE = Machine("bench")
for _part in PARTS:
    MACHINE = MACHINE.with_rate(_part, 0.001)


@dataclass(frozen=True)
class Case:
    """A problem: its name and what is hard about it, numbers in [0, 1]."""

    name: str
    traits: tuple[float, ...]

    @property
    def problem(self) -> Case:
        """The only input of every program here."""
        return self


Course = Callable[[tuple[float, ...], int, np.random.Generator], Iterator[tuple[float, float]]]
"""How a stage proceeds on a problem's traits: (work, share of what is possible) of each result."""


def smooth(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """Diminishing returns, slow on some problems."""
    for step in range(1, 25):
        yield 1.0, 1 - math.exp(-step / (1.5 + 6 * traits[place]))


def ladder(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """Three models, each four times as long as the last."""
    for work, error in ((1.0, 0.5), (4.0, 0.25), (16.0, 0.08)):
        yield work, 1 - error * (0.5 + traits[place])


def unlucky(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """Stuck halfway for good on a fifth of the problems."""
    stuck = traits[place] < 0.2
    for step in range(1, 25):
        reached = 1 - math.exp(-step / 4)
        yield 1.0, min(reached, 0.5) if stuck else reached


def hard(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """What is hard for one stage is hard for all of them."""
    for step in range(1, 25):
        yield 1.0, (1 - 0.6 * traits[0]) * (1 - math.exp(-step / (2 + 6 * traits[0])))


def early(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """Late to begin on some problems, complete at once on others."""
    yield 1.0 + math.floor(5 * traits[place]), 0.4
    for step in range(math.ceil(24 * traits[-1 - place] ** 2)):
        yield 1.0, 1 - 0.6 * math.exp(-(step + 1) / 4)
    yield 1.0, 1.0


def noisy(traits: tuple[float, ...], place: int, rng: np.random.Generator):
    """Chance in every run, beside that of the problem."""
    pace = 2 + 4 * traits[place]
    for step in range(1, 25):
        yield 1.0, float(np.clip(1 - math.exp(-step / pace) + rng.normal(0, 0.05), 0, 1))


def product(fed: tuple[float, ...], traits: tuple[float, ...]) -> float:
    return math.prod(fed)


def worst(fed: tuple[float, ...], traits: tuple[float, ...]) -> float:
    return min(fed, default=1.0)


def gate(fed: tuple[float, ...], traits: tuple[float, ...]) -> float:
    """Half as good below what this problem needs."""
    return 1.0 if all(quality >= 0.2 + 0.6 * traits[-1] for quality in fed) else 0.5


def family(shape: str, course: Course, join: Callable[..., float] = product) -> Program:
    """A program of stages with one course: "pair", "chain", "tree", "shared", "either" of two
    alternatives, or "chosen", where another stage goes on with the better of them."""

    def steps(place: int, fed: tuple[float, ...], problem: Case, rng: np.random.Generator):
        possible = join(fed, problem.traits) if fed else 1.0
        for work, share in course(problem.traits, place, rng):
            anytime.charge(work)
            yield possible * share

    def itself(value: float) -> float:
        return value

    estimate = itself if shape in ("either", "chosen") else None

    @anytime.module(quality=itself, estimate=estimate)
    def a(problem, *, rng):
        yield from steps(0, (), problem, rng)

    @anytime.module(quality=itself, name="d" if shape == "tree" else "b")
    def b(x, problem, *, rng):
        yield from steps(1, (x,), problem, rng)

    @anytime.module(quality=itself, estimate=estimate, name="b")
    def other(problem, *, rng):
        yield from steps(1, (), problem, rng)

    @anytime.module(quality=itself, name="c")
    def last(x, problem, *, rng):
        yield from steps(2, (x,), problem, rng)

    @anytime.module(quality=itself, name="c")
    def both(x, y, problem, *, rng):
        yield from steps(2, (x, y), problem, rng)

    shapes: dict[str, Callable[..., object]] = {
        "pair": lambda problem: b(a(problem), problem),
        "chain": lambda problem: last(b(a(problem), problem), problem),
        "tree": lambda problem: both(a(problem), other(problem), problem),
        "either": lambda problem: choose(a(problem), other(problem)),
        "chosen": lambda problem: last(choose(a(problem), other(problem)), problem),
    }

    def shared(problem):
        seen = a(problem)
        return both(seen, b(seen, problem), problem)

    return read({**shapes, "shared": shared}[shape])


FAMILIES: Mapping[str, Callable[[], Program]] = {
    "smooth": lambda: family("pair", smooth),
    "ladder": lambda: family("pair", ladder),
    "unlucky": lambda: family("pair", unlucky, gate),
    "hard": lambda: family("pair", hard),
    "hard chain": lambda: family("chain", hard),
    "early": lambda: family("chain", early),
    "noisy": lambda: family("chain", noisy),
    "tree": lambda: family("tree", smooth, worst),
    "gated tree": lambda: family("tree", ladder, gate),
    "shared": lambda: family("shared", smooth, worst),
    "either": lambda: family("either", hard),
    "chosen": lambda: family("chosen", smooth),
}


def cases(count: int, seed: int) -> list[Case]:
    """Problems drawn afresh; equal seeds give equal problems."""
    drawn = np.random.default_rng(seed).random((count, 6))
    return [Case(f"{seed}/{index}", tuple(row)) for index, row in enumerate(drawn.tolist())]


def compiled_from(program: Program, problems: list[Case], seed: int = 0) -> CompiledProgram:
    library = measure_profiles(
        program, problems, seconds=0.06, clock=lambda: WorkClock(MACHINE), seed=seed
    )
    return compile(program, library, seed=seed)


def achieved(
    compiled: CompiledProgram, problems: list[Case], budget: float, machine: Machine = MACHINE
) -> np.ndarray:
    """Quality in time on each problem, [problems]; 0 for no result."""
    values = np.zeros(len(problems))
    for row, problem in enumerate(problems):
        deadline, made = Deadline.after(budget, WorkClock(machine)), dict[str, Known]()

        def keep(label: str, value: float, change: object, made=made, deadline=deadline) -> None:
            if deadline.remaining() >= -1e-9:
                made[label] = Known(value, value)

        rng = np.random.default_rng(row)
        compiled.run(deadline=deadline, rng=rng, on_result=keep, problem=problem)
        output = _known(compiled.program.output, made)
        values[row] = output.value if output else 0.0
    return values


def _known(node: object, made: Mapping[str, Known]) -> Known | None:
    """What there is of a node, of the results of calls."""
    if isinstance(node, Join):
        return node.rule.value([_known(each, made) for each in node.arguments])
    assert isinstance(node, Call)
    return made.get(node.label)


def budgets_of(compiled: CompiledProgram, count: int) -> np.ndarray:
    return np.geomspace(compiled.least, float(compiled.frontier.budgets[-1]), count)


def measure_promises(
    *, quick: bool, seed: int, progress: Callable[[str], None]
) -> dict[str, float | int | None]:
    """`promise_error`, `promise_coverage`, and how many cells they are over."""
    unseen = cases(400 if quick else 2000, seed + 99)
    errors: dict[str, float] = {}
    covered: list[bool] = []
    by_tables: list[float] = []
    chance: list[float] = []
    for name, made in FAMILIES.items():
        progress(f"promises of the family {name!r} from 300 problems")
        program = made()
        compiled = compiled_from(program, cases(300, seed), seed)
        gaps = []
        for budget in budgets_of(compiled, 6 if quick else 12):
            values = achieved(compiled, unseen, budget)
            reached = float(values.mean())
            gaps.append(abs(compiled.promise(budget) - reached))
            chance.append(1.96 * float(values.std()) * math.sqrt(1 / 300 + 1 / len(unseen)))
            shares = compiled.allocate(budget).shares
            row = [shares.get(table.label, 0.0) for table in compiled.tables]
            level = expected_quality(compiled.tables, moments_within(compiled.tables, row))
            by_tables.append(abs(level - reached))
        errors[name] = max(gaps)
        for draw in range(2 if quick else 8):
            few = compiled_from(program, cases(30, seed + 1000 + draw), seed)
            for budget in budgets_of(few, 4 if quick else 6):
                low, high = few.interval(budget)
                reached = float(achieved(few, unseen[:1000], budget).mean())
                covered.append(low <= reached <= high)
    figures: dict[str, float | int | None] = {"promise_error": max(errors.values())}
    figures |= {f"promise_error_of.{name.replace(' ', '_')}": e for name, e in errors.items()}
    figures["promise_error_of_tables"] = max(by_tables)
    # What 300 problems drawn by chance are off in any case, nineteen times of twenty.
    figures["promise_error_by_chance"] = max(chance)
    figures["promise_cells"] = len(covered)
    return figures | share_interval("promise_coverage", covered)
