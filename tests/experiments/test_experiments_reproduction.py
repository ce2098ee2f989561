"""The papers' claims are measured in this very run and judged by one rule."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from anytime.__main__ import main
from anytime.errors import AnytimeError
from experiments.reproduction import (
    executions,
    nao,
    nao_animations,
    nao_drawing,
    reproducing,
    searches,
)
from experiments.reproduction.claims import ENOUGH, Value, judge
from experiments.reproduction.draws import drawn
from experiments.reproduction.executions import AHEAD, execute, surprised
from experiments.reproduction.keeping import FILE, opened
from experiments.reproduction.ways import OURS, PAPER
from monitor.robots.nao_noise import NOISELESS
from planners.nao import STAND
from planners.nao_plan import Action, plan_world, trajectory

NAMES = (
    *("toy", "any_length", "stand_first", "round_obstacle", "first_plan", "moving_tracked"),
    *("removed_early_straight", "removed_late_stays", "value_unchanged_by_removal"),
    *("appeared_most_cases", "skip_executed", "objective_after_stand", "obstacle_step"),
    *("switch_above_threshold", "replanned_final", "fall_stands_up", "collision_on_crossing"),
)
MISSIONS = ("prp.switch_above_threshold", "prp.replanned_final")
PLANNED = [claim for claim in nao.CLAIMS if claim.name not in MISSIONS]
"""All but those of whole missions, which are tested to repeat elsewhere."""
TICK = 0.0025
"""Metres that a robot walks in one tick of its body, with their effort."""
DIRECT = (Action("posture", STAND), Action("walk", *AHEAD.goal.at))


def behaved(shown: int, draws: int) -> bool:
    return judge(Value(1.0, "behaviour"), [1.0] * shown + [0.0] * (draws - shown)).held


def test_a_behaviour_holds_if_nineteen_in_twenty_show_it():
    assert behaved(30, 30)
    assert behaved(29, 30)
    assert not behaved(28, 30)


def test_a_drawing_holds_between_the_5th_and_the_95th_percentile_or_if_our_median_is_better():
    draws = np.linspace(0.0, 1.0, 101).tolist()
    for paper, better, held in (
        (0.5, "neither", True),
        (0.04, "neither", False),
        (0.96, "neither", False),
        (0.96, "less", True),
        (0.04, "less", False),
        (0.04, "more", True),
    ):
        assert judge(Value(paper, "drawing", better), draws).held is held


def test_a_mean_holds_if_our_interval_has_it_or_is_better():
    draws = [0.0, 2.0] * 50  # the mean is 1, give or take 0.2
    assert judge(Value(1.1, "mean"), draws).held
    assert not judge(Value(1.5, "mean"), draws).held
    assert judge(Value(1.5, "mean", "less"), draws).held
    assert not judge(Value(0.5, "mean", "less"), draws).held


def test_too_few_draws_hold_nothing_and_a_seed_that_shows_nothing_is_no_draw():
    assert not behaved(ENOUGH - 1, ENOUGH - 1)
    shown = [1.0] * (ENOUGH - 1) + [math.nan]
    assert not judge(Value(1.0, "behaviour"), shown).held
    assert judge(Value(1.0, "behaviour"), [*shown, 1.0]).held
    assert not judge(Value(1.0, "behaviour"), [math.nan] * ENOUGH).held


def test_every_promised_claim_is_there_once():
    assert [claim.name for claim in nao.CLAIMS] == [f"prp.{name}" for name in NAMES]


@pytest.mark.parametrize(
    ("claim", "way"),
    [*((claim, OURS) for claim in PLANNED), *((claim, PAPER) for claim in PLANNED[:2])],
    ids=lambda each: each.name,
)
def test_equal_seeds_draw_equal_figures(claim, way):
    drawn = claim.draw(3, way)
    assert len(drawn) == len(claim.values)
    for run in (executions.ahead, executions.surprised):
        run.cache_clear()
    assert claim.draw(3, way) == drawn


def test_no_printed_plan_touches_the_disc_and_one_would_touch_a_larger_one():
    x, y, radius = searches.printed_disc()
    for grown, touched in ((0.999, 0), (1.001, 1)):
        fallen = 0
        for walks in searches.PRINTED:
            world = plan_world((1, 0), posture="Stand", obstacles=[(x, y, radius * grown)])
            poses = trajectory([Action("walk", *walk) for walk in walks], world)
            fallen += any(pose.posture != STAND for pose in poses)
        assert fallen == touched


def test_where_nothing_errs_executing_a_plan_does_not_change_what_it_is_worth():
    run = execute(DIRECT, AHEAD.noiseless(), 0.003, 0.0)
    for values in run.objective.values():
        assert np.ptp(values) < TICK
    assert run.apart < 1e-6


def test_standing_up_adds_the_miss_of_a_straight_walk_in_a_wrong_direction():
    turned = replace(AHEAD, noise=replace(NOISELESS, drift=(0.13, 0.0)))
    unknown, known = (execute(DIRECT, turned, 0.003, drift) for drift in (0.0, 0.13))
    values = unknown.objective["paper"]
    missed = 2.0 * math.sin(0.13 / 2)
    assert values[unknown.stood] - values[0] == pytest.approx(missed, abs=1e-3)
    assert unknown.apart == pytest.approx(missed, abs=1e-3)
    assert np.ptp(known.objective["paper"]) < TICK  # who knows it has told so from the beginning


def test_an_obstacle_puts_the_end_of_the_plan_at_its_place_or_where_it_is_touched():
    for seed in range(3):
        run = surprised(seed)
        place = float(np.random.default_rng((seed, 3)).uniform(0.27, 1.0))
        effort = executions.effort() * (run.times[run.seen - 1] + 10.0)
        paper, ours = (run.objective[rule][run.seen] for rule in executions.RULES)
        assert paper == pytest.approx(1.0 - place + effort, abs=0.02)
        assert ours - paper > 0.2  # a radius farther, and the fall


def few(*names):
    return tuple(claim for claim in nao.CLAIMS if claim.name in names)


_DRAWING = """
from pathlib import Path
from experiments.reproduction import draws, keeping, nao
claims = tuple(claim for claim in nao.CLAIMS if claim.name == {name!r})
with keeping.opened(Path({folder!r})) as kept:
    draws.drawn(claims, range(10_000), kept)
"""


def test_one_that_was_killed_goes_on_and_finds_what_an_uninterrupted_one_finds(tmp_path):
    claims = few("prp.collision_on_crossing")
    name, file = claims[0].name, tmp_path / FILE
    code = _DRAWING.format(name=name, folder=str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", code]) as begun:
        while not file.exists() or file.read_bytes().count(b"\n") < 4:
            assert begun.poll() is None
            time.sleep(0.01)
        begun.kill()
    with file.open("a") as torn:
        torn.write('{"name":"draw 99","fou')
    with opened(tmp_path) as kept:
        done = next(seed for seed in range(10_000) if kept.get(f"draw {seed}") is None)
        assert done >= 3
        found = drawn(claims, range(done + 2), kept)
    whole = [
        {name: {way.name: list(claims[0].draw(seed, way)) for way in (PAPER, OURS)}}
        for seed in range(done + 2)
    ]
    assert found == whole


def test_what_was_found_makes_way_for_the_first_new_finding_alone(tmp_path):
    with opened(tmp_path) as kept:
        kept.keep("bench", 1)
        with pytest.raises(AnytimeError, match="another process"), opened(tmp_path, anew=True):
            pass
    with opened(tmp_path, anew=True):
        pass
    with opened(tmp_path) as kept:
        assert kept.get("bench") == 1
    with opened(tmp_path, anew=True) as kept:
        assert kept.get("bench") is None
        kept.keep("other", 2)
    with opened(tmp_path) as kept:
        assert (kept.get("bench"), kept.get("other")) == (None, 2)


def test_what_is_kept_is_not_found_again(tmp_path):
    found = {"figure": np.float64(0.1), "count": np.int64(2), "both": (1.5, math.nan)}
    told = {"figure": 0.1, "count": 2, "both": [1.5, None]}
    with opened(tmp_path) as kept:
        assert kept.once("bench", lambda: found) == told
    with opened(tmp_path) as kept:
        assert kept.once("bench", lambda: pytest.fail("found again")) == told


def test_a_draw_without_one_of_the_claims_is_made_again(tmp_path):
    claims = few("prp.collision_on_crossing")
    with opened(tmp_path) as kept:
        for seed, claim in enumerate((claims[0].name, "another")):
            kept.keep(f"draw {seed}", {claim: {"paper": [0.5], "ours": [0.5]}})
        first, second = drawn(claims, range(2), kept)
    assert first[claims[0].name]["paper"] == [0.5]
    assert second[claims[0].name]["paper"] == list(claims[0].draw(1, PAPER))
    assert second["another"] == {"paper": [0.5], "ours": [0.5]}  # of another part


def test_the_command_prints_one_object_draws_its_picture_and_goes_on(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(
        nao, "CLAIMS", few("prp.toy", "prp.obstacle_step", "prp.collision_on_crossing")
    )
    monkeypatch.setattr(nao_drawing, "_SEARCHES", 1)
    monkeypatch.setattr(nao_animations, "SEARCHES", nao_animations.SEARCHES[:1])
    monkeypatch.setattr(reproducing, "QUICK_DRAWS", 2)
    words = ["reproduce", "nao", "--quick", "--json", "-o", str(tmp_path)]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["figures"]["claims"] == {"total": 3, "held": 0}  # two draws hold nothing
    toy = told["figures"]["claim"]["prp"]["toy"]
    assert {"paper", "ours", "low", "high", "held", "ours_best"} <= set(toy)
    assert told["settings"]["claims"]["prp.toy"]
    for name in ("plans", "objective"):
        picture = tmp_path / "figures" / f"nao-{name}.png"
        assert picture.read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "results.json").read_text()) == told
    assert "prp" in (tmp_path / "results.md").read_text().lower()
    page = (tmp_path / "reproduce.html").read_text()
    assert page.count('<svg role="img"') == 2
    assert page.count("<canvas") == 5  # a search and four missions
    kept = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(kept[:-10])  # of the last line, which says that nothing was swept
    for made in ("draw", "animate"):  # as before, and it takes seconds
        monkeypatch.setattr(nao, made, lambda folder, seed: ())
    assert main([*words, "--resume"]) == 0
    assert json.loads(capsys.readouterr().out)["figures"] == told["figures"]
    assert (tmp_path / FILE).read_bytes() == kept


def test_what_is_not_there_cannot_be_reproduced(capsys):
    assert main(["reproduce", "moon"]) == 2
    assert "choose zr, nao, rivals" in capsys.readouterr().err
