"""Floor and ceiling of real-valued programs: the optimum lies between them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compiler.certificates import Response, ceiling_factor, certified, floor_factor, qualities

TIMES = np.arange(5.0)


@st.composite
def programs(draw, count=3):
    """Responses of three calls, the last fed by both others; better input may be worse."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    monotone = draw(st.booleans())
    feeds = [(), ("call 0",), draw(st.sampled_from([("call 0", "call 1"), ("call 1",)]))]
    responses = []
    for place, fed in enumerate(feeds):
        levels = np.linspace(0, 1, draw(st.integers(2, 6)))
        shape = [len(responses[int(name[-1])].levels) for name in fed]
        quality = rng.random((*shape, len(TIMES)))
        if monotone:
            for axis in range(quality.ndim):
                quality = np.sort(quality, axis=axis)
        responses.append(Response(f"call {place}", fed, levels, TIMES, quality))
    return responses


def optima(responses):
    """The best quality for every whole number of seconds, by trying all divisions."""
    divisions = np.array(list(itertools.product(TIMES, repeat=len(responses))))
    values = qualities(responses, divisions)
    budgets = np.arange(len(responses) * (len(TIMES) - 1) + 1)
    return budgets, [values[divisions.sum(axis=1) <= budget].max() for budget in budgets]


@given(programs())
@settings(deadline=None)
def test_the_optimum_lies_between_floor_and_ceiling_at_every_budget(responses):
    certificate = certified(responses)
    for budget, best in zip(*optima(responses), strict=True):
        at = np.searchsorted(certificate.budgets, budget, side="right") - 1
        assert certificate.floor[at] - 1e-9 <= best <= certificate.ceiling[at] + 1e-9
    assert certificate.error >= 0


@given(programs())
@settings(deadline=None)
def test_the_divisions_deliver_the_floor_within_their_budgets(responses):
    certificate = certified(responses)
    spent = certificate.divisions.sum(axis=1)
    assert (spent <= certificate.budgets + 1e-9).all()
    assert qualities(responses, certificate.divisions) == pytest.approx(certificate.floor)
    assert (np.diff(certificate.floor) >= 0).all()
    assert (np.diff(certificate.ceiling) >= 0).all()


@given(programs())
@settings(deadline=None)
def test_rounded_up_no_level_needs_more_time_than_rounded_down(responses):
    for response in responses:
        lower, upper = floor_factor(response).table, ceiling_factor(response).table
        assert (upper <= lower).all()
        for table in (lower, upper):
            assert (table[..., 1:] >= table[..., :-1]).all()


def test_twice_as_many_levels_halve_the_error():
    def error(count):
        times, grid = np.arange(101.0), np.linspace(0, 1, count)
        rise = 1 - np.exp(-times / 20)
        chain = [Response("see", (), grid, times, rise)]
        chain.append(Response("plan", ("see",), grid, times, (0.4 + 0.6 * grid)[:, None] * rise))
        return certified(chain).error

    assert error(128) < 0.7 * error(64) < 0.5 * error(32)


def test_qualities_are_linear_between_the_levels_of_the_input():
    see = Response("see", (), np.array([0.0, 1.0]), TIMES, np.array([0.0, 0.25, 0.5, 0.75, 1.0]))
    plan = Response(
        "plan",
        ("see",),
        np.array([0.0, 1.0]),
        TIMES,
        np.array([[0.0] * 5, [0, 0.2, 0.4, 0.6, 0.8]]),
    )
    divisions = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0]])
    assert qualities([see, plan], divisions) == pytest.approx([0.25 * 0.8, 0.5 * 0.4, 0.2])
