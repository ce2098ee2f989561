"""Campaigns end when no other division can be much better, and not before."""

import functools
import itertools
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
import compiler
from anytime import AnytimeError, Machine, WorkClock
from anytime.programs import program_of
from compiler.enough import EQUAL, UntilRegret, equal_ticks

CLOCK = functools.partial(WorkClock, Machine("test").with_rate("look", 0.1).with_rate("think", 0.1))


@anytime.module(quality=lambda value: value)
def look(hard):
    if hard < 0:
        raise ValueError("no such place")
    for step in range(1, 6):
        anytime.charge(1)
        yield 1 - 0.6**step * (0.5 + hard)


@anytime.module(quality=lambda value: value)
def think(seen, hard):
    for step in range(1, 6):
        anytime.charge(1)
        yield seen * (1 - 0.5**step * (0.5 + hard))


@compiler.program
def both(hard):
    return think(look(hard), hard)


def problems(rng):
    for number in itertools.count():
        yield SimpleNamespace(name=f"p{number}", hard=float(0.4 * rng.beta(2, 2)))


def some(count):
    return list(itertools.islice(problems(np.random.default_rng(0)), count))


def test_a_campaign_ends_when_its_bound_is_small_enough_and_not_before():
    seen = []
    rule = UntilRegret(both, 0.8, 1.0)

    def until(library):
        seen.append((rule(library), rule.bound))
        return seen[-1][0]

    library = anytime.measure(both, some(1000), seconds=1.0, clock=CLOCK, until=until)
    assert [enough for enough, _ in seen] == [False] * (len(seen) - 1) + [True]
    assert all((bound <= 0.8) == enough for enough, bound in seen)
    assert len(library["look"].problems) == rule.problems < 100
    assert rule.left == 0
    assert "no division is better by more than" in repr(rule)


def test_problems_count_in_their_order_and_those_that_fail_do_not():
    listed = some(60)
    listed[3].hard = -1.0
    asked = []
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        library = anytime.measure(
            both,
            listed,
            seconds=1.0,
            clock=CLOCK,
            until=lambda library: asked.append(library["look"].problems) or len(asked) == 2,
        )
    assert ["p3 is left out" in str(each.message) for each in told] == [True]
    expected = [f"p{number}" for number in range(26) if number != 3]
    assert [len(each) for each in asked] == [20, 25]
    assert set(library["look"].problems) == set(asked[-1]) == set(expected)


@pytest.mark.parametrize("calls", [2, 3, 4, 7])
def test_equal_ticks_are_different_divisions_of_a_whole(calls):
    shares = equal_ticks(calls)
    assert np.allclose(shares.sum(axis=1), 1.0)
    assert shares.min() >= 0
    assert len(np.unique(shares, axis=0)) == len(shares) <= EQUAL


def test_what_has_nothing_to_divide_has_no_regret():
    with pytest.raises(AnytimeError, match="'look' has no time to divide"):
        UntilRegret(program_of(look), 0.1, 1.0)
    with pytest.raises(AnytimeError, match=r"regret of 2; give .* in \(0, 1\)"):
        UntilRegret(both, 2.0, 1.0)


def test_the_command_says_how_much_is_left(tmp_path, capsys):
    import json

    from anytime.__main__ import main

    asked = ("profile", f"{__file__}:both", "--problems", f"{__file__}:problems", "--json")
    asked = (*asked, "--library", str(tmp_path / "kept"), "--seconds", "0.02")
    assert main([*asked, "--until-regret", "0.2", "--runs", "20"]) == 1
    told = capsys.readouterr()
    assert "20 problems: no division is better by more than" in told.err
    assert json.loads(told.out)["left"] > 0
    assert main([*asked, "--until-regret", "3"]) == 2
