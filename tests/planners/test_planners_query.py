"""Optimisation queries: the same text plain and native, and what a search promises."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError, Machine, WorkClock
from planners import query
from planners.nao_plan import actions_of, plan, plan_world, trajectory
from planners.query import Operators, Query, Rng


@query.model
def five(rng):
    """[PRP16] §2: the sum of any number of normal variables, as near to 5 as can be."""
    total = 0.0
    while rng.flip("A"):
        total += rng.gaussian("B", 0, 1)
    return abs(total - 5.0)


@query.model
def everything(rng, w):
    """Each distribution, with parameters that change from run to run, below paths and at the root.

    A print does no harm natively.
    """
    total, n = 0.0, 1 + rng.randint("n", 6)
    for i in range(n):
        here = rng.at("part", i)
        total += here.gaussian("g", w.mean, 1.0 + i) + here.at("sub", 2).uniform(
            "u", -1.0, abs(total)
        )
        if here.flip("f", 0.3):
            total -= rng.exponential("e", 1.0 + n)
        total += rng.lognormal("l", 0.0, 0.5)
        total += (1.0, 2.0, 3.0)[rng.categorical("c", (1.0, 0.0, 2.0))] * w.table[i % 3, 1]
    print("total", total)
    return abs(total - w.goal)


EVERYTHING = {"mean": 0.5, "goal": 12.0, "table": np.arange(6.0).reshape(3, 2)}
SITTING = plan_world((1.0, 0.0), obstacles=[(0.5, 0.0, 0.2)])


def fingerprint(searched: Query) -> tuple[float, dict, int]:
    return searched.best.value, dict(searched.best.choices), searched.evaluations


@pytest.mark.parametrize(
    ("model", "world"), [(five, None), (everything, EVERYTHING), (plan, SITTING)]
)
def test_the_plain_form_and_the_native_form_agree_bit_for_bit(model, world, capsys):
    for seed in range(12):
        searches = [Query(model, world, seed=seed, native=native) for native in (True, False)]
        for searched in searches:
            searched.step(6)
        assert fingerprint(searches[0]) == fingerprint(searches[1])
        memories = [searched._memory.blocks for searched in searches]
        assert np.array_equal(memories[0]["values"], memories[1]["values"])
        assert np.array_equal(memories[0]["genomes"], memories[1]["genomes"], equal_nan=True)


def test_the_papers_program_reaches_its_optimum():
    found = Query(five, seed=1).run(evaluations=100_000, until=1e-6)
    assert found.value <= 1e-6
    assert abs(sum(found.choices.of("B")) - 5) == found.value


@pytest.mark.parametrize("operators", [Operators(), Operators.paper(), Operators(islands=4)])
def test_the_best_of_an_unchanged_world_never_gets_worse(operators):
    searched = Query(plan, SITTING, seed=3, operators=operators)
    values = []
    for _ in range(60):
        searched.step()
        values.append(searched.value)
    assert values == sorted(values, reverse=True)


@given(seed=st.integers(0, 2**70))
@settings(max_examples=20)
def test_a_replay_gives_the_value_of_the_best_and_so_does_value_of(seed):
    searched = Query(everything, EVERYTHING, seed=seed)
    searched.step(5)
    best = searched.best
    assert everything.replay(best.choices, EVERYTHING) == best.value
    assert searched.value_of(best.choices) == best.value


def test_equal_seeds_give_equal_searches_and_other_seeds_others():
    def run(seed: int) -> tuple:
        searched = Query(plan, SITTING, seed=seed)
        searched.step(10)
        return fingerprint(searched)

    assert run(4) == run(4)
    assert run(4) != run(5)


def test_value_of_does_not_disturb_the_search():
    one, two = Query(plan, SITTING, seed=2), Query(plan, SITTING, seed=2)
    for _ in range(10):
        one.step()
        two.step()
        two.value_of(two.best.choices)
    assert fingerprint(one) == fingerprint(two)


def test_a_changed_world_is_seen_as_a_whole_in_the_next_generation():
    searched = Query(plan, SITTING, seed=1)
    searched.run(evaluations=20_000)
    before = searched.value
    searched.world.update(goal_x=3.0, goal_y=1.0)
    assert searched.value == before
    searched.step()
    assert searched.value > before + 0.5
    searched.run(evaluations=60_000)
    pose = trajectory(actions_of(searched.best.choices), dict(searched.world))[-1]
    assert math.dist((pose.x, pose.y), (3.0, 1.0)) < 0.05


def test_what_is_constrained_stays():
    searched = Query(plan, SITTING, seed=1)
    searched.run(evaluations=10_000)
    executed = searched.best.choices.first(5)
    searched.constrain(executed)
    for _ in range(20):
        searched.step()
        assert searched.best.choices.first(5) == executed
    searched.constrain({})
    searched.step(2)


def test_constraints_hold_below_paths_and_for_choices_not_made_yet():
    searched = Query(everything, EVERYTHING, seed=1)
    searched.constrain({("n", 0): 5, ("part/4/g", 0): 0.25})
    searched.step(3)
    assert searched.best.choices["n", 0] == 5
    assert searched.best.choices["part/4/g", 0] == 0.25
    assert "part/4/sub/2/u" in {source for source, _ in searched.best.choices}
    with pytest.raises(AnytimeError, match="no choice"):
        searched.constrain({("nothing", 0): 1})


@query.model
def shrinking(rng, w):
    n = rng.randint("n", w.most)
    x = rng.uniform("x", 0.0, w.high)
    assert 0 <= n < w.most
    assert 0 <= x <= w.high
    return -n - x


def test_an_inherited_value_out_of_the_range_of_new_parameters_is_redrawn():
    for native in (True, False):
        searched = Query(shrinking, {"most": 1000, "high": 50.0}, seed=1, native=native)
        searched.step(30)
        assert searched.best.choices["n", 0] > 900
        searched.world.update(most=3, high=0.5)
        searched.step(10)
        assert searched.best.choices["n", 0] == 2
        assert searched.best.choices["x", 0] <= 0.5


@query.model
def long(rng):
    n = 0
    while rng.flip("more", 0.99):
        n += 1
        rng.gaussian("x", 0, 1)
    return abs(n - 400.0)


def test_the_tables_grow_with_the_model():
    found = []
    for native in (True, False):
        searched = Query(long, seed=1, native=native)
        searched.step(25)
        found.append(fingerprint(searched))
        assert len(searched.best.choices) > 300
    assert found[0] == found[1]


@query.model
def endless(rng):
    while rng.flip("more", 1.0):
        pass
    return 0.0


def test_an_endless_model_is_given_up_with_one_clear_line():
    with pytest.raises(RuntimeError, match="bound its loop"):
        Query(endless, seed=1, population=4).step(1)


@query.model
def broken(rng):
    return 1.0 / rng.randint("n", 2)


@query.model
def undefined(rng):
    x = rng.gaussian("x")
    return math.inf if x > 0 else math.nan


@pytest.mark.parametrize("native", [True, False])
def test_what_a_model_raises_reaches_the_caller_and_nan_counts_as_infinite(native):
    with pytest.raises(ZeroDivisionError):
        Query(broken, seed=1, native=native).step()
    searched = Query(undefined, seed=1, native=native)
    searched.step(3)
    assert searched.value == math.inf


def test_a_background_search_ends_with_its_block_and_hands_on_what_the_model_raised():
    searched = Query(plan, SITTING, seed=1)
    with searched.background() as running:
        while running.generations < 20:
            running.world["goal_x"] = 1.0
        executed = running.best.choices.first(1)
        running.constrain(executed)
    count = searched.evaluations
    assert searched.best.value < 1.0
    assert searched.evaluations == count
    with pytest.raises(ZeroDivisionError), Query(broken, seed=1).background():
        pass


def test_on_a_work_clock_the_search_gets_its_share_in_whole_generations():
    clock = WorkClock(Machine("m").with_rate("plan", 1e-5))
    searched = Query(plan, SITTING, seed=1)
    with searched.background(clock):
        clock.advance(0.0008)
        assert searched.evaluations == 0
        clock.advance(0.0002)
        assert searched.evaluations == 90
        clock.advance(0.01)
        assert searched.evaluations == 1080
    clock.advance(1.0)
    assert searched.evaluations == 1080
    with pytest.raises(AnytimeError, match="no rate"), searched.background(WorkClock(Machine("n"))):
        pass
    timeless = WorkClock(Machine("n").with_rate("plan", 0.0))
    with pytest.raises(AnytimeError, match="would never end"), searched.background(timeless):
        pass


@pytest.mark.parametrize("name", query.SWITCHES)
def test_each_operator_can_be_switched_off(name):
    searched = Query(plan, SITTING, seed=1, operators=Operators().without(name))
    searched.step(5)
    assert math.isfinite(searched.value)


def test_a_plain_run_needs_no_query():
    assert five(Rng(7)) == five(Rng(7))
    assert everything(Rng(7), EVERYTHING) == everything(Rng(7), EVERYTHING)
    drawn = [Rng(seed).gaussian("x", 2.0, 3.0) for seed in range(2000)]
    assert np.mean(drawn) == pytest.approx(2.0, abs=0.25)
    assert np.std(drawn) == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize(
    ("draw", "mean"),
    [
        (lambda rng: rng.flip("s", 0.3), 0.3),
        (lambda rng: rng.randint("s", 5), 2.0),
        (lambda rng: rng.uniform("s", 2.0, 4.0), 3.0),
        (lambda rng: rng.categorical("s", [1, 0, 3]), 1.5),
        (lambda rng: rng.exponential("s", 0.5), 0.5),
        (lambda rng: rng.lognormal("s", 0.0, 0.5), math.exp(0.125)),
    ],
)
def test_fresh_choices_have_the_mean_of_their_distribution(draw, mean):
    rng = Rng(11)
    values = [draw(rng) for _ in range(20_000)]
    assert np.mean(values) == pytest.approx(mean, rel=0.03)


def test_bad_settings_are_refused_in_one_line():
    for bad in (
        lambda: Query(five, population=2),
        lambda: Query(five, population=10, operators=Operators(islands=4)),
        lambda: Operators(crossover=0.9, line=0.2),
        lambda: Operators(steps=(1.0, 0.1)),
        lambda: Operators().without("luck"),
        lambda: Query(five).run(),
        lambda: Query(five).best,
        lambda: Query(plan, SITTING).world.update(goal_z=1.0),
        lambda: Query(plan, SITTING).world.update(posture=0.5),
        lambda: Query(plan, SITTING).world.update(obstacles=[1.0]),
        lambda: Query(plan, {"x": "north"}),
        lambda: Query(lambda rng: 0.0),
        lambda: query.model(lambda: 0.0),
        lambda: five.replay({}),
    ):
        with pytest.raises(AnytimeError) as error:
            bad()
        assert "\n" not in str(error.value)
