"""Contracts in turn on several processors, for several problems."""

from __future__ import annotations

import itertools
import math

import pytest

from anytime import AnytimeError
from compiler import round_robin
from compiler.processors import Contract, optimal_ratio, simulated_ratio


def first(count, **counts):
    return list(itertools.islice(round_robin(1.0, **counts), count))


@pytest.mark.parametrize("processors", range(1, 9))
@pytest.mark.parametrize("problems", range(1, 4))
def test_the_ratio_that_is_lived_through_is_that_of_the_formula(processors, problems):
    contracts = first(250, processors=processors, problems=problems)
    ratio = simulated_ratio(contracts)
    assert ratio == pytest.approx(optimal_ratio(processors, problems), rel=1e-4)


def test_known_ratios():
    """[RZ91] for one of each, [BFZ03] for several processors or problems."""
    assert optimal_ratio() == 4
    assert optimal_ratio(2) == pytest.approx(2.598, abs=1e-3)
    assert optimal_ratio(1, 2) == pytest.approx(6.75)


def test_one_processor_and_one_problem_double():
    assert [contract.length for contract in first(5)] == [1, 2, 4, 8, 16]


@pytest.mark.parametrize(("processors", "problems"), [(1, 1), (3, 2), (2, 5)])
def test_a_processor_does_one_contract_at_a_time_and_every_problem_has_its_turn(
    processors, problems
):
    contracts = first(60, processors=processors, problems=problems)
    for processor in range(processors):
        own = [contract for contract in contracts if contract.processor == processor]
        assert own[0].start == 0
        assert all(a.end == b.start for a, b in itertools.pairwise(own))
    assert [contract.problem for contract in contracts] == [i % problems for i in range(60)]


@pytest.mark.parametrize("factor", [0.9, 0.97, 1.03, 1.1])
def test_another_base_is_worse(factor):
    base = factor * math.sqrt(3)
    contracts = list(itertools.islice(round_robin(1.0, processors=2, base=base), 60))
    assert simulated_ratio(contracts) > optimal_ratio(2) + 1e-4


def test_a_contract_that_might_still_be_missing_ends_the_simulation():
    short = [Contract(0, 0, 0.0, 1.0), Contract(0, 1, 0.0, 2.0), Contract(0, 0, 1.0, 9.0)]
    assert (
        simulated_ratio(short) == 2.0
    )  # at 2, before the second is done; 10 is beyond what is known


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"processors": 0}, "at least one of each"),
        ({"problems": 0}, "at least one of each"),
        ({"base": 1.0}, "base > 1"),
        ({"first": 0.0}, "seconds > 0"),
    ],
)
def test_what_makes_no_schedule_is_refused_at_once(wrong, says):
    with pytest.raises(AnytimeError, match=says):
        round_robin(wrong.pop("first", 1.0), **wrong)
