"""Programs of modules with knobs: one setting for each budget, the best."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
import compiler
from anytime import Machine, WorkClock
from compiler.division import divide
from compiler.settings import settings_of


@anytime.module(quality=lambda answer: answer[0])
def solve(hardness, *, depth=anytime.knob([1, 2, 4])):
    """Deeper takes longer to a first answer and is better."""
    for step in range(1, 4):
        anytime.charge(depth * depth)
        yield (1 - (0.9 + 0.1 * hardness) ** (depth * step), depth)


@anytime.module(quality=lambda answer, problem: answer[0] * (1 - 0.1 * problem.hardness))
def polish(answer, *, width=anytime.knob([1, 3])):
    anytime.charge(4 * width)
    yield (min(1.0, answer[0] * (1 + 0.2 * width)), width)


@compiler.program
def both(hardness):
    return polish(solve(hardness))


@dataclass(frozen=True)
class Problem:
    hardness: float


def clock():
    return WorkClock(Machine("lab").with_rate("solve", 0.001).with_rate("polish", 0.001))


@pytest.fixture(scope="module")
def schedule():
    problems = [Problem(h) for h in np.linspace(0.0, 0.9, 20)]
    return compiler.compile(both, anytime.measure(both, problems, seconds=1.0, clock=clock))


def settings(shares):
    return [label for label, seconds in shares.items() if seconds > 0]


def test_one_setting_of_each_module_has_time(schedule):
    for row in schedule.frontier.shares:
        shares = dict(zip((t.label for t in schedule.tables), row, strict=True))
        families = [label.partition("@")[0] for label in settings(shares)]
        assert len(families) == len(set(families)) <= 2


def test_no_setting_promises_more_for_any_budget(schedule):
    """Against each way to set the knobs, divided alone."""
    ways = settings_of(schedule.tables)
    assert len(ways) == 6
    every = divide(schedule.tables)
    alone = [divide(tables) for tables in ways]
    for budget in np.geomspace(0.005, 0.1, 30):
        best = max(each.promise(budget) for each in alone)
        assert every.promise(budget) == pytest.approx(best)
    used = {tuple(np.flatnonzero(row)) for row in every.shares}
    assert len(used) > 2  # the best setting depends on the budget


def test_the_setting_that_was_chosen_runs_and_no_other(schedule):
    for budget in (0.015, 0.03, 0.08):
        result = schedule.run(budget, clock=clock(), hardness=0.4)
        chosen = settings(schedule.allocate(budget).shares)
        assert list(result.parts) == chosen
        assert result.value[1] == int(chosen[-1].partition("=")[2])


def test_a_program_with_knobs_is_loaded_with_the_modules_themselves(schedule, tmp_path):
    schedule.save(tmp_path / "both.schedule")
    again = compiler.load(tmp_path / "both.schedule", modules=[solve, polish])
    assert again.allocate(0.05).shares == schedule.allocate(0.05).shares
    assert again.run(0.05, clock=clock(), hardness=0.4).value is not None


@pytest.mark.parametrize("count", [4, 6, 8])
def test_of_many_settings_each_has_its_budget(count):
    qualities = np.linspace(0.4, 0.9, count)

    @anytime.module(quality=lambda value, problem: value, name="many")
    def many(x, *, k=anytime.knob(list(range(count)))):
        anytime.charge(k + 1)
        yield qualities[k] * x

    machine = Machine("m").with_rate("many", 0.01)
    xs = np.random.default_rng(0).uniform(0.7, 1.0, 40)
    library = anytime.measure(
        many, [SimpleNamespace(x=x) for x in xs], seconds=2.0, clock=lambda: WorkClock(machine)
    )
    compiled = compiler.compile(many, library)
    for k, quality in enumerate(qualities):
        budget = 0.01 * (k + 1) + 0.001
        assert compiled.promise(budget) == pytest.approx(quality * xs.mean(), abs=0.02)
