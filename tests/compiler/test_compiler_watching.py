"""Calls that are watched while they run: ended by what they show, the same every time."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest

import anytime
import compiler
from anytime import AnytimeError, Machine, Status, WorkClock
from anytime.files import checksum
from compiler.adaptive import plan_for
from compiler.loading import inspect

MACHINE = Machine("m").with_rate("look", 0.01).with_rate("think", 0.01).with_rate("find", 0.01)


@dataclass(frozen=True)
class Scene:
    luck: float
    name: str


SCENES = [Scene(index / 9, f"scene {index}") for index in range(10)]
LUCKY, UNLUCKY = 0.9, 0.1
SECONDS = 0.17


def clock() -> WorkClock:
    return WorkClock(MACHINE)


def same(quality, scene=None):
    return quality


def views(luck):
    """A good view comes with the second step; the unlucky wait for one until the tenth."""
    for step in range(1, 13):
        yield 0.9 if step >= (10 if luck < 0.5 else 2) else 0.1


@anytime.module(quality=same, estimate=same)
def look(luck):
    yield from views(luck)


@anytime.module(quality=same, estimate=same)
def find(luck):
    """The same with callbacks."""
    for view in views(luck):
        anytime.register(view)


@anytime.module(quality=same, estimate=same)
def think(seen):
    """What comes of a poor view is poor, and of any it takes time."""
    for step in range(1, 13):
        yield seen * step / 12


def compiled(*modules, **how):
    program = compiler.program(lambda luck: modules[1](modules[0](luck)))
    library = anytime.measure(program, SCENES, seconds=0.2, clock=clock)
    return compiler.compile(program, library, adaptive=True, **how)


@pytest.fixture(scope="module")
def schedule():
    return compiled(look, think)


@pytest.mark.parametrize("module", [look, find])
def test_a_call_is_ended_as_soon_as_it_shows_enough(module):
    schedule = compiled(module, think)
    first = schedule.labels[0]
    result = schedule.run(SECONDS, clock=clock(), luck=LUCKY)
    assert result.parts[first].history[-1].estimate == 0.9
    assert result.parts[first].elapsed == pytest.approx(0.02)
    assert result.parts[first].status is Status.INTERRUPTED
    assert f"{first} 20.0 ms of 100.0 ms (ended by what it showed, .90) →" in result.why
    assert result.elapsed <= SECONDS + 1e-9


def test_a_call_goes_on_while_it_may_still_show_more(schedule):
    result = schedule.run(SECONDS, clock=clock(), luck=UNLUCKY)
    assert result.parts["look"].elapsed == pytest.approx(0.1)
    assert result.parts["look"].history[-1].estimate == 0.9
    assert "ended" not in result.why


def test_it_is_worth_more_than_deciding_at_boundaries(schedule):
    plan = schedule.policy.plan(SECONDS)
    plain = plan_for(schedule.program, schedule.tables, plan.budget, compiler.expected())
    assert plan.value > plain.value + 0.1


def test_a_run_repeats_bit_for_bit(schedule):
    for luck in (LUCKY, UNLUCKY):
        one, other = (repr(schedule.run(SECONDS, clock=clock(), luck=luck)) for _ in range(2))
        assert one == other


def test_results_are_passed_on_to_who_listens(schedule):
    heard = []
    schedule.run(
        SECONDS, clock=clock(), luck=LUCKY, on_result=lambda label, v, c: heard.append((label, v))
    )
    assert heard[:2] == [("look", 0.1), ("look", 0.9)]


def test_with_a_cost_of_time_the_last_call_is_ended_too():
    costly = compiled(look, think, objective=compiler.expected(lambda q, t: q - t))
    lucky, unlucky = (costly.run(0.24, clock=clock(), luck=luck) for luck in (LUCKY, UNLUCKY))
    assert lucky.elapsed < 0.16 < unlucky.elapsed
    assert "ended by what it showed" in lucky.why


def test_what_is_loaded_watches_the_same(schedule, tmp_path):
    schedule.save(tmp_path / "a.schedule")
    again = compiler.load(tmp_path / "a.schedule", modules=[look, think])
    assert repr(inspect(tmp_path / "a.schedule").explain(SECONDS)) == repr(again.explain(SECONDS))
    assert again.policy.watched == schedule.policy.watched == {"look", "think"}
    for seconds in np.linspace(schedule.least, 0.2, 7):
        assert again.promise(seconds) == pytest.approx(schedule.promise(seconds), abs=1e-6)
        one, other = (s.run(seconds, clock=clock(), luck=LUCKY) for s in (again, schedule))
        assert repr(one) == repr(other)


def test_it_says_what_it_decides_while_it_runs(schedule):
    explained = schedule.explain(SECONDS)
    assert explained.promised == schedule.promise(SECONDS)
    assert "look ends after 20.0 ms … 100.0 ms (60.0 ms on average) by what it shows" in repr(
        explained
    )


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("levels", [], "not one for each moment"),
        ("levels", [[0]], "not one for each moment"),
        ("levels", [[99] * 13] * 10, "not one for each moment"),
        ("weights", [], "not one for each run"),
        ("weights", [[1.0]], "not one for each run"),
        ("weights", [[-0.1, 0.3] * 5], "not those of its runs"),
    ],
)
def test_a_file_with_runs_that_do_not_fit_is_refused(schedule, tmp_path, key, value, reason):
    path = tmp_path / "a.schedule"
    schedule.save(path)
    content = json.loads(path.read_text())
    del content["checksum"]
    content["tables"][0]["courses"][key] = value
    path.write_text(json.dumps(content | {"checksum": checksum(content)}))
    with pytest.raises(AnytimeError, match=reason):
        compiler.load(path, modules=[look, think])
