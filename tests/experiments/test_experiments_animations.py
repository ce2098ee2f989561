"""Animations of a reproduction: what they hold, and that a real browser plays them."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from experiments.reproduction import nao_animations, zr_animations
from experiments.reproduction.animations import (
    Animation,
    Moment,
    bits,
    lines,
    places,
    save,
)
from experiments.reproduction.missions import live, lived, second_run
from experiments.reproduction.nao_animations import SEARCHES, mission, shipped
from experiments.reproduction.page import page
from experiments.reproduction.searches import EARLY, MOVING
from experiments.reproduction.ways import OURS

FIGURES = ("paper", "ours", "low", "high", "held", "ours_best", "held_by_ours")
"""Of a claim, in the JSON of a reproduction."""
MADE_UP = Animation(
    "a <title>",
    "m",
    "s",
    (0, 0, 2, 1),
    lines("walked", "planned", growing="walked"),
    tuple(
        Moment(
            float(time),
            (((0.1 * time, 0.5),), ((0.0, 0.0), (1.0, 1.0))),
            (1.5, 0.5),
            ((1.0, 0.5, 0.2),),
            robot=(0.1 * time, 0.5, 0.0, 0.1),
            said="</script>fell" if time == 3 else "",
        )
        for time in range(6)
    ),
)


def read(animated) -> Animation:
    return msgspec.json.decode(animated.file.read_bytes(), type=Animation)


def searched(folder, name):
    scene, title = next((scene, title) for found, scene, title in SEARCHES if found == name)
    return read(nao_animations.search(folder, 0, name, scene, title)).moments


def in_box(told):
    left, lower, right, upper = told.box
    places_shown = [place for moment in told.moments for place in moment.lines[0]]
    return all(left <= x <= right and lower <= y <= upper for x, y in places_shown)


def test_what_is_saved_is_read_back(tmp_path):
    assert read(save(MADE_UP, tmp_path, "zr", "x", "a caption")) == MADE_UP
    assert [line.grows for line in MADE_UP.lines] == [True, False]


def test_equal_places_are_told_once_and_a_floor_keeps_its_bits():
    assert places([(0, 0, 1), (0, 0.00001, 2), (1, 0, 3)]) == ((0.0, 0.0), (1.0, 0.0))
    assert bits(np.array([[1, 0, 0, 0, 0, 0, 0, 1], [0] * 8], bool)) == ("81", "00")


def test_a_plan_is_refined_from_squares_to_cells(tmp_path):
    (animated,) = zr_animations.animate(tmp_path, 0)
    told = read(animated)
    sides = [max(side for *_, side in m.squares) for m in told.moments if m.squares]
    assert sides[0] == 8
    assert sides[-1] < 8
    assert [moment.at for moment in told.moments] == sorted(moment.at for moment in told.moments)
    assert in_box(told)
    assert len(told.floor) == told.box[3]


def test_an_obstacle_is_there_until_it_goes(tmp_path):
    moments = searched(tmp_path, "removed-early")
    assert all(moment.discs for moment in moments if moment.at < EARLY - 0.01)
    assert not moments[-1].discs


def test_a_goal_moves_and_both_ways_follow_it(tmp_path):
    last = searched(tmp_path, "moving")[-1]
    assert last.goal == pytest.approx((1.0 + MOVING * last.at, 0.0), abs=0.01)
    for way in last.lines:
        assert math.dist(way[-1], last.goal) < 0.1


def test_a_robot_falls_stands_up_and_ends_at_its_goal(tmp_path):
    scene = shipped("fall", 0)
    told = read(mission(tmp_path, "falls", scene, live(scene, OURS)[1], "A fall"))
    last = told.moments[-1]
    assert last.robot is not None
    assert last.goal is not None
    assert math.dist(last.robot[:2], last.goal) < 0.1
    assert any("fell" in moment.said for moment in told.moments)
    assert in_box(told)


def test_a_switch_is_said_when_it_happens(tmp_path):
    told = read(mission(tmp_path, "second", second_run(0), lived(0, OURS)[1], "The second run"))
    assert any("switches" in moment.said for moment in told.moments)
    there = [bool(moment.discs) for moment in told.moments]
    assert there == sorted(there)  # the obstacle appears, and stays
    assert there[-1]


@pytest.mark.browser
@pytest.mark.parametrize("width", [380, 1400])
def test_the_page_plays_an_animation(browser, tmp_path, width):
    animated = save(MADE_UP, tmp_path / "figures", "zr", "x", "a caption")
    told = {
        "figures": {
            "claims": {"total": 1, "held": 1},
            "claim": {"zr": {"level3": dict.fromkeys(FIGURES, 1.0)}},
        },
        "settings": {
            "quick": False,
            "draws": 30,
            "cut": [],
            "claims": {"zr.level3": "a claim"},
            "comparisons": [],
            "pictures": [],
            "sweeps": [],
            "animations": [
                {"part": "zr", "file": f"figures/{animated.file.name}", "caption": "a caption"}
            ],
        },
        "machine": {"python": "3", "system": "any"},
        "seed": 7,
    }
    file = tmp_path / "page.html"
    file.write_text(page(told, tmp_path), encoding="utf-8")
    browser.errors.clear()
    browser.open(file.as_uri(), width)
    assert browser.run("document.scrollingElement.scrollWidth <= innerWidth")
    said = "document.querySelector('output').value"
    assert browser.run(said) == "5 s"  # the last moment, before anybody plays it
    shown = "document.querySelector('canvas').toDataURL()"
    last = browser.run(shown)
    slider = "document.querySelector('input')"
    browser.run(f"{slider}.value = 3, {slider}.dispatchEvent(new Event('input'))")
    assert browser.run(said) == "3 s: </script>fell"
    assert browser.run(shown) != last
    browser.run("document.querySelector('button').click()")
    browser.wait(f"{said}.startsWith('4 s')")
    browser.run("document.querySelector('button').click()")
    assert browser.run("document.querySelector('button').ariaLabel") == "play"
    assert browser.errors == []
