"""What a soak and a mutation run conclude from."""

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.benchmarks import mutation
from experiments.benchmarks.equivalent_mutants import EQUIVALENT
from experiments.benchmarks.mutants import mutants
from experiments.benchmarks.soak import Soaked, slope

SOURCE = '''
"""A text that says 1 + 1 < 3."""
LIMIT = 3

def judged(value: int = 2, *, strict=True) -> bool:
    if not strict or value < LIMIT:
        raise ValueError("at least 3" + str(value))
    return min(value, -1) == LIMIT - 1

def paired(some, others):
    assert len(some) < 9
    return list(zip(some, others, strict=True))
'''


def test_each_mutant_differs_in_one_place_that_computes():
    changes = [(each.line, each.change) for each in mutants(SOURCE, "judged.py")]
    assert changes == [
        (3, "3 → 4"),
        (5, "True → False"),
        (5, "2 → 3"),
        (6, "Or → And"),
        (6, "Name → UnaryOp"),
        (6, "Lt → LtE"),
        (8, "Eq → NotEq"),
        (8, "min → max"),
        (8, "USub → UAdd"),
        (8, "1 → 2"),
        (8, "Sub → Add"),
        (8, "1 → 2"),
    ]


def test_a_mutant_behaves_as_it_was_changed_and_the_next_is_whole_again():
    answers = []
    for each in mutants("def f(x):\n    return (x < 3, x + 1)\n", "f.py"):
        names: dict = {}
        exec(each.code, names)
        answers.append(names["f"](3))
    assert answers == [(True, 4), (True, 4), (False, 2), (False, 5)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="mutants are run in forks")
def test_the_tests_that_should_notice_are_there():
    assert mutation.available()


@pytest.mark.parametrize("module", EQUIVALENT)
def test_what_is_listed_as_equivalent_is_a_change_of_a_line_that_is_there(module):
    there = {(each.text, each.change) for each in mutation.every(module)}
    assert set(EQUIVALENT[module]) <= there
    assert all(EQUIVALENT[module].values())


@given(st.floats(-50, 50), st.floats(0, 1e3), st.integers(3, 400))
def test_the_slope_of_a_line_is_found(rise, begins, count):
    times = np.linspace(0.0, 1.0, count)
    found, low, high = slope(times, begins + rise * times)
    assert found == pytest.approx(rise, abs=1e-6)
    assert low <= found <= high


def test_what_only_varies_does_not_rise():
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(100):
        _, low, high = slope(np.linspace(0.0, 1.0, 300), 250.0 + rng.normal(0.0, 1.0, 300))
        held += low <= 0.0 <= high
    assert held >= 90


def test_what_comes_and_goes_is_not_kept_and_what_stays_is():
    rows = np.zeros((300, 4))
    rows[:, 0] = np.arange(300)
    rows[:, 2:] = 8, 2
    rows[200:, 3] += np.arange(100) % 4 > 0  # more often a spare is being started, in the end
    assert Soaked(300, 0, rows).grown() == (0, 0)
    rows[150:, 2] += 1
    assert Soaked(300, 0, rows).grown() == (1, 0)
