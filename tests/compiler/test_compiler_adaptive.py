"""Adaptive schedules and objectives: worth what they say, by what was seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
import compiler
from anytime import AnytimeError, Machine, WorkClock
from compiler.adaptive import plan_for
from compiler.blocks import alone, blocks
from compiler.division import divide, moments_within, value_of
from compiler.objectives import Objective
from experiments.benchmarks.compiler_adaptive import chain, gated, live
from experiments.benchmarks.compiler_constructs import random_tables, read, sketch

MACHINE = Machine("m").with_rate("look", 0.01).with_rate("think", 0.01).with_rate("act", 0.01)


@dataclass(frozen=True)
class Scene:
    luck: float
    name: str


SCENES = [Scene(index / 9, f"scene {index}") for index in range(10)]


def clock() -> WorkClock:
    return WorkClock(MACHINE)


def same(quality, scene=None):
    return quality


@anytime.module(quality=same, estimate=same)
def look(luck):
    """A good view comes with the second step, or for the unlucky with the eighth."""
    for step in range(1, 9):
        yield 0.9 if step >= (8 if luck < 0.5 else 2) else 0.2


@anytime.module(quality=same, estimate=same)
def think(seen):
    """Of what was seen well a thought is made at once, of a poor view in four steps."""
    for step in range(1, 5):
        yield 0.9 if seen > 0.5 else 0.85 if step == 4 else 0.1


@anytime.module(quality=same)
def act(plan):
    for step in range(1, 5):
        yield plan * step / 4


@compiler.program
def chance(luck):
    return act(think(look(luck)))


@pytest.fixture(scope="module")
def library():
    return anytime.measure(chance, SCENES, seconds=1.0, clock=clock)


@pytest.fixture(scope="module")
def adaptive(library):
    return compiler.compile(chance, library, adaptive=True)


# What it is worth


@settings(max_examples=15)
@given(st.integers(0, 2**32), st.sampled_from(["branch", "loop", "choose", "tests", "parallel"]))
def test_a_policy_is_never_worth_less_than_the_best_division(seed, kind):
    rng = np.random.default_rng(seed)
    program = read(sketch(kind, rng))
    tables = random_tables(program, rng)
    frontier = divide(tables)
    if not len(frontier.budgets):
        return  # there is never a result
    decided = alone(tables) | blocks(program, tables, frontier)
    for budget in (6.0, 10.0, 20.0):  # whole ticks, as the times of the tables are
        plan = plan_for(program, tables, budget, compiler.expected(), None, decided)
        assert plan.value >= frontier.promise(budget) - 1e-9


def test_where_nothing_is_left_to_chance_there_is_nothing_to_adapt_to():
    rng = np.random.default_rng(5)
    for _ in range(20):
        program = read(sketch("choose", rng))
        tables = random_tables(program, rng)
        plan = plan_for(program, tables, 12.0, compiler.expected())
        assert plan.value == pytest.approx(divide(tables).promise(12.0))


@pytest.mark.parametrize("cost", [0.0, 0.004])
def test_a_policy_that_is_lived_is_worth_what_it_says(cost):
    rng = np.random.default_rng(3)
    program = chain()
    tables = gated(program, 0.4, rng)
    objective = compiler.expected(lambda quality, steps: quality - cost * steps)
    plan = plan_for(program, tables, 60.0, objective)
    lived, error = live(program, tables, plan, objective, rng)
    assert lived == pytest.approx(plan.value, abs=4 * error)


# Alternatives and parallels


@anytime.module(quality=same, estimate=same)
def glance(luck):
    """Good at once, or for the unlucky with the sixth step."""
    for step in range(1, 7):
        yield 0.9 if luck >= 0.5 or step == 6 else 0.2


@anytime.module(quality=same, estimate=same)
def glance_back(luck):
    """Good where a glance is not, and half of the time where it is."""
    for step in range(1, 7):
        yield 0.9 if luck < 0.75 or step == 6 else 0.2


@anytime.module(quality=same, estimate=same)
def watch(luck):
    """Good in five steps, whatever the luck."""
    for step in range(1, 6):
        yield 0.85 if step == 5 else 0.1


@anytime.module(quality=same, estimate=same)
def move(plan):
    for step in range(1, 11):
        yield plan * step / 10


@anytime.module(quality=same, estimate=same)
def move_back(plan):
    for step in range(1, 11):
        yield plan * step / 10


@compiler.program
def either(luck):
    """Whether to watch too is seen when the glance is there."""
    return move(compiler.choose(glance(luck), watch(luck)))


@compiler.program
def at_once(luck):
    """Which of two results is worth going on with is seen when both are there."""
    ahead, behind = compiler.parallel(glance(luck), glance_back(luck))
    return compiler.choose(move(ahead), move_back(behind))


@pytest.mark.parametrize("program", [either, at_once])
def test_what_is_run_of_alternatives_is_decided_by_what_came_before(program):
    machine = MACHINE
    for call in program.calls:
        machine = machine.with_rate(call.module.name, 0.01)
    library = anytime.measure(program, SCENES, seconds=1.0, clock=lambda: WorkClock(machine))
    both = [compiler.compile(program, library, adaptive=a) for a in (False, True)]
    budgets = np.linspace(both[0].least, float(both[0].frontier.budgets[-1]), 12)
    gains = [both[1].promise(t) - both[0].promise(t) for t in budgets]
    seconds = float(budgets[int(np.argmax(gains))])
    assert max(gains) > 0.03
    lived = [
        [each.run(seconds, clock=WorkClock(machine), luck=scene.luck) for scene in SCENES]
        for each in both
    ]
    static, wise = (np.mean([result.value or 0.0 for result in results]) for results in lived)
    assert wise > static + 0.03
    ways = {tuple((n, p.elapsed) for n, p in result.parts.items()) for result in lived[1]}
    assert len(ways) > 1
    assert max(result.elapsed for result in lived[1]) <= seconds + 1e-9


# Run


def test_it_promises_at_least_what_a_division_does(adaptive, library):
    static = compiler.compile(chance, library)
    budgets = np.linspace(static.least, 0.3, 30)
    assert all(adaptive.promise(t) >= static.promise(t) - 1e-9 for t in budgets)
    assert any(adaptive.promise(t) > static.promise(t) + 0.01 for t in budgets)


def test_a_poor_result_gets_another_share_than_a_good_one(adaptive, library):
    static = compiler.compile(chance, library)
    budgets = np.linspace(static.least, 0.17, 30)
    gain = [adaptive.promise(t) - static.promise(t) for t in budgets]
    seconds = float(budgets[int(np.argmax(gain))])
    shares = set()
    for scene in SCENES:
        result = adaptive.run(seconds, clock=clock(), luck=scene.luck)
        shares.add(tuple(round(part.elapsed, 4) for part in result.parts.values()))
        assert result.elapsed <= seconds + 1e-9
    assert len(shares) > 1


def test_what_is_loaded_decides_the_same(adaptive, tmp_path):
    adaptive.save(tmp_path / "a.schedule")
    again = compiler.load(tmp_path / "a.schedule", modules=[look, think, act])
    for seconds in (0.05, 0.11, 0.16):
        assert again.promise(seconds) == adaptive.promise(seconds)
        one, other = (s.run(seconds, clock=clock(), luck=0.1) for s in (again, adaptive))
        assert repr(one) == repr(other)


# Objectives


def test_objectives_are_values_of_distributions():
    levels = np.array([0.0, 0.2, 0.6, 1.0])
    chances = np.array([0.1, 0.2, 0.3, 0.4])
    seconds = np.asarray(1.0)

    def value(objective: Objective) -> float:
        return float(objective.value(chances, levels, seconds))

    assert value(compiler.expected()) == pytest.approx(0.62)
    assert value(compiler.expected(lambda q, t: q**2 - t)) == pytest.approx(0.516 - 1)
    assert value(compiler.at_least(0.6)) == pytest.approx(0.7)
    assert value(compiler.quantile(0.1)) == 0.0
    assert value(compiler.quantile(0.3)) == 0.2
    assert value(compiler.quantile(1.0)) == 1.0
    assert value(compiler.cvar(0.3)) == pytest.approx(0.2 * 0.2 / 0.3)
    assert value(compiler.cvar(1.0)) == pytest.approx(0.62)


@pytest.mark.parametrize(
    "objective", [compiler.at_least(0.5), compiler.quantile(0.2), compiler.cvar(0.3)]
)
def test_each_objective_divides_best_for_itself(library, objective, tmp_path):
    own = compiler.compile(chance, library, objective=objective)
    usual = compiler.compile(chance, library)
    for seconds in np.linspace(own.least, 0.17, 8):
        shares = list(usual.allocate(seconds).shares.values()) if seconds >= usual.least else None
        if shares is None:
            continue
        moments = moments_within(usual.tables, shares)
        assert own.promise(seconds) >= value_of(usual.tables, moments, objective) - 1e-9
    own.save(tmp_path / "a.schedule")
    again = compiler.load(tmp_path / "a.schedule", modules=[look, think, act])
    assert again.objective == objective


def test_the_expected_quality_is_the_default_however_it_is_said(library):
    said = compiler.compile(chance, library, objective=compiler.expected())
    usual = compiler.compile(chance, library)
    assert [said.promise(t) for t in (0.05, 0.1)] == [usual.promise(t) for t in (0.05, 0.1)]


def test_with_a_cost_of_time_a_program_ends_early(library):
    costly = compiler.compile(chance, library, objective=compiler.expected(lambda q, t: q - 3 * t))
    result = costly.run(5.0, clock=clock(), luck=0.9)
    assert 0 < result.elapsed < 0.2
    assert all(price.gain < 0.05 for price in costly.explain(0.2).prices)  # in utility
    with pytest.raises(AnytimeError, match="compiled for a utility, a function"):
        costly.save("nowhere.schedule")


# Refused


def test_what_cannot_be_adapted_is_refused(library):
    @anytime.module(quality=same, name="think")
    def blind(seen):
        yield seen

    @compiler.program
    def unseen(luck):
        return act(blind(look(luck)))

    with pytest.raises(AnytimeError, match=r"looks at what think achieved; give think an estimate"):
        compiler.compile(unseen, library, adaptive=True)
    with pytest.raises(AnytimeError, match="is no mean"):
        compiler.compile(chance, library, adaptive=True, objective=compiler.cvar(0.1))


@pytest.mark.parametrize("make", [compiler.at_least, compiler.quantile, compiler.cvar])
@pytest.mark.parametrize("value", [0.0, 1.5, float("nan")])
def test_parameters_of_objectives_lie_in_their_range(make, value):
    with pytest.raises(AnytimeError, match=r"give a number in \(0, 1\]"):
        make(value)


def test_a_utility_takes_arrays(library):
    objective = compiler.expected(lambda q, t: max(0.0, q - t))
    with pytest.raises(AnytimeError, match="write it with numpy"):
        compiler.compile(chance, library, objective=objective)
