"""Policies over time and quality, for contracts whose luck is new each time."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import anytime
from anytime import Machine, WorkClock
from compiler.deadlines import survival_of
from compiler.retrying import CELLS, retrying


@anytime.module(quality=lambda found: found, estimate=lambda found: found)
def toss(side, *, seconds, rng):
    """Four lengths are of use: 1, 2, 4 and 8 s, each likelier to find something than the last."""
    anytime.charge(seconds)
    return 1.0 if rng.random() < seconds / 10 else None


class Coin:
    side = 0


@pytest.fixture(scope="module")
def profile():
    machine = Machine("m").with_rate("toss", 1.0)
    coins = [Coin() for _ in range(400)]
    return anytime.measure(toss, coins, seconds=8.0, clock=lambda: WorkClock(machine))["toss"]


def test_it_is_the_best_of_all_policies(profile):
    """One quality alone: a policy is a sequence that ends with the first success."""
    survival = survival_of([8.5])  # a certain interruption, so that the cells of time do not matter
    policy, _ = retrying(toss, profile, survival)
    chances = {length: profile.at(length).at_least(1.0) for length in policy.lengths}

    def worth(sequence):
        failed = 1.0
        for length in sequence:
            failed *= 1 - chances[length]
        return 1 - failed

    short = [length for length in policy.lengths if length >= 0.5]
    every = [
        sequence
        for count in range(1, 9)
        for sequence in itertools.combinations_with_replacement(short, count)
        if sum(sequence) <= 8.5
    ]
    elapsed, chosen = 0.0, []
    while (length := policy.following(elapsed, None)) is not None and elapsed + length <= 8.5:
        chosen.append(length)
        elapsed += length
    assert worth(chosen) >= max(map(worth, every)) - 0.02


def test_once_it_has_the_best_it_stops(profile):
    policy, _ = retrying(toss, profile, survival_of(stats.expon(scale=5.0)))
    assert policy.following(0.0, None) is not None
    assert policy.following(1.0, 1.0) is None


def test_after_its_table_it_stops(policy):
    assert policy.following(policy.cell * (CELLS + 1), None) is None


@pytest.fixture(scope="module")
def policy(profile):
    return retrying(toss, profile, survival_of(stats.uniform(0, 20)))[0]


@given(elapsed=st.floats(0, 100), quality=st.one_of(st.none(), st.floats(0, 1)))
def test_what_it_chooses_is_one_of_its_lengths(policy, elapsed, quality):
    chosen = policy.following(elapsed, quality)
    assert chosen is None or chosen in policy.lengths


def test_the_simulated_profile_promises_what_independent_tosses_bring(profile):
    when = stats.uniform(0, 20)
    policy, simulated = retrying(toss, profile, survival_of(when))
    rng = np.random.default_rng(1)
    ends = when.ppf((np.arange(400) + 0.5) / 400)
    found = []
    for end in ends:
        elapsed, value = 0.0, None
        while (length := policy.following(elapsed, value)) is not None and elapsed + length <= end:
            elapsed += length
            value = 1.0 if rng.random() < length / 10 else value
        found.append(value or 0.0)
    promised = np.mean([simulated.mean(end)[0] for end in ends])
    assert np.mean(found) == pytest.approx(promised, abs=0.08)


def test_one_problem_is_enough_to_begin_with():
    machine = Machine("m").with_rate("toss", 1.0)
    library = anytime.measure(
        toss, [Coin(), Coin()][:1], seconds=8.0, clock=lambda: WorkClock(machine), seed=4
    )
    policy, simulated = retrying(toss, library["toss"], survival_of(stats.uniform(0, 20)))
    assert len(policy.lengths) >= 1
    assert 0 <= simulated.mean(20.0)[0] <= 1
