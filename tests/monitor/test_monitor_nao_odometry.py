"""What of a robot's odometry is believed, and missions that arrive though it jumps or is silent."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import WorkClock
from monitor.endings import Ending
from monitor.robots.nao_body import LinkLostError
from monitor.robots.nao_faults import Fault, Faulty
from monitor.robots.nao_missions import MACHINE, brief
from monitor.robots.nao_odometry import FROZEN, Odometry, compose
from monitor.robots.nao_scenes import Goal, Scene
from monitor.robots.nao_world import Obstacle
from monitor.robots.simulated_nao import SimulatedNao

SCENE = Scene(
    posture="Stand", goal=Goal((0.9, 0.0)), obstacles=(Obstacle((0.5, 0.05), radius=0.08),)
).noiseless()


def test_who_walks_and_turns_at_its_speed_is_believed_to_the_bit():
    nao, odometry = SimulatedNao(Scene(posture="Stand", seed=2)), Odometry(0.095, 0.42)
    for command, *way in (("walk", 1.0, 0.2, 3.0), ("posture", "Sit"), ("posture", "Stand")):
        action = getattr(nao, command)(*way)
        while action.poll() is None:
            nao.wait(0.1)
            told = nao.read()
            believed = odometry.believe(told.time, told.pose_in_world, told.moving)
            assert believed == told.pose_in_world
    assert odometry.jumps == 0


pose = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))


@given(pose, pose, pose)
def test_a_jump_leaves_the_robot_where_it_was_and_what_follows_counts_from_there(first, second, by):
    odometry = Odometry(0.095, 0.42)
    odometry.believe(0.0, first, True)
    at_jump = odometry.believe(0.1, second, True)
    if odometry.jumps:
        assert at_jump == pytest.approx(first, abs=1e-9)
    step = (0.01 * math.tanh(by[0]), 0.01 * math.tanh(by[1]), 0.01)
    after = odometry.believe(0.2, compose(second, step), True)
    assert after[:2] == pytest.approx(compose(at_jump, step)[:2], abs=1e-6)


@pytest.mark.parametrize("bad", [None, [], [0.0, math.nan, 0.0], "abc", [1.0, 2.0], [0, 0, None]])
def test_what_is_no_pose_is_passed_over_for_a_second(bad):
    odometry = Odometry(0.095, 0.42)
    with pytest.raises(LinkLostError, match="where it is"):
        odometry.believe(0.0, bad, True)
    assert odometry.believe(0.0, (1.0, 2.0, 3.0), True) == (1.0, 2.0, 3.0)
    assert odometry.believe(0.9, bad, True) == (1.0, 2.0, 3.0)
    with pytest.raises(LinkLostError, match="where it is"):
        odometry.believe(1.1, bad, True)
    assert odometry.believe(1.2, (1.01, 2.0, 3.0), True) == (1.01, 2.0, 3.0)


def test_what_was_walked_unseen_is_no_jump_but_who_stood_cannot_have_walked():
    walked, stood = Odometry(0.095, 0.42), Odometry(0.095, 0.42)
    for step in range(41):
        walked.believe(0.1 * step, (0.0, 0.0, 0.0), True)
        stood.believe(0.1 * step, (0.0, 0.0, 0.0), False)
    assert walked.unseen == pytest.approx(4.0)
    assert stood.unseen == 0.0
    assert walked.believe(4.1, (0.38, 0.0, 0.0), True) == (0.38, 0.0, 0.0)
    assert stood.believe(4.1, (0.38, 0.0, 0.0), True) == (0.0, 0.0, 0.0)
    assert (walked.jumps, stood.jumps) == (0, 1)


def test_a_heading_that_wraps_is_no_jump():
    odometry = Odometry(0.095, 0.42)
    odometry.believe(0.0, (0.0, 0.0, 3.13), True)
    assert odometry.believe(0.1, (0.0, 0.0, -3.13), True) == (0.0, 0.0, -3.13)
    assert odometry.jumps == 0


@pytest.fixture(scope="module")
def briefing():
    return brief(problems=3)


def lived(briefing, seed, *faults, scene=SCENE):
    """A mission with faults: its report, its robot, and how far from the goal it truly ended."""
    clock = WorkClock(MACHINE)
    body = SimulatedNao(scene, clock)
    robot = briefing.robot(scene, body=Faulty(body, faults), clock=clock)
    robot.query.step(seed)  # another search, hence other plans
    report = briefing.live(robot, seed)
    assert not report.fault
    return report, robot, math.dist(body.true_pose_in_world[:2], scene.goal.at)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("fault", "jumps", "within"),
    [
        (Fault("odometry-jump", 4.0), 1, 0.07),
        (Fault("odometry-jump", 4.0, 7.0), 2, 0.08),  # there, and back again
        (Fault("odometry-nan", 4.0, 4.5), 0, 0.06),
        (Fault("odometry-frozen", 4.0, 9.0), 0, 0.06),
    ],
    ids=["jump", "jump and back", "nan", "frozen"],
)
def test_the_goal_is_truly_reached_whatever_odometry_does_on_the_way(
    briefing, seed, fault, jumps, within
):
    report, robot, error = lived(briefing, seed, fault)
    assert report.ending is Ending.REACHED
    assert robot.odometry.jumps == jumps
    assert error <= within
    told = [what for frame in report.frames for _, what in frame.story["motion"]["events"]]
    assert told.count("odometry jumped") == jumps


def test_who_never_sees_that_it_walks_is_stopped_after_some_tries(briefing):
    report, robot, _ = lived(briefing, 0, Fault("odometry-frozen", 4.0))
    assert report.ending is Ending.LINK_LOST
    assert robot.driven() < 4.0 + 4 * FROZEN
    assert robot.odometry.unseen < 4 * FROZEN
    assert not robot.body.read().moving


def test_who_is_not_told_where_it_is_ends_the_mission(briefing):
    report, robot, _ = lived(briefing, 0, Fault("odometry-nan", 4.0))
    assert report.ending is Ending.LINK_LOST
    assert not robot.body.read().moving
