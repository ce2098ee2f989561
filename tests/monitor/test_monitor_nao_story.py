"""What a NAO tells of its mission, in metres, and how the log holds it, in cells."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from monitor.logs import read_log
from monitor.robots.nao_body import Reading
from monitor.robots.nao_floor import RESOLUTION, plan_of
from monitor.robots.nao_missions import brief
from monitor.robots.nao_scenes import Goal, read_scene
from monitor.robots.nao_story import Story
from sensing.sonar import MOUNTS, Sonars
from sensing.sonar_map import SonarMap

SCENES = Path(__file__).resolve().parents[2] / "experiments" / "data" / "scenes"


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A mission with a fall: its scene, its robot, its report, and its log read again."""
    scene = read_scene(SCENES / "fall.toml", seed=2)
    briefing = brief(problems=3)
    robot = briefing.robot(scene)
    path = tmp_path_factory.mktemp("story") / "mission.jsonl"
    report = briefing.log(robot, scene, path)
    again = path.with_name("again.jsonl")
    briefing.log(briefing.robot(scene), scene, again)
    assert again.read_bytes() == path.read_bytes()
    return scene, robot, report, read_log(path)


def motions(report):
    return [frame.story["motion"] for frame in report.frames]


def comparisons(report):
    return [each for motion in motions(report) for each in motion["comparisons"]]


def test_a_plan_is_taken_up_exactly_if_it_is_better_by_the_threshold(told):
    _, robot, report, _ = told
    for each in comparisons(report):
        assert each["taken"] == (each["found"] < each["held"] - each["threshold"])
    taken = [each for each in comparisons(report) if each["taken"]]
    assert len(taken) == robot.plans
    assert sum(not each["idle"] for each in taken) == robot.switches > 0


def test_the_track_goes_on_from_frame_to_frame_and_ends_where_the_robot_is(told):
    _, robot, report, _ = told
    for before, after in pairwise(motions(report)):
        assert before["track"][-1] == after["track"][0]
    assert motions(report)[-1]["track"][-1] == list(robot.reading.pose_in_world)
    walked = [step for motion in motions(report) for step in pairwise(motion["track"])]
    assert sum(math.dist(a[:2], b[:2]) for a, b in walked) == pytest.approx(
        sum(frame.story["length"] for frame in report.frames)
    )


def test_every_fall_is_told_once_and_in_its_frame(told):
    _, robot, report, _ = told
    events = [
        (frame.started <= time <= frame.ended, what)
        for frame in report.frames
        for time, what in frame.story["motion"]["events"]
    ]
    assert events == [(True, "fell")] * robot.falls
    assert robot.falls > 0


def test_the_plan_and_the_other_one_begin_where_the_robot_was_when_they_were_compared(told):
    *_, report, _ = told
    for motion in motions(report):
        for each in motion["comparisons"]:
            for way in filter(None, (motion["plan"], each["other"])):
                assert math.dist(way[0], motion["track"][0][:2]) < 0.02


def test_no_echo_is_none_and_what_tells_nothing_has_no_cone():
    heard = []
    for sonars in ((math.inf, 0.4), (math.nan, 0.0)):
        story = Story((0.0, 0.0, 0.0))
        reading = Reading(0.0, (1.0, 2.0, 0.5), "Stand", False, False, sonars)
        motion = story.told(
            reading,
            executes=False,
            goal=(1.0, 0.0),
            discs=(),
            clearance=0.2,
            radius=0.15,
            sonars=Sonars(),
        )["motion"]
        heard.append(motion["cones"])
    left, right = heard[0]
    assert (left["heard"], right["heard"]) == (None, 0.4)
    assert left["bearing"] == pytest.approx(0.5 + MOUNTS[0][2])
    assert heard[1] == []


def test_the_log_holds_it_in_cells_of_the_scene(told):
    scene, _, report, log = told
    drawn = plan_of(scene)
    for frame, line in zip(report.frames, log.frames, strict=True):
        motion = frame.story["motion"]
        assert line.motion is not None
        assert line.motion.radius * RESOLUTION == pytest.approx(motion["radius"], abs=1e-3)
        for (x, y, heading), (row, column, turned) in zip(
            motion["track"], line.motion.track, strict=True
        ):
            assert drawn.left + column * RESOLUTION == pytest.approx(x, abs=1e-3)
            assert drawn.top - row * RESOLUTION == pytest.approx(y, abs=1e-3)
            assert turned == pytest.approx(heading, abs=1e-3)
        assert [each.found for each in line.motion.comparisons] == pytest.approx(
            [each["found"] for each in motion["comparisons"]]
        )
        assert not {"path", "plan", "motion", "belief"} & set(line.story)


def test_a_goal_that_moves_is_told_where_it_is():
    scene = replace(read_scene(SCENES / "moving_target.toml"), goal=Goal((0.5, 0.0), (0.0, 0.01)))
    robot = brief(problems=3).robot(scene)
    robot.wait(2.0)
    assert robot.story()["motion"]["goal"] == pytest.approx([0.5, 0.02])


def test_on_the_floor_what_was_heard_to_be_free_differs_from_what_was_not_heard():
    scene = read_scene(SCENES / "sitting.toml").noiseless()
    drawn = plan_of(scene)
    robot = brief(problems=3).robot(scene)
    empty = drawn.believed(SonarMap.around(0.0, 0.0))
    assert np.allclose(empty, drawn.floor.density, atol=1e-6)
    known = robot.hearing.known
    for _, echoes in zip(range(10), robot.hearing.listen(), strict=False):
        known = known.hear(echoes, scene.sonars)
    heard = drawn.believed(known)
    assert heard[drawn.cell(0.3, 0.0)] < 0.5 * drawn.floor.density
    assert heard[drawn.cell(-0.5, 0.0)] == pytest.approx(drawn.floor.density, abs=1e-6)
    assert heard.max() > 0.25
