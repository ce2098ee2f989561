"""What a NAO fell over is believed where its walk led, for a while, and until it is doubted."""

from __future__ import annotations

import math

import pytest

from monitor.robots.nao_touched import Touched
from planners.nao_plan import Action

WALK = Action("walk", 0.5)


def test_it_is_ahead_of_whoever_walked_just_beyond_its_own_radius():
    touched = Touched()
    touched.fell((1.0, 2.0, math.pi / 2), WALK, 0.15, now=0.0)
    ((x, y, radius),) = touched.discs(1.0)
    assert (x, y) == pytest.approx((1.0, 2.0 + 0.15 + radius))


def test_a_walk_to_the_left_runs_into_what_is_on_the_left():
    touched = Touched()
    touched.fell((0.0, 0.0, 0.0), Action("walk", 0.0, 0.5), 0.15, now=0.0)
    ((x, y, _),) = touched.discs(1.0)
    assert x == pytest.approx(0.0)
    assert y > 0.15


def test_it_is_believed_for_three_quarters_of_a_minute():
    touched = Touched()
    touched.fell((0.0, 0.0, 0.0), WALK, 0.15, now=10.0)
    assert touched.discs(54.9)
    assert not touched.discs(55.0)


def test_what_is_doubted_is_gone():
    touched = Touched()
    assert not touched
    touched.fell((0.0, 0.0, 0.0), WALK, 0.15, now=0.0)
    assert touched
    touched.doubt()
    assert not touched
    assert touched.discs(1.0) == []
