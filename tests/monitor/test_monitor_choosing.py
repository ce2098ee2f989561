"""The policy that wins held-out missions; forks of missions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anytime import AnytimeError
from experiments import shipped
from monitor import Energy, Mission, News, State, Value
from monitor.calibration import live_closer
from monitor.choosing import ROUND, Chosen, judge_policies, tuned_division
from monitor.logs import write_log
from monitor.policies import constant
from monitor.regrets import regrets
from monitor.robots.briefing import QUICK, brief
from monitor.robots.grid import Scene
from monitor.robots.grid_missions import REFERENCE, GridMission
from monitor.states import Situation
from sensing.random_maps import corner_to_corner, uniform
from sensing.vision import Vision

MISSION = Mission(Value("soft", 100.0, 25.0), Energy(0.2, 0.08, 0.03), job=1.0)


def grid() -> GridMission:
    free = uniform(48, 0.15, np.random.default_rng(1))
    start, goal = corner_to_corner(free)
    scene = Scene(free, start, goal, radius=16, frame=8.0, device=Vision(2, 24))
    return GridMission(MISSION, scene, REFERENCE)


@pytest.fixture(scope="module")
def briefing():
    return brief(grid(), shipped.profiles(), QUICK)


def log_of(report, folder):
    return write_log(folder / "mission.jsonl", MISSION, None, report).read_bytes()


def judged(briefing, policies):
    """The verdict of three missions, and of four that the best of the policies lives alone."""
    program, robot = briefing.program, briefing.robot
    seeds, further = range(70, 73), range(73, 77)
    return judge_policies(program, MISSION, policies, None, robot, seeds=seeds, further=further)


def test_the_best_on_held_out_missions_is_chosen_and_acts(briefing):
    shares = dict(zip(briefing.program.labels, (0.5, 0.2), strict=True))
    policies = {"slow": constant(shares, 1.0), "brisk": constant(shares, 5.0)}
    verdict = judged(briefing, policies)
    assert verdict.name == "brisk"
    assert np.mean(verdict.nets["brisk"]) > np.mean(verdict.nets["slow"])
    chosen = Chosen(policies, verdict)
    asked = State("frame", 0.0, Situation(0.0, 40.0, 0.0), standing=True, route=40.0)
    assert chosen(asked).speed == 5.0
    assert chosen(asked).why.net == pytest.approx(np.mean(verdict.alone))


def test_what_the_best_promises_is_what_it_was_worth_where_nothing_was_chosen(briefing):
    shares = dict(zip(briefing.program.labels, (0.5, 0.2), strict=True))
    alike = {f"brisk {number}": constant(shares, 5.0) for number in range(2)}
    verdict = judged(briefing, alike)
    assert [len(nets) for nets in verdict.nets.values()] == [3, 3]
    assert len(verdict.alone) == 4
    assert verdict.worth == pytest.approx(np.mean(verdict.alone))


def test_optimal_is_one_of_the_table_the_expectation_and_a_fixed_division(briefing):
    policy = briefing.monitor("optimal").policy
    assert isinstance(policy, Chosen)
    assert set(policy.policies) == {"table", "expected", "fixed"}
    nets = policy.verdict.nets
    assert np.mean(nets[policy.verdict.name]) == max(np.mean(each) for each in nets.values())


def test_a_policy_that_falls_far_behind_lives_no_more_missions(briefing):
    shares = dict(zip(briefing.program.labels, (0.5, 0.2), strict=True))
    policies = {name: constant(shares, speed) for name, speed in (("slow", 1.0), ("brisk", 5.0))}
    program, robot = briefing.program, briefing.robot
    seeds, further = range(70, 70 + 2 * ROUND), range(200, 202)
    verdict = judge_policies(program, MISSION, policies, None, robot, seeds=seeds, further=further)
    assert {name: len(nets) for name, nets in verdict.nets.items()} == dict.fromkeys(
        policies, ROUND
    )


def test_of_policies_that_are_alike_the_first_is_taken(briefing):
    shares = dict(zip(briefing.program.labels, (0.5, 0.2), strict=True))
    slow, brisk = constant(shares, 1.0), constant(shares, 5.0)
    assert judged(briefing, {"slow": slow, "one": brisk, "same": brisk}).name == "one"


def test_more_is_lived_about_the_best_division(briefing):
    speeds = np.geomspace(*MISSION.speeds, 9)
    first = briefing.lived
    seeds, further = range(3), range(3, 5)
    lived = live_closer(
        briefing.program, MISSION, first, briefing.robot, seeds=seeds, further=further
    )
    best = max(first, key=lambda steady: steady.nets(MISSION, speeds).max())
    sensing = [steady.shares[0] for steady in lived]
    assert sensing == sorted(sensing)
    assert {steady.shares for steady in first} < {steady.shares for steady in lived}
    again = next(steady for steady in lived if steady.shares == best.shares)
    assert again.legs[: len(best.legs)] == best.legs
    assert len(again.legs) > len(best.legs)


def test_where_no_mission_reached_its_goal_no_more_are_lived(briefing):
    none = tuple(replace(steady, lived=(), legs=()) for steady in briefing.lived)
    seeds, further = range(3), range(3, 5)
    again = live_closer(
        briefing.program, MISSION, none, briefing.robot, seeds=seeds, further=further
    )
    assert again == none


def test_a_division_is_tuned_on_missions_that_were_lived_at_another_speed(briefing):
    tuned = tuned_division(briefing.program, MISSION, briefing.lived)
    assert tuned is not None
    assert 1.0 < tuned.decision.speed <= 10.0
    assert tuned_division(briefing.program, MISSION, ()) is None


def test_the_same_decision_forked_is_the_same_mission_byte_for_byte(briefing, tmp_path):
    report = briefing.live(briefing.monitor("table"), 5)
    decision = report.frames[2].decision
    same = report.fork(2, speed=decision.speed, **decision.shares)
    assert log_of(same, tmp_path) == log_of(report, tmp_path)


def test_another_decision_leaves_what_came_before_it_as_it_was(briefing, tmp_path):
    report = briefing.live(briefing.monitor("table"), 5)
    other = report.fork(frame=2, see=0.25, speed=2.0)
    assert other.frames[:2] == report.frames[:2]
    assert other.frames[2].decision.shares["see"] == 0.25
    assert other.frames[2].decision.speed == 2.0
    assert log_of(other, tmp_path) != log_of(report, tmp_path)
    again = other.fork(2, see=0.25, speed=2.0)
    assert log_of(again, tmp_path) == log_of(other, tmp_path)


@pytest.mark.parametrize(
    ("fork", "message"),
    [
        ({"frame": 99, "see": 1.0}, "the mission had frames 0 to"),
        ({"frame": 1.5, "see": 1.0}, "frame is 1.5; the mission had frames 0 to"),
        ({"frame": 1, "see": "long"}, "see gets 'long' s"),
        ({"frame": 1, "speed": "fast"}, "speed is 'fast'"),
        ({"frame": 1, "hear": 1.0}, "no call 'hear' to fork; there are see, find_path"),
        ({"frame": 1, "see": -1.0}, "it must be a finite number >= 0"),
        ({"frame": 1, "speed": 0.0}, "the mission has 1.0 to 10.0 cells/s"),
    ],
)
def test_what_cannot_be_forked_is_refused_in_one_line(briefing, fork, message):
    report = briefing.live(briefing.monitor("table"), 5)
    with pytest.raises(AnytimeError, match=message):
        report.fork(**fork)


def test_a_mission_that_nobody_can_live_again_says_so(report):
    with pytest.raises(AnytimeError, match="cannot be lived again"):
        report.fork(0, see=1.0)


def test_who_hears_of_a_deadline_on_the_way_keeps_it_more_often(briefing):
    news = News(3.0, Value("hard", 100.0, 16.0))
    other = replace(briefing.grid, mission=replace(MISSION, news=news))
    told = replace(briefing, grid=other)
    monitor = told.monitor("expected")
    deaf = replace(monitor, policy=monitor.policy.before)
    informed, without = (
        [told.live(each, seed).net for seed in range(8)] for each in (monitor, deaf)
    )
    assert np.mean(informed) > np.mean(without)
    report = told.live(monitor, 2)
    same = report.fork(1, **report.frames[1].decision.shares)
    assert same.net == report.net


def test_the_regret_of_a_decision_is_what_the_best_of_its_forks_was_worth_more(briefing):
    report = briefing.live(briefing.monitor("table"), 5)
    found = regrets(report, MISSION, briefing.contracts.shares, count=2)
    assert [regret.frame for regret in found] == [frame.index for frame in report.frames]
    for regret, frame in zip(found, report.frames, strict=True):
        decided = frame.decision
        for fork in regret.forks:
            assert (fork.shares, fork.speed) != (decided.shares, decided.speed)
        assert regret.regret == max(0.0, *(fork.net - report.net for fork in regret.forks))
    best = found[1].best
    assert report.fork(1, speed=best.speed, **best.shares).net == best.net
    with pytest.raises(AnytimeError, match="it takes 2 or more"):
        regrets(report, MISSION, briefing.contracts.shares, count=1)
