"""A NAO learns how far standing up turns it, and the second run is better for it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from anytime.__main__ import main
from anytime.errors import AnytimeError
from monitor.endings import Ending
from monitor.logs import read_log
from monitor.robots.nao_drift import Drift, read_drift, write_drift
from monitor.robots.nao_missions import brief
from monitor.robots.nao_scenes import Goal, Scene

STOOD = 9.5  # seconds after which it stands and has begun to walk


def test_each_time_that_it_stands_up_it_is_surer():
    believed = [Drift()]
    for turned in (0.12, 0.14, 0.13):
        believed.append(believed[-1].learn(turned))
    assert believed[-1].mean == pytest.approx(0.13, abs=0.01)
    assert sorted((each.variance for each in believed), reverse=True) == [
        each.variance for each in believed
    ]


def test_who_knows_nothing_believes_the_first_time_that_it_stands_up():
    learnt = Drift(0.0, 1e20, 0.02).learn(0.13)
    assert learnt.mean == pytest.approx(0.13)
    assert learnt.variance == pytest.approx(0.02**2)


def surprise(report):
    """By how much the objective of the plan in execution rises while it stands up, in metres."""
    held = [
        each["held"]
        for frame in report.frames
        for each in frame.story["motion"]["comparisons"]
        if not each["idle"] and each["time"] < STOOD
    ]
    return max(after - min(held[: place + 1]) for place, after in enumerate(held))


def test_the_second_run_is_better_than_the_first():
    briefing = brief(problems=3)
    surprises, switches = np.zeros((2, 6, 2))
    for seed in range(6):
        drift = None
        for run in range(2):
            scene = Scene(goal=Goal((1.0, 0.0)), seed=2 * seed + run)
            robot = briefing.robot(scene, drift=drift)
            report = briefing.live(robot, scene.seed)
            assert report.ending is Ending.REACHED
            surprises[seed, run], switches[seed, run] = surprise(report), robot.switches
            drift = robot.drift
        assert drift is not None
        assert drift.mean == pytest.approx(0.13, abs=0.04)
    first, second = surprises.T
    assert second.mean() < 0.6 * first.mean()
    assert (second < first).sum() >= 5
    assert switches[:, 1].mean() < switches[:, 0].mean()


def test_what_was_learnt_is_kept_in_a_file(tmp_path):
    path = tmp_path / "drift.json"
    assert read_drift(path) == Drift()
    learnt = Drift().learn(0.13)
    write_drift(path, learnt)
    assert read_drift(path) == learnt


@pytest.mark.parametrize("change", [{"variance": 0.0}, {"mean": "left"}, {"more": 1}, None])
def test_a_file_that_is_none_of_ours_is_refused_in_one_line(tmp_path, change):
    path = tmp_path / "drift.json"
    write_drift(path, Drift())
    told = json.loads(path.read_text()) | change if change else []
    path.write_text(json.dumps(told))
    with pytest.raises(AnytimeError, match=r"drift\.json") as refused:
        read_drift(path)
    assert "\n" not in str(refused.value)


def test_the_command_reads_and_writes_it(tmp_path, capsys):
    scene, file = tmp_path / "scene.toml", tmp_path / "drift.json"
    scene.write_text("[goal]\nat = [0.3, 0.0]\n")
    run = ["run", str(scene), "--drift", str(file), "--log", str(tmp_path), "--json"]
    learnt = []
    for _ in range(2):
        assert main(run) == 0
        learnt.append(read_drift(file))
        told = json.loads(capsys.readouterr().out)["drift_rad"]
        assert math.isclose(told, learnt[-1].mean, abs_tol=1e-6)
    assert learnt[1].variance < learnt[0].variance < Drift().variance
    file.write_text("[]")
    assert main(run) == 2
    assert "drift.json" in capsys.readouterr().err


def test_where_it_cannot_be_written_the_page_is_there_all_the_same(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    scene.write_text("[goal]\nat = [0.3, 0.0]\n")
    nowhere = Path("/proc/drift.json")
    assert main(["run", str(scene), "--drift", str(nowhere), "--log", str(tmp_path)]) == 2
    assert "drift.json" in capsys.readouterr().err
    assert (tmp_path / "mission.html").exists()


def test_the_seed_is_that_of_the_scene_unless_another_is_given(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text("seed = 5\n[goal]\nat = [0.3, 0.0]\n")
    for asked, told in (([], 5), (["--seed", "3"], 3)):
        main(["run", str(scene), "--log", str(tmp_path), *asked])
        assert read_log(tmp_path / "mission.jsonl").mission.seed == told


@pytest.mark.parametrize(
    "asked", ["--policy=paper", "--map=a.map", "--start=1,1", "--goal=1,1", "--regret=3"]
)
def test_what_only_a_robot_on_cells_can_do_is_refused(tmp_path, capsys, asked):
    scene = tmp_path / "scene.toml"
    scene.write_text("[goal]\nat = [0.3, 0.0]\n")
    assert main(["run", str(scene), asked]) == 2
    assert "is for a grid mission" in capsys.readouterr().err


def test_a_robot_on_cells_learns_no_drift(tmp_path, capsys):
    mission = tmp_path / "mission.toml"
    mission.write_text("[mission]\n")
    assert main(["run", str(mission), "--drift", str(tmp_path / "drift.json")]) == 2
    assert "is for a NAO's scene" in capsys.readouterr().err
