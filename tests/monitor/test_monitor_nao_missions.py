"""A NAO's missions: briefed once, lived in any scene, logged for the same page as the grid's."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from anytime.__main__ import main
from monitor.endings import Ending
from monitor.logs import read_log
from monitor.page import write_page
from monitor.robots.nao_floor import RESOLUTION, plan_of
from monitor.robots.nao_missions import brief
from monitor.robots.nao_scenes import Goal, Scene, is_scene, read_scene
from monitor.robots.nao_world import Obstacle

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "experiments" / "data" / "scenes"


@pytest.fixture(scope="module")
def briefing():
    return brief(problems=3)


def test_a_mission_is_logged_as_cells_of_its_scene(briefing, tmp_path):
    scene = read_scene(SCENES / "removed_late.toml", seed=1)
    robot = briefing.robot(scene)
    report = briefing.log(robot, scene, tmp_path / "mission.jsonl")
    assert report.ending is Ending.REACHED
    log = read_log(tmp_path / "mission.jsonl")
    assert len(log.frames) == len(report.frames)
    floor = plan_of(scene)
    row, column, _ = log.frames[-1].motion.track[-1]
    ended = floor.cell(*robot.reading.pose_in_world[:2])
    assert (math.floor(row), math.floor(column)) == ended
    assert "NAO" in write_page([log], tmp_path / "mission.html").read_text().upper()


def test_a_floor_holds_everything_of_its_scene():
    scene = Scene(goal=Goal((2.0, 0.5)), obstacles=(Obstacle((1.0, -0.4), 0.2),))
    drawn = plan_of(scene)
    free = drawn.floor.free
    assert not free[drawn.cell(1.0, -0.4)]
    assert free[drawn.floor.start]
    assert free[drawn.floor.goal]
    assert (~free).sum() * RESOLUTION**2 == pytest.approx(math.pi * 0.2**2, rel=0.1)
    assert drawn.cell(0.0, 9.0)[0] == 0
    assert drawn.cell(0.0, 0.5)[0] < drawn.cell(0.0, 0.0)[0]


def test_without_the_monitor_the_first_plan_is_executed_to_its_end(briefing):
    scene = read_scene(SCENES / "appearing.toml", seed=3)
    fixed = briefing.unmonitored().robot(scene)
    report = briefing.unmonitored().live(fixed, 3)
    assert fixed.plans == 1
    assert not report.frames[-1].calls  # nobody thinks meanwhile
    assert len(report.frames) < 5


def test_without_the_monitor_a_fall_is_the_end(briefing):
    scene = Scene(goal=Goal((1.5, 0.0)), obstacles=(Obstacle((0.6, 0.0), 0.15, appears=9.5),))
    fixed = briefing.unmonitored().robot(scene.noiseless())
    assert briefing.unmonitored().live(fixed).ending is Ending.FALLEN
    assert fixed.falls == 1


def test_the_command_tells_a_scene_from_a_grid_mission(tmp_path, capsys):
    assert is_scene(SCENES / "sitting.toml")
    assert not is_scene(ROOT / "experiments" / "data" / "missions" / "office.toml")
    assert not is_scene(tmp_path / "nothing.toml")
    (tmp_path / "m.toml").write_text("[goal]\nvelocity = [0.1, 0.0]\n")
    assert main(["run", str(tmp_path / "m.toml")]) == 2
    assert "missing required field `at`" in capsys.readouterr().err
    code = main(["run", str(SCENES / "removed_early.toml"), "--log", str(tmp_path), "--json"])
    assert code == 0
    assert '"ending": "reached"' in capsys.readouterr().out
    assert (tmp_path / "mission.html").exists()
    bad = main(["run", str(SCENES / "sitting.toml"), "--robot", "somewhere"])
    assert bad == 2
    assert "give simulated, or naoqi:tcp" in capsys.readouterr().err
