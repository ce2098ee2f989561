"""Listening: every reading makes the map better, none makes it sure of what it does not say."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime import AnytimeError, Machine, Status, WorkClock
from sensing.sonar import VERSIONS, Sonars, Surroundings
from sensing.sonar_grid import PRIOR
from sensing.sonar_map import (
    Echoes,
    Listening,
    Recorded,
    SonarMap,
    listenings,
    map_quality,
    obstacles,
    sonar_map,
)

SONARS = Sonars()
HERE = (0.0, 0.0, 0.0)
EMPTY = SonarMap.around(0.0, 0.0)
SILENT = (math.inf, math.inf)
AHEAD = Surroundings(((0.5, 0.0, 0.1),))


def heard(around, poses, rng=None, known=EMPTY, start=0.0, sonars=SONARS):
    for index, pose in enumerate(poses):
        told = sonars.hear(sonars.distances(pose, around), rng)
        known = known.hear(Echoes(start + 0.1 * index, pose, told), sonars)
    return known


def chance(known, x, y):
    odds = known.at(np.array([x]), np.array([y]))[0]
    return 1 / (1 + math.exp(-odds))


def test_nothing_is_known_before_anything_is_heard():
    assert EMPTY.probabilities() == pytest.approx(PRIOR)
    assert obstacles(EMPTY).shape == (0, 3)


def test_silence_clears_the_cone_and_nothing_else():
    known = heard(Surroundings(), [HERE])
    assert chance(known, 1.0, 0.3) < PRIOR / 3
    assert chance(known, -1.0, 0.0) == pytest.approx(PRIOR)
    assert chance(known, 0.0, 2.7) == pytest.approx(PRIOR)
    assert (known.log_odds <= EMPTY.log_odds).all()
    assert len(obstacles(known)) == 0


def test_an_echo_clears_what_is_nearer_and_raises_what_is_there():
    known = heard(AHEAD, [HERE])
    assert chance(known, 0.25, 0.0) < PRIOR / 3
    assert chance(known, 0.41, 0.0) > 2 * PRIOR
    assert chance(known, 0.8, 0.0) == pytest.approx(PRIOR)


@pytest.mark.parametrize("told", [math.nan, 0.0, -1.0])
def test_what_is_no_information_changes_nothing(told):
    known = EMPTY.hear(Echoes(0.0, HERE, (told, told)), SONARS)
    assert (known.log_odds == EMPTY.log_odds).all()
    assert len(obstacles(known)) == 0
    assert known.heard == 1


def test_a_robot_that_does_not_know_where_it_is_learns_nothing():
    known = EMPTY.hear(Echoes(0.0, (math.nan, 0.0, 0.0), (0.5, 0.5)), SONARS)
    assert (known.log_odds == EMPTY.log_odds).all()
    assert len(obstacles(known)) == 0
    lost = Recorded((Echoes(0.0, (math.nan, math.inf, 0.0), (0.5, 0.5)),))
    assert anytime.run(sonar_map, lost, seconds=5.0).status is Status.COMPLETE


def test_hearing_leaves_the_map_that_was_as_it_was():
    known = heard(AHEAD, [HERE])
    before = known.log_odds.copy()
    heard(AHEAD, [HERE], known=known)
    assert (known.log_odds == before).all()
    assert (EMPTY.log_odds == EMPTY.log_odds[0, 0]).all()


def test_the_same_reading_over_and_over_does_not_make_a_whole_arc_certain():
    once, often = heard(AHEAD, [HERE]), heard(AHEAD, [HERE] * 100)
    assert once.probabilities().max() < 0.2
    assert often.probabilities().max() < 0.5


def test_one_reading_of_both_sonars_gives_one_disc_about_right():
    ((x, y, radius),) = obstacles(heard(AHEAD, [HERE]))
    assert math.hypot(x - 0.5, y) < 0.12
    assert x - radius == pytest.approx(0.4, abs=0.05)


def test_from_several_places_the_obstacle_is_found_within_a_few_centimetres():
    poses = [(0.0, 0.04 * step, 0.0) for step in range(11)]
    poses += [(0.04 * step, 0.4, 0.0) for step in range(8)]
    for seed in range(5):
        found = obstacles(heard(AHEAD, poses, np.random.default_rng(seed)))
        off = np.hypot(found[:, 0] - 0.5, found[:, 1]) - found[:, 2]
        assert off.min() < 0.0
        assert np.hypot(found[:, 0] - 0.5, found[:, 1]).min() < 0.06


def test_what_one_sonar_alone_hears_may_be_anywhere_on_its_arc():
    found = obstacles(heard(Surroundings(((0.45, 0.3, 0.1),)), [HERE]))
    assert len(found) > 1
    assert (found[:, 1] > -0.1).all()
    assert np.hypot(found[:, 0] - 0.45, found[:, 1] - 0.3).min() < 0.2


def test_where_nothing_was_heard_from_another_side_there_is_no_disc():
    around = Surroundings(((0.32, 0.4, 0.1),))
    anywhere = obstacles(heard(around, [HERE]))
    looked = obstacles(heard(around, [HERE, (0.0, 0.0, -0.3)]))
    bearings = [np.arctan2(found[:, 1], found[:, 0]) for found in (anywhere, looked)]
    assert bearings[0].min() < math.radians(33) < bearings[1].min()


def test_what_is_too_near_to_be_measured_is_told_between_the_touch_and_the_range():
    found = obstacles(heard(Surroundings(((0.28, 0.0, 0.1),)), [HERE]))
    assert 0.13 < (np.hypot(found[:, 0], found[:, 1]) - found[:, 2]).min() < 0.25
    assert (np.abs(found[:, 1]) < found[:, 2]).all()


def test_what_was_measured_before_it_came_too_near_is_still_known():
    poses = [(0.02 * step, 0.0, 0.0) for step in range(11)]
    found = obstacles(heard(AHEAD, poses))
    assert (found[:, 0] - found[:, 2]).min() == pytest.approx(0.4, abs=0.03)


def test_an_obstacle_that_is_taken_away_is_unlearned_at_once_and_its_return_learnt():
    known = heard(AHEAD, [HERE] * 30, np.random.default_rng(0))
    assert len(obstacles(known))
    known = heard(Surroundings(), [HERE] * 5, known=known, start=3.0)
    assert len(obstacles(known)) == 0
    known = heard(AHEAD, [HERE], known=known, start=3.5)
    assert len(obstacles(known)) == 1


def test_what_was_taken_away_behind_our_back_goes_when_one_looks_again():
    known = heard(AHEAD, [(0.0, 0.05 * step, 0.0) for step in range(6)])
    known = heard(Surroundings(), [(-0.2, 0.05 * step, 0.0) for step in range(6)], None, known, 1.0)
    assert len(obstacles(known)) == 0


def test_one_lost_echo_is_no_news():
    known = heard(AHEAD, [HERE] * 3)
    before = obstacles(known)
    known = known.hear(Echoes(0.4, HERE, SILENT), SONARS)
    assert obstacles(known) == pytest.approx(before)
    known = known.hear(Echoes(0.5, HERE, SILENT), SONARS)
    assert len(obstacles(known)) == 0


def test_in_the_long_run_everything_is_forgotten():
    known = heard(AHEAD, [HERE] * 5)
    known = known.hear(Echoes(300.0, (0.0, 0.0, math.pi), SILENT), SONARS)
    assert len(obstacles(known)) == 0
    assert chance(known, 0.4, 0.0) == pytest.approx(PRIOR, rel=0.01)


def test_the_nearest_disc_comes_first():
    around = Surroundings(((0.6, 0.45, 0.1), (0.5, -0.2, 0.1)))
    found = obstacles(heard(around, [HERE, (0.0, 0.0, 0.3), (0.0, 0.0, -0.3)]))
    far = np.hypot(found[:, 0], found[:, 1]) - found[:, 2]
    assert (np.diff(far) >= 0).all()


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(sorted(VERSIONS)),
    st.sampled_from([15.0, 30.0]),
    st.lists(
        st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-3, 3)),
        min_size=1,
        max_size=5,
    ),
    st.integers(0, 99),
)
def test_whatever_is_heard_the_map_stays_finite_and_the_discs_sensible(
    version, degrees, poses, seed
):
    rng = np.random.default_rng(seed)
    sonars = Sonars(version, math.radians(degrees))
    known = EMPTY
    for index, pose in enumerate(poses):
        told = tuple(rng.choice([math.inf, math.nan, 0.0, *rng.uniform(0.1, 3.0, 3)], 2))
        known = known.hear(Echoes(0.1 * index, pose, told), sonars)
    found = obstacles(known)
    assert np.isfinite(known.log_odds).all()
    assert np.isfinite(found).all()
    assert ((found[:, 2] > 0.05) & (found[:, 2] < 0.3)).all()


@given(st.floats(-20, 20), st.floats(-20, 20))
@settings(max_examples=20, deadline=None)
def test_a_map_that_is_shifted_far_has_its_middle_there(x, y):
    xs, ys = np.meshgrid(*heard(AHEAD, [HERE]).centred(x, y, within=0.0).places())
    assert math.hypot(xs.mean() - x, ys.mean() - y) < 0.06


@given(st.floats(-5, 5), st.floats(-5, 5))
@settings(max_examples=10, deadline=None)
def test_a_map_that_is_shifted_keeps_what_stays_on_it(x, y):
    known = heard(AHEAD, [HERE] * 3)
    moved = known.centred(x, y, within=0.0)
    xs, ys = np.meshgrid(*moved.places())
    assert moved.at(xs.ravel(), ys.ravel()) == pytest.approx(known.at(xs.ravel(), ys.ravel()))
    assert obstacles(moved) == pytest.approx(obstacles(known))
    middle = xs.mean(), ys.mean()
    assert math.hypot(middle[0] - x, middle[1] - y) < 0.06


def test_a_map_without_cells_is_refused():
    with pytest.raises(AnytimeError, match="2 to 1000 cells"):
        SonarMap.around(0.0, 0.0, side=1.0, cell=0.0)
    with pytest.raises(AnytimeError, match="2 to 1000 cells"):
        SonarMap.around(0.0, 0.0, side=100.0, cell=0.01)


def test_quality_is_one_for_the_truth_and_a_half_for_nothing_known():
    (problem,) = listenings(np.random.default_rng(1), 1)
    assert map_quality(EMPTY, problem) == pytest.approx(0.5)
    nothing = Listening(problem.sonar, Surroundings())
    assert map_quality(EMPTY, nothing) == 1.0


def test_problems_repeat_with_their_generator():
    def told(seed):
        return [p.sonar.readings for p in listenings(np.random.default_rng(seed), 3)]

    assert told(4) == told(4)
    assert told(4) != told(5)


def test_one_reading_is_one_unit_of_work_and_each_registers_a_map():
    (problem,) = listenings(np.random.default_rng(2), 1)
    clock = WorkClock(Machine("robot").with_rate("sonar_map", 0.1))
    result = anytime.run(sonar_map, problem.sonar, deadline=anytime.Deadline.after(1.05, clock))
    assert result.status is Status.INTERRUPTED
    assert result.value.heard == 10
    assert [change.work for change in result.history] == list(range(1, 11))


def test_it_goes_on_with_what_was_known():
    sonar = Recorded((Echoes(5.0, HERE, SILENT),), SONARS, heard(AHEAD, [HERE]))
    result = anytime.run(sonar_map, sonar, seconds=5.0)
    assert result.status is Status.COMPLETE
    assert result.value.heard == 2


def test_its_profile_rises_with_the_readings():
    clock = WorkClock(Machine("robot").with_rate("sonar_map", 0.1))
    library = anytime.measure(
        sonar_map,
        listenings(np.random.default_rng(3), 40),
        seconds=3.0,
        clock=lambda: WorkClock(clock.machine),
    )
    profile = library["sonar_map"]
    first, tenth, last = profile.mean(np.array([1.0, 10.0, 30.0])).tolist()
    assert 0.7 < first < last
    assert first - 0.02 < tenth < last + 0.02
    assert last > 0.78


def test_the_same_readings_give_the_same_bytes():
    poses = [(0.0, 0.03 * step, 0.0) for step in range(10)]
    one, other = (
        obstacles(heard(AHEAD, poses, np.random.default_rng(8))).tobytes() for _ in range(2)
    )
    assert one == other
