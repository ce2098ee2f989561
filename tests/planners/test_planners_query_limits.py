"""Optimisation queries at their limits: long plans, many sources, what is impossible, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

from anytime import AnytimeError
from planners import query
from planners.query import Query, choosing, native


@query.model
def long(rng):
    total = 0.0
    while rng.flip("more", 0.5):
        total += rng.gaussian("leg")
    return abs(total - 3.0)


@query.model
def seventeen(rng):
    total = rng.gaussian("a") + rng.gaussian("b") + rng.gaussian("c") + rng.gaussian("d")
    total += rng.gaussian("e") + rng.gaussian("f") + rng.gaussian("g") + rng.gaussian("h")
    total += rng.gaussian("i") + rng.gaussian("j") + rng.gaussian("k") + rng.gaussian("l")
    total += rng.gaussian("m") + rng.gaussian("n") + rng.gaussian("o") + rng.gaussian("p")
    return abs(total + rng.gaussian("q") - 4.0)


@query.model
def beyond(rng, w):
    return w.a[rng.randint("i", 50)]


@query.model
def way_out(rng, w):
    door = rng.randint("door", 4)
    return 0.0 if w.open and w.free[door] else 1.0


@query.model
def careless(rng, w):
    w.a[0] += rng.gaussian("x")
    return w.a[0]


@query.model
def aliased(rng, w):
    a = w.a
    a[0] += rng.gaussian("x")
    return a[0]


@query.model
def visited(rng, w):
    for row in w.grid:
        row[0] += rng.gaussian("x")
    return w.grid[0, 0]


def _change(numbers, by):
    numbers[0] += by


@query.model
def lent(rng, w):
    _change(w.a, rng.gaussian("x"))
    return w.a[0]


@query.model
def grown(rng, w):
    a = w.a
    a += rng.gaussian("x")
    return a[0]


@query.model
def careful(rng, w):
    a = w.a.copy()
    a[0] += rng.gaussian("x")
    return a[0]


@query.model
def sure(rng):
    count = 0.0
    for _ in range(5):
        if rng.flip("never", 0.0):
            count += 1.0
        if not rng.flip("always", 1.0):
            count += 1.0
    return -count


@query.model
def guarded(rng):
    x = rng.uniform("x", 0.0, 10.0)
    if 7.0 < x < 7.0001:
        raise ValueError("off the table")
    return x


@query.model
def huge(rng):
    return float(rng.randint("i", 4294967297))


@query.model
def narrow(rng, w):
    return rng.gaussian("g", 0.0, w.sigma)


@query.model
def endless(rng, w):
    return rng.uniform("u", 0.0, w.most)


def legs(count):
    chosen = {("more", place): True for place in range(count)} | {("more", count): False}
    return chosen | {("leg", place): 1.0 for place in range(count)}


@pytest.mark.parametrize("count", [10, 60, 500])
@pytest.mark.parametrize("is_native", [False, True])
def test_a_plan_has_its_value_however_long_it_is(count, is_native):
    searched = Query(long, seed=1, native=is_native)
    searched.step(3)
    assert searched.value_of(legs(count)) == long.replay(legs(count))


def test_a_plan_beyond_every_table_is_worth_nothing():
    searched = Query(long, seed=1)
    searched.step()
    assert searched.value_of(legs(5000)) == math.inf


def test_a_long_plan_that_is_suggested_is_taken_up():
    searched = Query(long, seed=1)
    searched.step(3)
    perfect = legs(60) | {("leg", place): 0.05 for place in range(60)}
    searched.suggest(perfect)
    assert searched.value == pytest.approx(0.0, abs=1e-9)
    assert dict(searched.best.choices) == perfect


def test_what_is_not_given_is_drawn_and_not_kept_from_before():
    searched = Query(long, seed=1)
    searched.step(2)
    before = searched.value_of({})
    searched.value_of({("more", 0): True, ("leg", 0): 123.0, ("more", 1): False})
    assert searched.value_of({}) == before


@pytest.mark.parametrize("is_native", [False, True])
def test_a_model_may_have_any_number_of_sources(is_native):
    searched = Query(seventeen, seed=1, native=is_native)
    searched.step(5)
    assert seventeen.replay(searched.best.choices) == searched.value


def test_an_index_beyond_an_array_of_the_world_is_an_error():
    with pytest.raises(IndexError):
        Query(beyond, {"a": np.array([1.0, 2.0, 3.0])}, seed=1).step(6)


@pytest.mark.parametrize("is_native", [False, True])
def test_a_world_may_hold_flags_alone_and_in_arrays(is_native):
    world = {"open": True, "free": np.array([False, False, True, False])}
    searched = Query(way_out, world, seed=1, native=is_native)
    searched.step(5)
    assert searched.value == 0.0
    searched.world["free"] = np.array([False, True, False, False])
    searched.step(5)
    assert dict(searched.best.choices) == {("door", 0): 1}


def test_a_model_changes_no_world():
    world = {"a": np.array([1.0, 2.0, 3.0]), "grid": np.eye(3)}
    for changing in (careless, aliased, visited, lent, grown):
        with pytest.raises(AnytimeError, match=r"as those of the world are, .*begin with a copy"):
            Query(changing, world, seed=1)
        with pytest.raises(ValueError, match="read-only"):
            Query(changing, world, seed=1, native=False).step()
    searched = Query(careful, world, seed=1)
    searched.step(5)
    assert searched.world["a"][0] == 1.0
    assert careful.replay(searched.best.choices, world) == searched.value


def test_what_is_impossible_is_never_chosen():
    searched = Query(sure, seed=1)
    searched.step(30)
    assert searched.value == 0.0


def test_a_model_that_raises_leaves_constraints_in_force():
    searched = Query(guarded, seed=1)
    searched.step(3)
    searched.constrain({("x", 0): 4.0})
    searched.step(2)
    with pytest.raises(ValueError, match="off the table"):
        searched.value_of({("x", 0): 7.00005})
    searched.step(3)
    assert searched.best.choices["x", 0] == 4.0


def test_what_is_suggested_keeps_to_the_constraints():
    searched = Query(long, seed=1)
    searched.step(3)
    searched.constrain({("more", 0): False})
    searched.step(2)
    searched.suggest({("more", 0): True, ("leg", 0): 3.0, ("more", 1): False})
    assert searched.best.choices["more", 0] is False


@pytest.mark.parametrize(
    ("model", "world", "says"),
    [
        (huge, None, r"n from 1 to 2\*\*32"),
        (narrow, {"sigma": -1.0}, "sigma < 0"),
        (narrow, {"sigma": math.nan}, "sigma < 0"),
        (endless, {"most": math.inf}, "without end"),
    ],
)
def test_parameters_that_mean_nothing_are_refused(model, world, says):
    with pytest.raises(ValueError, match=says):
        Query(model, world, seed=1).step()


@pytest.mark.parametrize(
    "address",
    [("q/1/leg", 0), ("q/leg", 0), ("q/x/leg", 0), ("leg", -1), ("leg", 10**6), ("no", 0)],
)
def test_an_address_that_was_never_asked_for_is_refused(address):
    searched = Query(long, seed=1)
    searched.step()
    for refuse in (searched.constrain, searched.suggest, searched.value_of):
        with pytest.raises(AnytimeError, match="has no choice"):
            refuse({address: 1.0})


def test_a_value_to_reach_is_a_number():
    with pytest.raises(AnytimeError, match="give numbers"):
        Query(long, seed=1).run(until=math.nan)


def test_constants_of_another_shape_or_type_are_other_code():
    ones = np.ones(4)
    marks = {native._bytes(each) for each in (ones, ones.reshape(2, 2), ones.view(np.int64))}
    assert len(marks) == 3


@query.model
def drawn(rng):
    return rng.at("leg", rng.randint("which", 3)).gaussian("x") + rng.uniform("y")


def test_a_model_is_run_alone_as_often_as_one_likes():
    rng, length = query.Rng(7), choosing.RUNAWAY // 3
    rng._sources.memory["length"] = 3 * length
    assert len({drawn(rng) for _ in range(100)}) == 100


@pytest.mark.parametrize("seed", [None, "a", 1.5, math.nan])
def test_a_seed_is_an_integer(seed):
    for begin in (query.Rng, lambda seed: Query(drawn, seed=seed)):
        with pytest.raises(AnytimeError, match="give an integer"):
            begin(seed)


def test_a_seed_may_be_an_integer_of_numpy():
    assert drawn(query.Rng(np.int64(3))) == drawn(query.Rng(3))


@pytest.mark.parametrize(
    "choices",
    [
        {"n": 1.0},
        {(3, 0): 1.0},
        {("leg/99999999999999999999/x", 0): 1.0},
        {("y", 0): "1"},
        {("y", 0): None},
    ],
)
def test_what_is_no_choice_is_refused_and_changes_nothing(choices):
    searched = Query(drawn, seed=1, population=8)
    searched.step()
    searched.constrain({("y", 0): 0.5})
    for ask in (searched.constrain, searched.suggest, searched.value_of):
        with pytest.raises(AnytimeError):
            ask(choices)
    searched.step(3)
    assert searched.best.choices["y", 0] == 0.5


def test_too_few_evaluations_for_a_generation_are_refused_by_name():
    with pytest.raises(AnytimeError, match="the first generation takes"):
        Query(drawn, seed=1).run(evaluations=10)
    with pytest.raises(AnytimeError, match="give an integer"):
        Query(drawn, seed=1).step(2.5)


def test_integers_of_a_world_have_64_bits():
    with pytest.raises(AnytimeError, match="64 bits"):
        Query(way_out, {"open": 2**63, "free": [1, 0, 0, 0]}, seed=1)
