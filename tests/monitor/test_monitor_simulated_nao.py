"""The simulated NAO: it repeats to the bit, ends what it begins, and never walks through a wall."""

import hashlib
import itertools
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError, WorkClock
from anytime.machines import Machine
from monitor.robots.nao_body import LYING, UNKNOWN, LinkLostError, NaoBody, Outcome
from monitor.robots.nao_noise import NOISELESS, SILENT, MotionNoise, Noise
from monitor.robots.nao_scenes import Scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.simulated_nao import SimulatedNao
from planners.nao import POSTURES, STANDING, Body

RADIUS = Body().radius
UPRIGHT = [POSTURES[index] for index in STANDING]
STANDS = Scene(posture="Stand", noise=NOISELESS)
CROWD = Scene(
    posture="Stand",
    seed=9,
    obstacles=(
        Obstacle((0.6, 0.05), radius=0.12),
        Obstacle((0.0, -1.0), size=(2.0, 0.2), turned=0.1),
        Obstacle((-0.4, 1.2), radius=0.1, velocity=(0.05, -0.1), appears=2.0),
        Obstacle((0.3, 0.0), radius=0.1, appears=5.0, vanishes=30.0),
    ),
)
COMMANDS = (
    ("walk", 0.8, 0.1, 0.0),
    ("posture", "Stand"),
    ("walk", 0.0, -0.9, 0.5),
    ("posture", "Sit"),
    ("walk", 0.3, 0.0, 0.0),
    ("posture", "StandInit"),
    ("walk", -0.5, 0.5, 1.0),
)


def until_ended(nao, action):
    for _ in range(3000):
        if (outcome := action.poll()) is not None:
            return outcome
        nao.wait(0.1)
    raise AssertionError("an action went on for five minutes")


def walked(scene, *way, **options):
    nao = SimulatedNao(scene, **options)
    outcome = until_ended(nao, nao.walk(*way))
    return nao, outcome


def fingerprint(scene=CROWD, every=0.1):
    """A digest of everything that can be observed in a run with falls, contacts and refusals."""
    nao, digest = SimulatedNao(scene), hashlib.sha256()
    for command, *arguments in COMMANDS:
        action = getattr(nao, command)(*arguments)
        for _ in range(round(12 / every)):
            nao.wait(every)
            outcome = action.poll()
            if abs(nao.now() / 0.5 - round(nao.now() / 0.5)) < 1e-6:
                digest.update(repr((nao.read(), nao.true_pose_in_world, outcome)).encode())
    assert nao.world.contacts
    assert nao.falls
    return digest.hexdigest()


def test_it_is_a_body():
    body: NaoBody = SimulatedNao(STANDS)
    assert body.read().posture == "Stand"


def test_the_same_seed_gives_the_same_bytes_in_another_process_too():
    here = fingerprint()
    assert fingerprint(replace(CROWD, seed=10)) != here
    path = os.pathsep.join(sys.path)
    code = f"import runpy; print(runpy.run_path({__file__!r})['fingerprint']())"
    environment = os.environ | {"PYTHONHASHSEED": "77", "PYTHONPATH": path}
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ran.stdout.strip() == here, ran.stderr


def test_how_often_one_looks_changes_nothing():
    assert fingerprint(every=0.1) == fingerprint(every=0.02)


def test_reading_is_free_of_side_effects():
    nao, other = SimulatedNao(CROWD), SimulatedNao(CROWD)
    for each in (nao, other):
        each.walk(0.5, 0.0, 0.3)
    for _ in range(100):
        other.wait(0.1)
        nao.wait(0.1)
        assert [other.read() for _ in range(3)] == [nao.read()] * 3


def test_thinking_on_the_same_clock_moves_the_robot():
    clock = WorkClock(Machine("slow").with_rate("think", 0.5), start=40.0)
    nao = SimulatedNao(STANDS, clock)
    action = nao.walk(1.0, 0.0, 0.0)
    clock.spend("think", 10, None)
    assert nao.read().time == pytest.approx(45.0)
    assert nao.read().pose_in_world[0] == pytest.approx((5 - 0.6) * 0.095, abs=0.003)
    assert nao.read().moving
    clock.spend("think", 20, None)
    assert action.poll() is Outcome.DONE


def test_without_noise_it_goes_where_it_is_told_and_knows_it():
    scene = replace(STANDS, start_in_world=(1.0, 2.0, math.pi / 2))
    nao, outcome = walked(scene, 0.4, 0.2, math.pi / 2)
    assert outcome is Outcome.DONE
    assert nao.read().pose_in_world == pytest.approx((0.8, 2.4, math.pi), abs=1e-9)
    assert nao.true_pose_in_world == pytest.approx(nao.read().pose_in_world, abs=1e-9)


def test_a_metre_takes_the_time_that_the_planner_reckons_with():
    nao, _ = walked(STANDS, 1.0, 0.0, 0.0)
    body = Body()
    assert nao.now() == pytest.approx(1.0 / body.speed + body.step_phase, abs=0.13)


@pytest.mark.parametrize("posture", POSTURES)
def test_it_walks_only_when_it_stands(posture):
    nao, outcome = walked(replace(STANDS, posture=posture), 0.2, 0.0, 0.0)
    assert outcome is (Outcome.DONE if posture in UPRIGHT else Outcome.REFUSED)
    assert (nao.read().pose_in_world[0] > 0) == (posture in UPRIGHT)


def test_with_auto_stand_it_stands_up_first():
    nao, outcome = walked(replace(STANDS, posture="Sit", auto_stand=True), 0.2, 0.0, 0.0)
    assert outcome is Outcome.DONE
    assert nao.read().posture == "Stand"
    assert nao.read().pose_in_world[0] == pytest.approx(0.2)


def test_who_lies_does_not_walk_with_auto_stand_either():
    wall = Obstacle((0.5, 0.0), size=(0.1, 2.0))
    nao, _ = walked(replace(STANDS, obstacles=(wall,), auto_stand=True), 1.0, 0.0, 0.0)
    assert nao.read().fallen
    assert nao.walk(-0.2, 0.0, 0.0).poll() is Outcome.REFUSED


@pytest.mark.parametrize("bad", [(math.nan, 0, 0), (math.inf, 0, 0), (1e9, 0, 0), (0, 0, -1e5)])
def test_a_walk_that_makes_no_sense_is_refused(bad):
    assert walked(STANDS, *bad)[1] is Outcome.REFUSED


def test_an_unknown_posture_is_refused_and_disturbs_nothing():
    nao = SimulatedNao(STANDS)
    walk = nao.walk(0.3, 0.0, 0.0)
    assert nao.posture("Headstand").poll() is Outcome.REFUSED
    assert walk.poll() is None


@pytest.mark.parametrize(("begin", "end"), itertools.permutations(range(6), 2))
def test_postures_take_their_time(begin, end):
    nao = SimulatedNao(replace(STANDS, posture=POSTURES[begin]))
    action = nao.posture(POSTURES[end])
    seconds = float(Body().posture_seconds[begin, end])
    nao.wait(seconds - 0.1)
    assert action.poll() is None
    assert nao.read().posture == UNKNOWN
    assert nao.walk(0.1, 0, 0).poll() is Outcome.REFUSED
    nao.wait(0.2)
    assert action.poll() is Outcome.DONE
    assert nao.read().posture == POSTURES[end]


def test_a_posture_broken_off_half_way_is_half_way_from_either():
    nao = SimulatedNao(replace(STANDS, posture="Sit"))
    action = nao.posture("Stand")
    nao.wait(4.0)
    action.cancel()
    action.cancel()
    nao.wait(3.0)
    assert action.poll() is Outcome.CANCELLED
    assert nao.read().posture == UNKNOWN
    again = nao.posture("Stand")
    nao.wait(3.9)
    assert again.poll() is None
    nao.wait(0.2)
    assert again.poll() is Outcome.DONE


def test_a_new_command_takes_the_place_of_the_old_one():
    nao = SimulatedNao(STANDS)
    first = nao.walk(1.0, 0.0, 0.0)
    nao.wait(3.0)
    second = nao.posture("Crouch")
    assert first.poll() is Outcome.CANCELLED
    here = nao.read().pose_in_world[0]
    assert until_ended(nao, second) is Outcome.DONE
    assert nao.read().pose_in_world[0] == pytest.approx(here, abs=0.003)


def test_who_walks_already_goes_on_without_starting_anew():
    nao, body = SimulatedNao(STANDS), Body()
    nao.walk(1.0, 0.0, 0.0)
    nao.wait(3.0)
    before = nao.read().pose_in_world[0]
    nao.walk(0.0, 0.5, 0.0)
    nao.wait(2.0)
    x, y, _ = nao.read().pose_in_world
    assert (x, y) == pytest.approx((before, 2.0 * body.speed), abs=0.005)
    nao.stop()
    nao.wait(0.1)
    nao.walk(0.0, 0.5, 0.0)
    nao.wait(2.0)
    assert nao.read().pose_in_world[1] - y == pytest.approx(1.4 * body.speed, abs=0.005)


def test_after_closing_there_is_nobody():
    nao = SimulatedNao(STANDS)
    action = nao.walk(1.0, 0.0, 0.0)
    nao.close()
    assert action.poll() is Outcome.CANCELLED
    assert nao.walk(1.0, 0.0, 0.0).poll() is Outcome.LINK_LOST
    with pytest.raises(LinkLostError, match="closed"):
        nao.read()


def test_standing_up_turns_it_and_odometry_tells_all_but_a_part():
    seen, hidden = [], []
    for seed in range(100):
        nao = SimulatedNao(Scene(seed=seed), tick=0.2)
        until_ended(nao, nao.posture("Stand"))
        seen.append(nao.read().pose_in_world[2])
        hidden.append(nao.true_pose_in_world[2] - seen[-1])
    assert np.mean(seen) == pytest.approx(0.13, abs=0.007)
    assert np.std(seen) == pytest.approx(0.02, rel=0.25)
    assert np.mean(hidden) == pytest.approx(0.0, abs=0.01)
    assert np.std(hidden) == pytest.approx(0.03, rel=0.25)


def test_sitting_down_does_not_turn_it():
    nao = SimulatedNao(Scene(posture="Stand"))
    until_ended(nao, nao.posture("Sit"))
    assert nao.true_pose_in_world == (0.0, 0.0, 0.0)


def ends(noise, tick, runs=80):
    """Where a metre ahead ends, true and reported, float [runs, 2, 3]."""
    told = []
    for seed in range(runs):
        scene = Scene(posture="Stand", noise=noise, seed=seed)
        nao, _ = walked(scene, 1.0, 0.0, 0.0, tick=tick)
        told.append((nao.true_pose_in_world, nao.read().pose_in_world))
    return np.array(told)


def test_the_spread_after_a_metre_does_not_depend_on_the_tick():
    random = MotionNoise(scale=0.0, turning=0.0)
    noise = replace(NOISELESS, execution=random, odometry=random)
    for tick in (0.04, 0.2):
        found = ends(noise, tick)
        for spread in (found[:, 0].std(axis=0), (found[:, 1] - found[:, 0]).std(axis=0)):
            # heading errors add to what is sideways: 0.02² + (0.073 m)² / 3
            assert spread == pytest.approx([0.021, 0.046, 0.071], rel=0.3)


def test_execution_and_odometry_err_apart():
    blind = ends(replace(NOISELESS, execution=MotionNoise()), 0.05, 20)
    assert np.abs(blind[:, 0] - blind[:, 1]).max() < 1e-9
    assert np.abs(blind[:, 0] - [1.0, 0.0, 0.0]).max() > 0.02
    lost = ends(replace(NOISELESS, odometry=MotionNoise()), 0.05, 20)
    assert np.abs(lost[:, 0] - [1.0, 0.0, 0.0]).max() < 1e-9
    assert np.abs(lost[:, 1] - lost[:, 0]).max() > 0.02


def test_the_systematic_part_is_one_for_a_robot():
    lame = replace(NOISELESS, execution=replace(SILENT, scale=0.2, turning=0.3))
    nao = SimulatedNao(Scene(posture="Stand", noise=lame))
    turns = []
    for _ in range(2):
        before = nao.true_pose_in_world[2]
        until_ended(nao, nao.walk(0.5, 0.0, 0.0))
        turns.append(nao.true_pose_in_world[2] - before)
    assert turns[0] == pytest.approx(turns[1])
    assert abs(turns[0]) > 0.01


def test_one_source_of_noise_leaves_the_others_as_they_are():
    loud, quiet = SimulatedNao(Scene()), SimulatedNao(Scene(noise=replace(Noise(), sonar=False)))
    for nao in (loud, quiet):
        until_ended(nao, nao.posture("Stand"))
        until_ended(nao, nao.walk(0.3, 0.1, 0.2))
    assert loud.true_pose_in_world == quiet.true_pose_in_world
    assert loud.read().pose_in_world == quiet.read().pose_in_world


WALLS = (
    Obstacle((0.5, 0.0), size=(0.02, 4.0), turned=0.2),
    Obstacle((-0.6, 0.0), radius=0.2),
    Obstacle((0.0, 0.7), size=(3.0, 0.1)),
)


@settings(max_examples=12, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-2, 2)), max_size=4),
    st.integers(0, 99),
)
def test_it_is_never_deeper_than_5_mm_in_a_wall_and_never_walks_when_it_lies(ways, seed):
    nao = SimulatedNao(Scene(posture="Stand", obstacles=WALLS, seed=seed))
    for way in ways:
        action = nao.walk(*way)
        for _ in range(200):
            before = nao.read()
            nao.wait(0.1)
            here, after = nao.true_pose_in_world, nao.read()
            for wall in WALLS:
                assert wall.clearance(here[:2]) > RADIUS - 0.005
            if before.fallen:
                assert not after.moving
                assert after.posture == LYING
                assert after.pose_in_world == pytest.approx(before.pose_in_world, abs=0.005)
            if action.poll() is not None:
                break
        if nao.read().fallen:
            assert nao.walk(0.1, 0.0, 0.0).poll() is Outcome.REFUSED
            assert until_ended(nao, nao.posture("Stand")) in (Outcome.DONE, Outcome.FAILED)


def test_walking_into_a_wall_is_a_fall_and_it_gets_up_and_walks_away():
    wall = Obstacle((0.5, 0.0), size=(0.1, 2.0))
    nao, outcome = walked(replace(STANDS, obstacles=(wall,)), 1.0, 0.0, 0.0)
    assert outcome is Outcome.FELL
    assert (nao.falls, nao.world.contacts) == (1, 1)
    assert wall.clearance(nao.true_pose_in_world[:2]) == pytest.approx(RADIUS, abs=0.003)
    assert nao.read().fallen
    assert nao.read().posture == LYING
    fell = nao.now()
    assert until_ended(nao, nao.posture("Stand")) is Outcome.DONE
    body = Body()
    assert nao.now() - fell == pytest.approx(body.fall_seconds + 2.0, abs=0.2)
    assert until_ended(nao, nao.walk(-0.3, 0.1, 0.0)) is Outcome.DONE
    assert nao.falls == 1


def test_walking_along_a_wall_is_no_fall():
    wall = Obstacle((0.0, -0.2 - RADIUS - 0.0005), size=(4.0, 0.4))
    nao, outcome = walked(replace(STANDS, obstacles=(wall,)), 0.5, 0.0, 0.0)
    assert outcome is Outcome.DONE
    assert nao.true_pose_in_world[:2] == pytest.approx((0.5, 0.0), abs=1e-3)


def test_getting_up_fails_as_often_as_it_should():
    wall = Obstacle((0.35, 0.0), size=(0.1, 2.0))
    tries = failures = 0
    for seed in range(30):
        scene = Scene(posture="Stand", obstacles=(wall,), seed=seed)
        nao, _ = walked(
            replace(scene, noise=replace(NOISELESS, get_up=0.7)), 1.0, 0.0, 0.0, tick=0.1
        )
        while nao.read().fallen:
            tries += 1
            failures += until_ended(nao, nao.posture("Stand")) is Outcome.FAILED
    assert failures / tries == pytest.approx(0.3, abs=0.2)


def test_falls_without_a_cause_come_by_the_metre():
    clumsy = replace(NOISELESS, falls=0.5)
    fell = [
        walked(replace(STANDS, noise=clumsy, seed=seed), 1.0, 0.0, 0.0, tick=0.1)[1] is Outcome.FELL
        for seed in range(100)
    ]
    assert np.mean(fell) == pytest.approx(1 - math.exp(-0.5), abs=0.15)


def test_what_comes_along_knocks_it_over_without_shoving_it_and_turns_back():
    comer = Obstacle((1.0, 0.0), radius=0.1, velocity=(-0.2, 0.0))
    nao = SimulatedNao(replace(STANDS, obstacles=(comer,)))
    nao.wait(6.0)
    assert nao.falls == 1
    assert nao.true_pose_in_world[:2] == pytest.approx((0.0, 0.0), abs=0.006)
    ((_, at),) = nao.world.obstacles()
    assert at[0] > 0.3


def test_what_sits_is_not_knocked_over():
    comer = Obstacle((1.0, 0.0), radius=0.1, velocity=(-0.2, 0.0))
    nao = SimulatedNao(replace(STANDS, posture="Sit", obstacles=(comer,)))
    nao.wait(20.0)
    assert nao.falls == 0
    assert nao.true_pose_in_world[:2] == pytest.approx((0.0, 0.0), abs=0.006)


def test_obstacles_come_and_go_when_they_should_and_the_sonars_hear_it():
    box = Obstacle((0.8, 0.0), size=(0.2, 1.0), appears=1.0, vanishes=3.0)
    nao = SimulatedNao(replace(STANDS, obstacles=(box,)))
    heard = []
    for _ in range(40):
        nao.wait(0.1)
        heard.append(nao.read().sonars[0] < math.inf)
    assert heard == [1.0 <= round(0.1 * count, 3) < 3.0 for count in range(1, 41)]


def test_nothing_appears_inside_the_robot():
    box = Obstacle((0.1, 0.0), radius=0.1, appears=0.5)
    nao = SimulatedNao(replace(STANDS, obstacles=(box,)))
    nao.wait(2.0)
    assert not nao.world.obstacles()
    until_ended(nao, nao.walk(-0.3, 0.0, 0.0))
    assert len(nao.world.obstacles()) == 1
    assert nao.true_pose_in_world[0] == pytest.approx(-0.3, abs=1e-6)


def test_a_secure_body_ends_a_walk_before_it_touches():
    wall = Obstacle((0.8, 0.0), size=(0.1, 2.0))
    nao, outcome = walked(replace(STANDS, obstacles=(wall,), secure=0.3), 1.0, 0.0, 0.0)
    assert outcome is Outcome.FAILED
    assert nao.world.contacts == 0


def test_the_sonars_are_held_between_their_samples():
    nao = SimulatedNao(replace(CROWD, noise=Noise()))
    heard = []
    for _ in range(100):
        heard.append(nao.read().sonars)
        nao.wait(0.02)
    for start in range(0, 100, 5):
        assert len(set(heard[start : start + 5])) == 1
    assert len(set(heard)) > 5


@settings(max_examples=12, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("walk"), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
            st.tuples(st.just("posture"), st.sampled_from([*POSTURES, "Unknown"]), st.none()),
            st.tuples(st.just("stop"), st.none(), st.none()),
            st.tuples(st.just("wait"), st.floats(0, 5), st.none()),
        ),
        max_size=8,
    )
)
def test_every_action_ends_and_walks_only_upright(commands):
    nao = SimulatedNao(replace(CROWD, seed=3))
    actions = []
    for command, first, second in commands:
        before = nao.read()
        if command == "walk":
            actions.append(nao.walk(first, second, 0.2))
            if before.posture not in UPRIGHT:
                assert actions[-1].poll() is Outcome.REFUSED
        elif command == "posture":
            actions.append(nao.posture(first))
        elif command == "wait":
            nao.wait(first)
        else:
            nao.stop()
        if nao.read().moving:
            assert nao.read().posture in UPRIGHT
    nao.wait(30.0)
    assert all(isinstance(action.poll(), Outcome) for action in actions)


def test_time_does_not_run_backwards():
    with pytest.raises(AnytimeError, match="advance"):
        SimulatedNao(STANDS).wait(-1.0)
