"""The value gate: a loss is shown where there is one, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anytime import AnytimeError, Machine
from anytime.__main__ import main
from compiler import compile
from experiments import shipped
from monitor import Energy, Mission, Value
from monitor.calibration import Steady
from monitor.rhythms import Lived
from monitor.robots.comparing import as_before, compare
from monitor.robots.grid import Scene
from monitor.robots.grid_missions import GridMission
from monitor.robots.navigation import navigate
from monitor.shifts import GROUPS, Shift, Shifts
from monitor.states import Situation
from monitor.value_gate import Foresight, gate
from sensing import Vision

MISSION = Mission(Value("linear", 100.0, 90.0), Energy(0.2, 0.08, 0.03), job=1.0, name="ward")
ROUTE, FRAMES = 100.0, 10


def lived(sensing, seed):
    """A mission that walks less the longer it looks."""
    walked = ROUTE * (1.2 + 0.8 * np.exp(-sensing / 2) + 0.05 * np.sin(seed))
    return Lived(sensing, ROUTE, walked, 0.9 * walked, FRAMES, 1, 0.8)


@pytest.fixture(scope="module")
def foresight():
    program = compile(navigate, shipped.profiles())
    seeds = range(2 * GROUPS)
    steady = tuple(
        Steady((time, 0.3), tuple(lived(time, seed) for seed in seeds), ())
        for time in (0.5, 1.5, 2.5, 4.0, 6.0)
    )
    situation = Situation(0.0, ROUTE, 0.0)
    ratios = np.array([0.9, 1.0, 1.1])
    return Foresight(MISSION, situation, steady, ratios, tuple(program.tables), program.frontier)


def test_without_a_change_nothing_is_lost(foresight):
    found = gate(foresight, Shifts({"see": Shift(), "find_path": Shift()}))
    assert found.loss == 0
    assert not found.shown


def test_slower_is_worth_less_and_better_is_worth_more(foresight):
    for label in ("see", "find_path"):
        paces = [foresight.worth({label: Shift(slower)}) for slower in (0.5, 1.0, 1.5, 3.0)]
        ends = [foresight.worth({label: Shift(quality=best)}) for best in (0.8, 0.9, 1.0)]
        assert paces == sorted(paces, reverse=True)
        assert ends == sorted(ends)
    assert foresight.worth({"see": Shift(3.0)}) < foresight.worth({}) - 1


def test_a_loss_is_shown_if_it_is_clear_of_the_noise_and_beyond_the_tolerance(foresight):
    slow = {"see": Shift(2.0)}
    clear = Shifts(slow, [slow] * GROUPS)
    noisy = Shifts(slow, [{"see": Shift(2.0 + (-1) ** out)} for out in range(GROUPS)])
    found = gate(foresight, clear)
    assert found.low < found.loss < found.high
    assert found.shown
    assert not gate(foresight, noisy).shown
    assert not gate(foresight, clear, tolerance=found.high).shown
    assert found.parts["see"] == pytest.approx(found.loss)


def test_a_change_the_other_way_round_wins_what_was_lost(foresight):
    slow = {"see": Shift(2.0)}
    found = gate(foresight, Shifts(slow, [slow] * GROUPS))
    won = found.backwards({"see": Shift(0.5)})
    assert (won.before, won.after, won.loss) == (found.after, found.before, -found.loss)
    assert won.low < won.loss < won.high
    assert not won.shown
    assert won.backwards(slow) == found


def test_a_change_that_mends_what_reached_no_goal_is_no_loss(tmp_path):
    free = np.ones((24, 24), bool)
    free[6:18, 12] = False
    grid = GridMission(
        replace(MISSION, value=Value("hard", 100.0, 30.0)),
        Scene(free, (12, 2), (12, 21), device=Vision(2, 12)),
        shipped.profiles().machine,
    )
    good = shipped.profiles()
    good.save(tmp_path / "good")
    good.on(good.machine.with_rate("find_path", 5.0)).save(tmp_path / "bad")
    mended = compare(tmp_path / "bad", tmp_path / "good", grid)
    spoiled = compare(tmp_path / "good", tmp_path / "bad", grid)
    assert spoiled.shown
    assert not mended.shown
    assert (mended.before, mended.after) == (spoiled.after, spoiled.before)
    assert (mended.low, mended.high) == (-spoiled.high, -spoiled.low)
    assert mended.shifts["find_path"].slower == pytest.approx(1 / 5000)


def test_the_command_refuses_what_cannot_be_compared_in_one_line(tmp_path, capsys):
    shipped.profiles().save(tmp_path / "before")
    (tmp_path / "empty").mkdir()
    mission = ["--mission", str(shipped.mission_path())]
    (tmp_path / "some.schedule").touch()
    for after, says in (
        ("empty", "profile"),
        ("missing.schedule", "no such file or folder"),
        ("some.schedule", "one is a folder"),
    ):
        code = main(["compare", str(tmp_path / "before"), str(tmp_path / after), *mission])
        told = capsys.readouterr()
        assert (code, told.out, told.err.count("\n")) == (2, "", 1)
        assert says in told.err


def test_a_mission_without_anything_to_divide_is_refused(tmp_path, capsys):
    there = Scene(np.ones((8, 8), bool), (2, 2), (2, 2), radius=4, frame=2.0)
    with pytest.raises(AnytimeError, match="begins at its goal"):
        compare(tmp_path, tmp_path, GridMission(MISSION, there, shipped.profiles().machine))
    scene = shipped.DATA / "scenes" / "sitting.toml"
    assert main(["compare", str(tmp_path), str(tmp_path), "--mission", str(scene)]) == 2
    assert "takes a grid mission" in capsys.readouterr().err


def test_modules_live_at_the_rates_of_simulated_time_and_not_at_those_of_another_computer():
    mission = Machine("robot").with_rate("see", 0.25).with_rate("drive", 0.1)
    simulated = Machine("slow").with_rate("see", 0.5)
    there = as_before(mission, simulated)
    assert (there.rates["see"].per_work, there.rates["drive"].per_work) == (0.5, 0.1)
    assert as_before(mission, replace(simulated, host="a laptop")) is mission
