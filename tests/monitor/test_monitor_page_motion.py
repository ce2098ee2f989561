"""The page of a robot that moves in metres: why it goes on with its plan or takes up another."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import pytest

from anytime.errors import AnytimeError
from monitor.logs import read_log, write_log
from monitor.page import page_data, write_page
from monitor.page.motion import metres


def comparison(time, held, found, threshold=0.03, *, idle=False, taken=False):
    other = () if idle else ((2.0 + time / 2, 3.5), (6.0, 9.0), (9.5, 13.5))
    return {
        "time": time,
        "held": held,
        "found": found,
        "threshold": threshold,
        "idle": idle,
        "taken": taken,
        "other": other,
    }


COMPARISONS = (
    comparison(0.0, 0.95, 0.1, 0.01, idle=True, taken=True),
    comparison(2.0, 0.1, 0.088),
    comparison(4.0, 0.4, 0.19, taken=True),
    comparison(6.0, 0.2, 0.64),
    comparison(8.0, 0.19, 0.15, taken=True),
    comparison(10.0, 0.15, 0.1499),
)
HEADLINES = (
    "Began a plan: it was .85 m better than doing nothing, more than the threshold of .01 m.",
    "Stayed: the best alternative was .012 m better, less than the threshold of .03 m.",
    "Switched: another plan was .21 m better, more than the threshold of .03 m.",
    "Stayed: the best alternative was .44 m worse. At 7.50 s: fell.",
    "Switched: another plan was .04 m better, more than the threshold of .03 m.",
    "Stayed: nothing better was found than the plan in execution, whose objective is .15 m.",
)


def moving(report):
    """The made-up mission, of a robot that moves in metres."""
    frames = []
    for frame, compared in zip(report.frames, COMPARISONS, strict=True):
        at = frame.index
        motion = {
            "track": [[2.0 + at, 3.5 + at, 0.1 * at], [3.0 + at, 4.5 + at, 0.1 * at + 0.1]],
            "radius": 1.5,
            "plan": [[2.0 + at, 3.5 + at], [9.5, 13.5]],
            "goal": [9.5, 13.5],
            "discs": [[6.0, 8.0, 0.8]],
            "clearance": 2.0,
            "cones": [
                {"row": 3.0 + at, "column": 5.0 + at, "bearing": 0.5, "half_angle": 0.5, **echo}
                for echo in ({"reach": 5.0, "heard": None}, {"reach": 5.0, "heard": 2.5})
            ],
            "comparisons": [compared],
            "events": [[7.5, "fell"]] if at == 3 else [],
        }
        frames.append(replace(frame, story={"motion": motion, "belief": frame.story["belief"]}))
    return replace(report, frames=tuple(frames))


@pytest.fixture
def log(tmp_path, mission, floor, report):
    return read_log(write_log(tmp_path / "moving.jsonl", mission, floor, moving(report)))


def test_the_sentence_says_in_numbers_why_it_switched_or_stayed(log):
    frames = page_data([log])["runs"][0]["frames"]
    assert tuple(frame["moments"][0]["headline"] for frame in frames) == HEADLINES


def test_the_page_opens_at_the_most_profitable_switch(log):
    run = page_data([log])["runs"][0]
    assert run["opens"] == 2
    assert run["switching"] == (
        "6 comparisons, 1 plan begun from nothing, 2 switches. The most profitable, at 4.00 s, "
        "made the objective .19 m instead of .4 m. At 7.50 s: fell."
    )


def test_a_robot_on_cells_is_told_of_as_before(tmp_path, mission, floor, report):
    run = page_data([read_log(write_log(tmp_path / "a.jsonl", mission, floor, report))])["runs"][0]
    assert (run["opens"], run["switching"]) == (None, "")
    assert all(frame["motion"] is None for frame in run["frames"])


@pytest.mark.parametrize(
    ("length", "text"), [(0.0, "0 m"), (0.012, ".012 m"), (0.03, ".03 m"), (0.21, ".21 m")]
)
def test_lengths_are_told_as_exactly_as_they_matter(length, text):
    assert metres(length) == text


def test_a_motion_that_is_none_is_refused_in_one_line(tmp_path, mission, floor, report):
    for wrong in ({"track": []}, {"track": [[1.0]]}, {"wings": 2}):
        motion = {"track": [[1.0, 2.0, 0.0]], "radius": 1.0, **wrong}
        told = replace(report, frames=(replace(report.frames[0], story={"motion": motion}),))
        path = write_log(tmp_path / "a.jsonl", mission, floor, told)
        with pytest.raises(AnytimeError, match=r"a\.jsonl:2: .*(motion|track|wings)") as refused:
            read_log(path)
        assert "\n" not in str(refused.value)


@pytest.mark.browser
@pytest.mark.parametrize("width", [360, 1400])
def test_the_page_draws_every_frame_and_its_objective_over_time(browser, log, tmp_path, width):
    def count(what: str) -> int:
        return browser.run(f"document.querySelectorAll('#objective {what}').length")

    def cursor() -> float:
        return float(browser.run("document.querySelector('#objective .cursor').getAttribute('x')"))

    browser.errors.clear()
    browser.open(write_page([log], tmp_path / "page.html").as_uri(), width)
    assert browser.run("document.getElementById('where').textContent").startswith("Frame 2,")
    assert [count(f".{sign}") for sign in ("held", "switch", "begin", "found")] == [1, 2, 1, 3]
    assert count("path.switched") == 2
    assert count("path.event") == 1
    assert re.search(r"\d", browser.run("document.getElementById('switching').textContent"))
    seen, cursors, maps = [], [], []
    for frame in range(6):
        browser.run(f"location.hash = '#{frame}'")
        browser.wait(f"document.getElementById('where').textContent.startsWith('Frame {frame},')")
        seen.append(browser.run("document.getElementById('sentence').textContent"))
        cursors.append(cursor())
        maps.append(browser.run("document.getElementById('map').toDataURL()"))
        assert browser.run("document.scrollingElement.scrollWidth <= innerWidth")
    assert tuple(seen) == HEADLINES
    assert all(before < after for before, after in pairwise(cursors))
    assert len(set(maps)) == 6
    label = browser.run("document.getElementById('map').getAttribute('aria-label')")
    assert "robot at row 8.0, column 9.5, heading 0.60" in label
    assert browser.errors == []


@pytest.mark.browser
def test_a_key_and_a_press_lead_to_switches(browser, log, tmp_path):
    where = "document.getElementById('where').textContent"
    browser.errors.clear()
    browser.open(write_page([log], tmp_path / "page.html").as_uri())
    for expected in (4, 0, 2):
        browser.press("s")
        assert browser.run(where).startswith(f"Frame {expected},")
    browser.run("document.querySelector('#objective .found').dispatchEvent(new Event('click'))")
    assert browser.run(where).startswith("Frame 1,")
    assert browser.errors == []


@pytest.mark.browser
def test_a_robot_on_cells_has_no_panel_of_plans(browser, tmp_path, mission, floor, report):
    log = read_log(write_log(tmp_path / "a.jsonl", mission, floor, report))
    browser.errors.clear()
    browser.open(write_page([log], tmp_path / "page.html").as_uri())
    for name in ("plans", "switch", "switch-key"):
        assert browser.run(f"document.getElementById('{name}').hidden")
    browser.press("s")
    assert browser.run("document.getElementById('where').textContent").startswith("Frame 2,")
    assert browser.errors == []
