"""The claims of [ZR93] are measured in this very run; few draws here, the laws behind them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from experiments.reproduction import abstraction, dividing, looking, tasks, zr
from experiments.reproduction.abstraction import Floors, course, mixed, step_costs
from experiments.reproduction.claims import Verdict
from experiments.reproduction.page import page
from experiments.reproduction.pictures import new_figure, save
from experiments.reproduction.results import results
from experiments.reproduction.ways import OURS, PAPER
from planners.paper_atp import refinements, steps

NAMES = (
    *("vision_none_below_ta", "vision_rises", "level3", "level10", "final_quality"),
    *("final_work", "final_time", "step_cost_invariant", "executable", "noisy_first"),
    *("noisy_lower_on_average", "conditional_ordered", "tree_optimal"),
    *("compiled_above_min_max", "interruptible", "ahead_behind", "within_4"),
)
SMALL = Floors("r20", 48)


def test_every_promised_claim_is_there_once():
    assert [claim.name for claim in zr.CLAIMS] == [f"zr.{name}" for name in NAMES]


@pytest.mark.parametrize("way", [PAPER, OURS], ids=lambda way: way.name)
def test_equal_seeds_draw_equal_figures(way):
    cheap = [c for c in zr.CLAIMS if c.name.split(".")[1] not in ("final_time", *NAMES[-6:])]
    first = {claim.name: claim.draw(2, way) for claim in cheap}
    course.cache_clear()
    for claim in cheap:
        assert len(first[claim.name]) == len(claim.values)
        np.testing.assert_equal(claim.draw(2, way), first[claim.name])


def test_atp_registers_every_refinement_and_tells_the_better_ones():
    domain = abstraction.seen(0, SMALL)
    found = course(0, PAPER, SMALL)
    every = list(refinements(domain, found.start, found.goal))
    told = list(steps(domain, found.start, found.goal))
    assert all(step.plan is not None for step in every)
    assert sum(step.work for step in every) == sum(step.work for step in told)
    lengths = [step.plan.length for step in told if step.plan and step.plan.level]
    assert lengths == sorted(lengths, reverse=True)


def test_a_course_goes_from_the_highest_level_to_the_lowest():
    found = course(1, PAPER, SMALL)
    levels = [plan.level for plan in found.plans]
    assert levels == sorted(levels, reverse=True)
    assert levels[-1] == 0
    place = mixed(found)
    assert place is None or {s.level for s in found.plans[place].segments} == {0, 1}
    assert set(step_costs([found])) <= {1, 2, 3}


def test_before_the_first_plan_there_is_none_and_after_the_last_that_one():
    found = course(1, PAPER, SMALL)
    assert found.best(found.work[0] - 1) == 0.0
    assert found.best(found.total + 1) == found.quality[-1]


def test_a_sensor_sees_nothing_before_ta_and_everything_at_tb():
    qualities = looking.qualities(0, PAPER.device)
    first, last = (round(seconds / 0.02) for seconds in looking.span(PAPER.device))
    assert [math.isnan(quality) for quality in qualities[:first]] == [True] * (first - 1) + [False]
    assert qualities[last - 1] == 1.0


def test_an_interruptible_sequence_takes_at_most_four_times_as_long_and_the_best_not_longer(
    monkeypatch,
):
    found = dividing.divided(0, PAPER, 6)
    monkeypatch.setattr(dividing, "divided", lambda seed, way: found)
    doubling, best = (dividing.interruptible(0, way)[0] for way in (PAPER, OURS))
    assert 1.0 <= best <= doubling <= 4.0


def test_the_compiled_profile_is_ordered_and_above_min_and_max():
    found = dividing.divided(0, PAPER, 6)
    curves = found.curves(np.array([dividing.SECONDS]))
    assert (np.diff(curves[:, 0]) > 0.0).all()
    assert (found.divided() >= np.maximum(*found.pinned()) - dividing.CLOSE).all()


def test_a_task_is_lived_as_decided_and_the_paper_steers_by_its_four_cases():
    report, seen = tasks.lived(0, PAPER)
    assert report
    assert len(seen) > 0
    assert tasks.ahead_behind(0, PAPER)
    gap, same = tasks.within_4(0, PAPER)
    assert gap == same == 1.0 - report.net / report.promised


def told(folder) -> dict:
    """A reproduction's JSON with one claim of one figure more, one picture and one sweep."""
    figure, (axes,) = new_figure(2, 2)
    axes.plot([0, 1], [0, 1])
    picture = save(figure, folder / "figures", "zr", "one", "a line < a curve")
    value = {"paper": 0.5, "ours": 0.4, "low": 0.3, "high": 0.6, "held": True}
    claim = {**value, "ours_best": None, "held_by_ours": False}
    return {
        "figures": {
            "claims": {"total": 1, "held": 1},
            "claim": {"zr": {"level3": {**claim, "more": {**claim, "held": False}}}},
        },
        "settings": {
            "draws": 2,
            "quick": True,
            "comparisons": [],
            "cut": ["little"],
            "claims": {"zr.level3": "it is < 1"},
            "pictures": [
                {"part": "zr", "file": f"figures/{picture.file.name}", "caption": picture.caption}
            ],
            "animations": [],
            "sweeps": [
                {
                    "title": "by size",
                    "columns": ["a"],
                    "paper": [0.5],
                    "rows": {"32": [[0.1, 0.0, None]]},
                }
            ],
        },
        "machine": {"python": "3", "system": "none"},
        "seed": 7,
    }


def test_page_and_document_tell_the_same_from_the_same_json(tmp_path):
    found = told(tmp_path)
    html, markdown = page(found, tmp_path), results(found)
    for text in (html, markdown):
        for words in ("1 of 1 claims", "level3", "0.3 to 0.6", "by size", "seed 7", "holds"):
            assert words in text
    assert "it is &lt; 1" in html
    assert "anytime reproduce zr --seed 7 --quick" in html
    assert "anytime reproduce zr" in markdown


def test_the_page_needs_no_other_file_and_its_pictures_share_no_name(tmp_path):
    found = told(tmp_path)
    found["settings"]["pictures"] *= 2
    html = page(found, tmp_path)
    assert html.count("<svg") == 2
    assert "<img" not in html
    assert 'src="' not in html
    assert 'id="zr-one-' in html


def test_equal_pictures_are_equal_bytes(tmp_path):
    told(tmp_path / "a")
    told(tmp_path / "b")
    for name in ("zr-one.svg", "zr-one.png"):
        one, other = (tmp_path / way / "figures" / name for way in "ab")
        assert one.read_bytes() == other.read_bytes()


def test_a_sweep_has_a_cell_for_each_figure():
    from experiments.reproduction.sweeps import floors

    found = floors([32], ["r20"], 2)
    (cells,) = found.rows.values()
    assert len(cells) == len(found.columns) == len(found.paper)
    assert all(isinstance(cell, Verdict) for cell in cells)
