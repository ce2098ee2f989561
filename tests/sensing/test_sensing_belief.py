"""The belief: looks add up, touches settle, and nothing beyond the disc changes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from sensing import Belief, SensedMap, disc, score, sense, uniform, weight_of
from sensing.belief import CERTAIN, CLIP


def floor(seed=0, size=(40, 50)):
    return uniform(size, 0.2, np.random.default_rng(seed))


@given(st.integers(1, 30), st.integers(1, 30), st.integers(0, 12), st.integers(0, 899), st.data())
def test_the_disc_holds_the_cells_within_the_radius(rows, columns, radius, at, data):
    center = (at % rows, data.draw(st.integers(0, columns - 1)))
    near = disc(center, radius, (rows, columns))
    marked = np.zeros((rows, columns), bool)
    marked[near.window] = near.inside
    for row, column in np.ndindex(rows, columns):
        distance = (row - center[0]) ** 2 + (column - center[1]) ** 2
        assert marked[row, column] == (distance <= radius**2)


def test_a_disc_off_the_map_is_refused():
    with pytest.raises(AnytimeError, match="on the map of 4 x 5"):
        disc((4, 0), 2, (4, 5))
    with pytest.raises(AnytimeError, match="radius is -1"):
        disc((0, 0), -1, (4, 5))


def test_before_any_look_every_cell_has_the_prior():
    belief = Belief((3, 4), density=0.2)
    assert belief.probabilities() == pytest.approx(0.2)
    assert belief.unknown.all()
    assert not belief.blocked.any()


@given(st.floats(0.51, 0.99), st.integers(0, 100))
def test_a_look_is_bayes_rule(quality, seed):
    free = floor(seed)
    belief = Belief(free.shape, density=0.3)
    sensed = sense(free, (20, 20), 8, quality, np.random.default_rng(seed))
    belief.update(sensed)
    believed = belief.probabilities()[sensed.slices][sensed.inside]
    blocked = sensed.blocked[sensed.inside]
    hit, miss = 0.3 * quality, 0.7 * (1 - quality)
    assert believed[blocked] == pytest.approx(hit / (hit + miss), rel=1e-4)
    hit, miss = 0.3 * (1 - quality), 0.7 * quality
    assert believed[~blocked] == pytest.approx(hit / (hit + miss), rel=1e-4)


def test_a_look_changes_nothing_beyond_its_disc():
    free = floor()
    belief = Belief(free.shape)
    sensed = sense(free, (5, 5), 8, 0.9, np.random.default_rng(0))
    belief.update(sensed)
    outside = np.ones(free.shape, bool)
    outside[sensed.slices] = ~sensed.inside
    assert belief.unknown[outside].all()
    assert not belief.unknown[~outside].any()


def test_log_odds_are_clipped_so_that_they_can_be_unlearned():
    free = floor()
    belief = Belief(free.shape)
    for _ in range(20):
        belief.update(sense(free, (20, 20), 60, 1.0, np.random.default_rng(0)))
    assert np.abs(belief.log_odds).max() == CLIP
    assert np.array_equal(belief.blocked, ~free)


def test_what_is_touched_is_certain_whatever_is_seen():
    free = floor()
    belief = Belief(free.shape)
    belief.touch_around((10, 10), free)
    for seed in range(5):
        belief.update(sense(~free, (10, 10), 5, 1.0, np.random.default_rng(seed)))
    near = (slice(9, 12), slice(9, 12))
    assert np.array_equal(belief.blocked[near], ~free[near])
    assert np.array_equal(belief.touched_blocked[near], ~free[near])
    assert set(np.abs(belief.log_odds[near]).ravel()) == {CERTAIN}
    assert belief.touched.sum() == 9
    belief.touch((0, 0), blocked=True)
    assert belief.probabilities()[0, 0] == 1.0


@given(st.lists(st.tuples(st.integers(-3, 42), st.integers(-3, 52)), min_size=1, max_size=9))
def test_a_walk_touches_what_its_steps_touch(cells):
    free = floor()
    walked, stepped = Belief(free.shape), Belief(free.shape)
    walked.touch_around(np.array(cells), free)
    for cell in cells:
        stepped.touch_around(cell, free)
    assert np.array_equal(walked.log_odds, stepped.log_odds)
    assert np.array_equal(walked.touched, stepped.touched)


def test_cells_that_a_sensor_calls_unknown_are_left_alone():
    confidence = np.array([[0.5, 0.9]], np.float32)
    sensed = SensedMap((0, 0), np.ones((1, 2), bool), np.ones((1, 2), bool), 0.7, confidence)
    belief = Belief((1, 2))
    belief.update(sensed)
    assert belief.unknown.tolist() == [[True, False]]
    assert belief.log_odds[0, 1] == pytest.approx(belief.prior + math.log(9))


def test_the_score_counts_half_for_the_unknown():
    free = np.array([[True, True, False, False]])
    called = np.array([[False, True, False, True]])
    result = score(called, free)
    assert (result.quality, result.false_free, result.false_blocked) == (0.5, 0.5, 0.5)
    assert (result.all_free, result.cells) == (0.5, 4)
    unknown = np.array([[False, True, True, False]])
    assert score(called, free, unknown=unknown).quality == 0.75
    assert score(called, free, inside=np.array([[True, False, False, True]])).quality == 1.0
    assert "all free 0.500" in str(result)
    with pytest.raises(AnytimeError, match="at least one cell"):
        score(called, free, inside=np.zeros((1, 4), bool))


def test_a_belief_is_scored_on_the_disc_or_on_all_of_the_map():
    free = floor()
    belief = Belief(free.shape)
    belief.update(sense(free, (20, 20), 8, 1.0, np.random.default_rng(0)))
    assert belief.score(free, (20, 20), 8).quality == 1.0
    known = 1 - belief.unknown.mean()
    assert belief.score(free).quality == pytest.approx(0.5 + 0.5 * known)


def test_a_copy_goes_its_own_way():
    belief = Belief((3, 3))
    twin = belief.copy()
    twin.touch((1, 1), blocked=True)
    assert not belief.touched.any()
    assert twin.prior == belief.prior


def test_weights_are_log_odds_within_the_clip():
    assert weight_of(0.5) == 0.0
    assert weight_of(0.9) == pytest.approx(math.log(9))
    assert weight_of(1.0) == CLIP
    assert weight_of(0.0) == -CLIP
    with pytest.raises(AnytimeError, match="probability"):
        weight_of(float("nan"))
    with pytest.raises(AnytimeError, match="between 0 and 1"):
        Belief((2, 2), density=0.0)
