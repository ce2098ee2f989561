"""Laws of the mission log."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from monitor import News, Value
from monitor.log_lines import LEVELS
from monitor.logs import Floor, LogWriter, plain, read_log, write_log


def test_a_log_holds_what_the_report_held(tmp_path, mission, floor, report):
    log = read_log(write_log(tmp_path / "a.jsonl", mission, floor, report))
    assert log.end is not None
    assert log.end.net == pytest.approx(report.net)
    assert log.end.ledger == pytest.approx(report.ledger)
    assert len(log.frames) == len(report.frames)
    for line, frame in zip(log.frames, report.frames, strict=True):
        assert line.waited == pytest.approx(frame.waited)
        assert line.moments[0].shares == pytest.approx(frame.decision.shares)
        assert line.moments[0].net == pytest.approx(frame.decision.why.net)
        assert [list(cell) for cell in line.path] == frame.story["path"]
        assert line.story == {"length": 1.4}
    assert log.mission.labels == ("see", "find_path")
    assert log.promised == pytest.approx(report.frames[0].decision.why.net)


def test_what_is_written_during_a_mission_is_what_is_written_after_it(
    tmp_path, mission, floor, report
):
    with LogWriter(tmp_path / "during.jsonl") as writer:
        writer.mission(
            mission,
            policy=report.policy,
            seed=report.seed,
            labels=("see", "find_path"),
            machine=report.machine,
            floor=floor,
        )
        for index, frame in enumerate(report.frames):
            writer.frame(frame)
            assert len(read_log(writer.path).frames) == index + 1
        writer.end(report)
    after = write_log(tmp_path / "after.jsonl", mission, floor, report)
    assert after.read_bytes() == writer.path.read_bytes()


def test_news_is_part_of_a_log_and_of_what_completing_is_worth(tmp_path, mission, floor, report):
    told = replace(mission, news=News(5.0, Value("hard", 30.0, 8.0)))
    line = read_log(write_log(tmp_path / "a.jsonl", told, floor, report)).mission
    assert [line.worth(time) for time in (0.0, 6.0, 9.0)] == [100.0, 30.0, 0.0]
    path = tmp_path / "a.jsonl"
    path.write_bytes(path.read_bytes().replace(b'"at":5.0', b'"at":-5.0', 1))
    with pytest.raises(AnytimeError, match=r"a\.jsonl:1: news\.at is -5"):
        read_log(path)


def test_facts_of_the_wall_lie_beside_the_log(tmp_path, mission, floor, report):
    log = write_log(tmp_path / "a.jsonl", mission, floor, report)
    wall = json.loads((tmp_path / "wall.json").read_text())
    assert wall["versions"]["python"]
    assert wall["started"] not in log.read_text()


def test_the_belief_is_put_together_again_from_its_changes(tmp_path, mission, floor, report):
    log = read_log(write_log(tmp_path / "a.jsonl", mission, floor, report))
    held = np.zeros((12, 15), np.uint8)
    for line, frame in zip(log.frames, report.frames, strict=True):
        if line.belief is not None:
            box = line.belief
            pairs = np.frombuffer(base64.b64decode(box.levels), np.uint8)
            flat = np.stack([pairs >> 4, pairs & 15], axis=1).ravel()[: box.rows * box.columns]
            window = np.s_[box.row : box.row + box.rows, box.column : box.column + box.columns]
            held[window] = flat.reshape(box.rows, box.columns)
        assert np.array_equal(held, np.rint(frame.story["belief"] * LEVELS))


def test_a_huge_map_is_thinned_out(tmp_path, mission, report):
    huge = Floor(np.ones((1200, 900), bool), (0, 0), (1199, 899), radius=4)
    told = replace(report, frames=(replace(report.frames[0], story={"belief": huge.free * 0.2}),))
    log = read_log(write_log(tmp_path / "a.jsonl", mission, huge, told))
    assert log.mission.scene is not None
    assert log.mission.scene.step == 3
    assert log.frames[0].belief is not None
    assert log.frames[0].belief.rows == log.mission.scene.rows == 400


def test_no_number_that_is_none_gets_into_a_log(tmp_path, mission, floor, report):
    told = replace(report, promised=float("nan"))
    assert read_log(write_log(tmp_path / "a.jsonl", mission, floor, told)).end.promised is None


@given(st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_cut_anywhere_is_read_up_to_its_last_whole_line(
    tmp_path, mission, floor, report, data
):
    content = write_log(tmp_path / "a.jsonl", mission, floor, report).read_bytes()
    first = content.index(b"\n") + 1
    cut = data.draw(st.integers(first, len(content)))
    torn = tmp_path / "torn.jsonl"
    torn.write_bytes(content[:cut])
    lines = content[:cut].count(b"\n")
    log = read_log(torn)
    assert 1 + len(log.frames) + (log.end is not None) == lines


@given(st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_log_broken_anywhere_is_read_or_refused_in_one_line(
    tmp_path, mission, floor, report, data
):
    content = bytearray(write_log(tmp_path / "a.jsonl", mission, floor, report).read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] = data.draw(st.integers(0, 255))
    broken = tmp_path / "broken.jsonl"
    broken.write_bytes(content)
    said = str(broken)
    try:
        read_log(broken)
    except AnytimeError as error:
        said = str(error)
    assert said.startswith(str(broken))
    assert "\n" not in said


def changed(path: Path, line: int, text: str) -> Path:
    lines = path.read_text().splitlines()
    lines[line - 1] = text
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{torn", "not JSON"),
        ('{"kind": "frame", "kind": "end"}', "twice"),
        ('{"kind": "frame", "index": NaN}', "NaN"),
        ('{"kind": "rumour"}', "rumour"),
        ("[" * 100_000, ":3: "),
        ('{"kind": "end"}', "missing required field"),
    ],
)
def test_a_broken_line_in_the_middle_is_refused_with_its_place(
    tmp_path, mission, floor, report, text, reason
):
    path = changed(write_log(tmp_path / "a.jsonl", mission, floor, report), 3, text)
    with pytest.raises(AnytimeError, match=r"a\.jsonl:3: ") as caught:
        read_log(path)
    assert reason in str(caught.value)


def test_a_belief_that_lies_off_the_scene_is_refused(tmp_path, mission, floor, report):
    path = write_log(tmp_path / "a.jsonl", mission, floor, report)
    line = json.loads(path.read_text().splitlines()[1])
    line["belief"]["row"] = 5
    with pytest.raises(AnytimeError, match=r":2: .*not within the scene"):
        read_log(changed(path, 2, json.dumps(line)))


@pytest.mark.parametrize(
    ("line", "change", "reason"),
    [
        (1, {"fixed": {"shares": 3}}, ":1: fixed: "),
        (None, {"kind": "regret", "frame": 0, "forks": [[{"other": 1.0}, 1.0, 2.0]]}, "a call"),
    ],
    ids=["a fixed division that is none", "a fork of another call"],
)
def test_what_the_page_would_fall_over_is_refused_when_it_is_read(
    tmp_path, mission, floor, report, line, change, reason
):
    path = write_log(tmp_path / "a.jsonl", mission, floor, report)
    if line is None:
        path.write_text(path.read_text() + json.dumps(change) + "\n")
    else:
        changed(path, line, json.dumps(json.loads(path.read_text().splitlines()[0]) | change))
    with pytest.raises(AnytimeError, match=reason):
        read_log(path)


@pytest.mark.parametrize("started", ["1e999", "-5"])
def test_a_frame_at_a_time_that_cannot_be_is_refused(tmp_path, mission, floor, report, started):
    path = write_log(tmp_path / "a.jsonl", mission, floor, report)
    line = json.loads(path.read_text().splitlines()[2])
    told = json.dumps(line | {"started": "here"}).replace('"here"', started)
    changed(path, 3, told)
    with pytest.raises(AnytimeError, match="it must begin at"):
        read_log(path)


def test_an_empty_file_and_no_file_are_no_logs(tmp_path):
    (tmp_path / "empty.jsonl").touch()
    with pytest.raises(AnytimeError, match="first line must be the mission"):
        read_log(tmp_path / "empty.jsonl")
    with pytest.raises(AnytimeError, match="no such file"):
        read_log(tmp_path / "nothing.jsonl")


def test_a_writer_refuses_what_is_out_of_order(tmp_path, mission, report):
    with pytest.raises(AnytimeError, match="not open"):
        LogWriter(tmp_path / "a.jsonl").end(report)
    with (
        LogWriter(tmp_path / "a.jsonl") as writer,
        pytest.raises(AnytimeError, match="mission before its frames"),
    ):
        writer.frame(report.frames[0])


def test_only_plain_data_is_logged():
    assert plain({"a": np.float32(0.5), 1: (np.int32(2), np.True_, np.inf)}) == {
        "a": 0.5,
        "1": [2, True, None],
    }
    with pytest.raises(AnytimeError, match="object cannot be logged"):
        plain(object())


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_rounding_twice_is_rounding_once(value):
    assert plain(plain(value)) == plain(value)
