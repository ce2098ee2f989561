"""Missions of the grid robot: endings, the ledger, the same bytes."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from anytime import AnytimeError, WorkClock
from experiments import crossings
from monitor import Ending, Energy, Mission, Monitor, Value
from monitor.logs import read_log
from monitor.policies import constant
from monitor.robots.briefing import QUICK, brief
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE, GridMission
from sensing.random_maps import corner_to_corner, rooms, uniform
from sensing.vision import Vision

PROGRAM = crossings.compiled()
STEADY = constant(dict(zip(PROGRAM.labels, (1.0, 0.5), strict=True)), 4.0)
MISSION = Mission(Value("exponential", 100.0, 200.0), Energy(0.2, 0.08, 0.03, 0.01), job=1.5)


def scene(density=0.2, size=64, seed=0, **changes) -> Scene:
    free = uniform(size, density, np.random.default_rng(seed))
    start, goal = corner_to_corner(free)
    return Scene(free, start, goal, device=Vision(2, 24), **changes)


def live(floor: Scene, mission=MISSION, policy=STEADY, seed=0):
    robot = GridRobot(floor, mission.energy, WorkClock(REFERENCE))
    return Monitor(PROGRAM, policy, "steady").run(mission, robot, seed=seed), robot


def test_the_ledger_of_time_adds_up():
    report, robot = live(scene())
    assert report.ending is Ending.REACHED
    ledger = report.ledger
    assert ledger["drive"] + ledger["wait"] + ledger["job"] == pytest.approx(report.seconds)
    for frame in report.frames:
        assert frame.driven <= frame.ended - frame.started + 1e-9
        thought = sum(call.elapsed for call in frame.calls)
        assert thought <= frame.ended - frame.started + 1e-9
    assert robot.walked == pytest.approx(sum(f.story["length"] for f in report.frames))


def test_energy_is_power_by_speed_while_moving_and_idle_power_while_standing():
    report, _ = live(scene())
    model = MISSION.energy
    expected = report.ledger["drive"] * float(model.power(4.0))
    expected += (report.seconds - report.ledger["drive"]) * model.idle
    assert report.energy == pytest.approx(expected)
    assert report.net == pytest.approx(
        float(MISSION.value(report.seconds)) - model.price * report.energy
    )


def test_the_robot_is_where_the_clock_says():
    floor = scene()
    clock = WorkClock(REFERENCE)
    robot = GridRobot(floor, MISSION.energy, clock)
    deadline = clock.now() + 10
    from anytime import Deadline

    stages = PROGRAM.stages(STEADY.decision.shares, Deadline(clock, deadline), robot.inputs())
    plan = dict(stages)["find_path"].value
    robot.begin(plan, 2.0)
    clock.advance(1.0)
    one = robot.at()
    clock.advance(1.0)
    assert robot.at() != one
    assert robot.driven() == pytest.approx(2.0)
    robot.change_speed(4.0)
    robot.complete()
    assert robot.at() == robot.cell
    before = clock.now()
    robot.complete()
    assert clock.now() == before


@pytest.mark.parametrize("kind", crossings.KINDS)
def test_connected_is_reached_and_cut_off_is_named(kind):
    for index in range(4):
        there = crossings.crossing(kind, index, reachable=True)
        assert crossings.cross(PROGRAM, there) is Ending.REACHED
        nowhere = crossings.crossing(kind, index, reachable=False)
        assert crossings.cross(PROGRAM, nowhere) is Ending.UNREACHABLE


def test_a_task_that_is_worth_nothing_any_more_is_ended():
    mission = replace(MISSION, value=Value("hard", 100.0, 5.0))
    report, _ = live(scene(), mission)
    assert report.ending is Ending.DEADLINE
    assert report.earned == 0
    assert report.net < 0


def test_a_goal_underfoot_needs_no_frame():
    floor = scene()
    report, _ = live(replace(floor, goal=floor.start))
    assert report.ending is Ending.REACHED
    assert report.frames == ()
    assert report.seconds == MISSION.job


def test_a_mission_never_raises():
    class Broken(GridRobot):
        def inputs(self):
            raise OSError("the camera fell off")

    robot = Broken(scene(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, STEADY).run(MISSION, robot)
    assert report.ending is Ending.REACHED  # by touch alone
    assert "camera fell off" in report.fault


def test_a_robot_that_cannot_even_stop_ends_the_mission_all_the_same():
    class Lost(GridRobot):
        def complete(self):
            raise ConnectionError("no answer")

        def stop(self):
            raise ConnectionError("no answer")

    robot = Lost(scene(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, STEADY).run(MISSION, robot)
    assert report.ending is Ending.LINK_LOST
    with pytest.raises(AnytimeError, match="seed"):
        Monitor(PROGRAM, STEADY).run(MISSION, robot, seed=-1)


class Planned(GridRobot):
    """A robot that goes nowhere without a plan."""

    avoid = None  # type: ignore[assignment]


HASTY = constant(dict(zip(PROGRAM.labels, (0.0, 0.0), strict=True)), 4.0)


def test_without_a_plan_obstacle_avoidance_alone_reaches_the_goal():
    report, robot = live(scene(), policy=HASTY)
    assert report.ending is Ending.REACHED
    assert robot.cell == robot.scene.goal


def test_modules_that_never_have_a_result_end_the_mission_of_a_robot_that_needs_plans():
    robot = Planned(scene(), MISSION.energy, WorkClock(REFERENCE))
    report = Monitor(PROGRAM, HASTY).run(MISSION, robot)
    assert report.ending is Ending.MODULES_FAILED
    assert robot.cell == robot.scene.start


def test_start_and_goal_must_be_free_cells_of_the_map():
    floor = scene()
    blocked = tuple(int(at) for at in np.argwhere(~floor.free)[0])
    with pytest.raises(AnytimeError, match="inside an obstacle"):
        replace(floor, start=blocked)
    with pytest.raises(AnytimeError, match="off the map"):
        replace(floor, goal=(999, 0))
    with pytest.raises(AnytimeError, match="half the radius"):
        replace(floor, frame=30.0)


def test_a_frame_walks_on_plans_that_were_made_while_the_one_before_was_walked():
    report, _ = live(scene(density=0.0))
    moving = [frame for frame in report.frames if not frame.standing]
    assert len(moving) >= 3
    assert sum(frame.standing for frame in report.frames) == 1  # the first one, to get a plan
    assert all(frame.calls for frame in report.frames[:-1])
    assert not report.frames[-1].calls  # the last frame needs no further plan


def small_briefing():
    free = rooms(64, np.random.default_rng(3))
    start, goal = corner_to_corner(free)
    mission = Mission(Value("soft", 100.0, 40.0), Energy(0.2, 0.08, 0.03))
    from experiments import shipped

    grid = GridMission(mission, Scene(free, start, goal, device=Vision(2, 24)), REFERENCE)
    return brief(grid, shipped.profiles(), QUICK)


def test_the_monitor_lives_a_mission_with_every_policy(tmp_path):
    briefing = small_briefing()
    for policy in ("expected", "paper", "min", "max"):
        monitor = briefing.monitor(policy)
        report = briefing.live(monitor, 0, log=tmp_path / f"{policy}.jsonl")
        assert report.ending is Ending.REACHED
        assert len(repr(report).splitlines()[0]) <= 100
        log = read_log(tmp_path / f"{policy}.jsonl")
        assert log.end is not None
        assert log.end.net == pytest.approx(report.net)
        assert len(log.frames) == len(report.frames)
    with pytest.raises(AnytimeError, match=r"\[fixed\]"):
        briefing.monitor("fixed")
    with pytest.raises(AnytimeError, match="no policy 'best'"):
        briefing.monitor("best")


def test_the_same_seed_gives_the_same_bytes_in_two_processes(tmp_path):
    script = (
        "import sys, pathlib; sys.path.insert(0, sys.argv[1]);"
        "from test_monitor_monitoring import small_briefing;"
        "b = small_briefing(); b.live(b.monitor('expected'), 5, log=pathlib.Path(sys.argv[2]))"
    )
    here = __file__.rpartition("/")[0]
    digests = []
    for name in ("one", "two"):
        log = tmp_path / name / "mission.jsonl"
        subprocess.run([sys.executable, "-c", script, here, str(log)], check=True)
        digests.append(hashlib.sha256(log.read_bytes()).hexdigest())
    assert digests[0] == digests[1]


def corners(size: int = 64) -> Scene:
    """Four goals near the corners of a floor, named in a bad order."""
    free = np.ones((size, size), bool)
    free[size // 3 : 2 * size // 3, size // 2 - 1 : size // 2 + 1] = False
    near, far = 6, size - 7
    also = (far, far), (near, far), (far, near)
    return Scene(free, (size // 2, 6), (near, near), device=Vision(2, 24), also=also)


def test_all_goals_are_visited_in_an_order_that_is_nearly_the_shortest():
    floor = corners()
    report, robot = live(floor)
    assert report.ending is Ending.REACHED
    walked = np.concatenate([np.array(frame.story["path"]) for frame in report.frames])
    for goal in floor.goals:
        assert (walked == goal).all(axis=1).any()
    assert robot.walked < 1.15 * floor.optimal
    given = sum(
        Scene(floor.free, start, goal, device=floor.device).optimal
        for start, goal in pairwise((floor.start, *floor.goals))
    )
    assert robot.walked < 0.9 * given


def test_several_goals_of_which_one_is_walled_in_are_unreachable():
    floor = corners(32)
    free = floor.free.copy()
    row, column = floor.also[0]
    free[row - 1 : row + 2, column - 1 : column + 2] = False
    free[row, column] = True
    report, _ = live(replace(floor, free=free))
    assert report.ending is Ending.UNREACHABLE


def test_a_robot_that_stands_on_one_of_its_goals_has_visited_it():
    floor = replace(corners(32), start=corners(32).goal)
    report, robot = live(floor)
    assert report.ending is Ending.REACHED
    assert robot.walked < 1.3 * floor.optimal


def test_the_work_of_choosing_an_order_is_charged():
    floor = scene()
    aside = tuple(np.argwhere(floor.free[:8, -8:])[0] + (0, 56))
    one, _ = live(floor)
    several, _ = live(replace(floor, also=(aside,)))
    first = [report.frames[0].calls[-1].elapsed for report in (one, several)]
    assert first[1] > first[0]
