"""Courses, their tables, and the policy that acts by them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from monitor import Decision, Energy, Mission, Situation, State, Value
from monitor.course_tables import solve
from monitor.courses import Leg, course_of, refined, smoothed
from monitor.optimal import Optimal

MISSION = Mission(Value("soft", 100.0, 40.0), Energy(0.2, 0.08, 0.03), job=1.0)
LABELS = ("see", "find_path")


def legs(route=160.0, factor=1.5, thinking=2.0, stops=0, noise=0.0, seed=0) -> list[Leg]:
    """A mission whose frames lead 16 further and walk `factor` times as far."""
    rng = np.random.default_rng(seed)
    told = [Leg(route, 0.0, 0.0, thinking, True)]
    left = route
    while left > 0:
        walked = factor * min(16.0, left) * float(np.exp(noise * rng.normal()))
        told.append(Leg(left, min(16.0, left), walked, thinking if left > 16 else 0.0, False))
        left -= 16.0
        told += [Leg(left, 0.0, 0.0, thinking, True)] * (stops if left > 0 else 0)
    return told


def course(factor=1.5, thinking=2.0, stops=0, noise=0.3):
    missions = [legs(160.0, factor, thinking, stops, noise, seed) for seed in range(8)]
    made = course_of(missions, (thinking - 0.1, 0.1))
    assert made is not None
    return made


TABLE = solve(MISSION, course(), 160.0)
POLICY = Optimal(
    MISSION,
    LABELS,
    tuple(
        solve(MISSION, course(factor, thinking, stops), 160.0)
        for factor, thinking, stops in ((2.2, 0.5, 1), (1.5, 2.0, 0), (1.1, 5.0, 0))
    ),
)


def state(time=0.0, to_go=140.0, in_hand=16.0, energy=0.0, walked=0.0, **changes) -> State:
    situation = Situation(energy, to_go, in_hand)
    base = State("frame", time, situation, standing=in_hand == 0, made_on=1.9, route=160.0)
    return replace(base, walked=walked, **changes)


@given(st.floats(0.7, 2.0), st.floats(0.7, 2.0))
def test_half_way_between_two_courses_one_walks_as_far_as_between(one, other):
    courses = [course(one, thinking=0.5, noise=0.0), course(other, thinking=2.0, noise=0.0)]
    wholes = [each.forecast.whole for each in refined(courses)]
    assert len(wholes) == 3
    assert min(wholes[0], wholes[2]) <= wholes[1] + 1e-9 <= max(wholes[0], wholes[2]) + 2e-9


def test_missions_that_went_by_obstacle_avoidance_alone_make_a_course_as_well():
    blind = [[replace(leg, planned=0.0) for leg in legs(seed=seed, noise=0.2)] for seed in range(4)]
    made = course_of(blind, (0.1, 0.0))
    assert made.planned == 0.0
    worth, speed = solve(MISSION, course(), 160.0).walking(0.0, 100.0, 0.0, 0.1, made)
    assert np.isfinite([worth, speed]).all()


def test_what_always_happened_is_foreseen_exactly():
    made = course(noise=0.0)
    for to_go in (160.0, 96.0, 32.0):
        assert made.forecast(to_go, 1.5 * (160.0 - to_go), 160.0) == pytest.approx(1.5 * to_go)


@given(st.floats(0, 300), st.floats(0, 600))
def test_nobody_arrives_before_the_route_ends(left, walked):
    assert course().forecast(left, walked, 160.0) >= left


def test_missions_that_never_walked_tell_no_course():
    assert course_of([], (1.0, 0.1)) is None
    assert course_of([[Leg(10.0, 0.0, 0.0, 1.0, True)]], (1.0, 0.1)) is None


def test_stops_are_as_many_on_average_as_were_lived():
    assert course(stops=1).stops.mean() == pytest.approx(1.0)
    assert course(stops=0).stops.max() == 0.0


def test_forecasts_are_right_on_average():
    for row in course().changes:
        assert row.mean() == pytest.approx(1.0)


def test_a_course_that_was_lucky_is_moved_towards_its_neighbours():
    factors = (2.0, 1.7, 1.2, 1.35, 1.2)  # the third was lucky
    made = [course(factor, 1.0 + index) for index, factor in enumerate(factors)]
    # what chance explains depends on how uncertain each is
    found = smoothed([replace(each, error=0.3) for each in made])
    wholes = [each.forecast.whole for each in found]
    assert wholes == sorted(wholes, reverse=True)
    sure = smoothed([replace(each, error=0.0) for each in made])
    assert sure[2].forecast.whole == pytest.approx(made[2].forecast.whole)


def test_near_the_goal_what_was_walked_says_little():
    made = course_of([legs(factor=factor) for factor in np.linspace(1.1, 1.9, 9)], (1.9, 0.1))
    assert made is not None
    for walked in (150.0, 300.0):  # of 176 to 304
        assert made.forecast(8.0, walked, 160.0) == pytest.approx(1.5 * 8.0, rel=0.5)


def test_who_saw_badly_so_far_has_not_gone_farther_for_it():
    poor = POLICY.tables[0].course
    half = state(to_go=64.0, walked=poor.forecast.whole * 80.0, walked_on=poor.shares[0])
    for table, factor in zip(POLICY.tables, (2.2, 1.5, 1.1), strict=True):
        _, _, to_walk = POLICY.worth(table, half, 0.0)
        assert to_walk == pytest.approx(factor * 80.0, rel=0.15)


def test_a_plan_made_on_less_sensing_brings_one_less_far():
    good, poor = POLICY.tables[2], POLICY.tables[0].course
    shorter = replace(poor, walked=good.course.walked, changes=good.course.changes)
    worths = [good.walking(5.0, 150.0, 16.0, 0.0, on)[0] for on in (good.course, shorter)]
    assert worths[1] < worths[0]


def test_between_neighbours_that_are_far_apart_there_is_another():
    one, other = course(1.8, 1.0), course(1.2, 3.0)
    made = refined([one, other])
    assert len(made) == 3
    assert one.contract < made[1].contract < other.contract
    assert other.forecast.whole < made[1].forecast.whole < one.forecast.whole
    assert len(refined([one, replace(one, contract=1.01)])) == 2


@given(st.floats(0, 70), st.floats(1, 350), st.floats(0.5, 10), st.floats(5, 60))
def test_later_or_farther_is_never_worth_more(time, to_walk, later, farther):
    here = TABLE.standing(time, to_walk)
    assume(here > 0)  # who is too late anyway saves energy by being later still
    assert TABLE.standing(time + later, to_walk) <= here + 1e-6
    assert TABLE.standing(time, to_walk + farther) <= here + 0.1  # whole frames, rounded


def test_after_the_deadline_nothing_is_worth_anything():
    assert TABLE.standing(80.0, 50.0) == 0.0


def test_speed_rises_with_what_is_left_to_do_before_the_value_falls():
    made_on = TABLE.course
    speeds = [TABLE.walking(time, 150.0, 16.0, 0.0, made_on)[1] for time in (5.0, 15.0, 25.0)]
    assert speeds == sorted(speeds)
    assert speeds[0] < speeds[-1]


@pytest.mark.parametrize("idle", [0.0, 8.0])
def test_what_is_promised_is_what_missions_are_worth(idle):
    mission = replace(MISSION, energy=Energy(0.2, 0.08, 0.03, idle))
    table = solve(mission, course(), 160.0)
    rng = np.random.default_rng(1)
    nets = []
    for _ in range(200):
        time, energy, to_walk = 0.0, mission.energy.idle * mission.job, 240.0
        time += table.course.contract
        while to_walk > 0:
            row = int(np.searchsorted(table.course.beyond, to_walk, side="right")) - 1
            pick = int(rng.integers(table.course.walked.shape[1]))
            _, speed = table.walking(time, to_walk, 16.0, 2.0, table.course)
            walked = min(table.course.walked[row, pick], to_walk)
            drive = walked / speed
            arrives = walked >= to_walk
            frame = drive if arrives else max(drive, table.course.contract)
            energy += drive * float(mission.energy.power(speed)) + idle * (frame - drive)
            time += frame
            to_walk = 0.0 if arrives else (to_walk - walked) * table.course.changes[row, pick]
        nets.append(mission.net(True, time + mission.job, energy))
    promised = table.standing(table.course.contract, 240.0)
    assert np.mean(nets) == pytest.approx(promised, rel=0.03)


@given(st.floats(0, 79), st.floats(0, 300), st.floats(0, 30), st.floats(0, 500))
def test_the_same_state_leads_to_the_same_decision_within_the_limits(time, to_go, hand, walked):
    asked = state(time, to_go, hand, walked=walked)
    decision = POLICY(asked)
    assert decision == POLICY(asked)
    assert MISSION.speeds[0] <= decision.speed <= MISSION.speeds[1] + 1e-9
    assert set(decision.shares) == set(LABELS)
    assert decision.why.net == pytest.approx(max(net for _, net in decision.why.curve))


def test_energy_that_was_used_is_subtracted_and_changes_nothing_else():
    fresh, tired = POLICY(state()), POLICY(state(energy=50.0))
    assert tired.why.net == pytest.approx(fresh.why.net - 0.2 * 50.0)
    assert (tired.speed, tired.shares) == (fresh.speed, fresh.shares)


def test_beyond_the_end_of_a_plan_the_speed_stays():
    contract = Decision({"see": 1.9, "find_path": 0.1}, 7.0)
    over = state(3.0, in_hand=0.0, moment="call", standing=False, contract=contract)
    assert POLICY(over) is contract


def test_within_a_frame_only_the_speed_is_chosen_again():
    contract = Decision({"see": 1.9, "find_path": 0.1}, 1.0)
    within = state(30.0, in_hand=16.0, moment="call", contract=contract, frame_started=29.0)
    decided = POLICY(within)
    assert decided.shares == contract.shares
    assert decided.speed > 1.0
