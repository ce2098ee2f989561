"""Promised against achieved on new problems, and whether quality is enough to describe inputs."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
import compiler
from anytime import AnytimeError, Machine, WorkClock

MACHINE = Machine("test").with_rate("see", 0.01).with_rate("act", 0.01)


@dataclass
class Scene:
    name: str
    image: float
    fog: float
    length: float


def scenes(count, seed):
    drawn = np.random.default_rng(seed).random((count, 3)).tolist()
    return [
        Scene(f"{seed}/{i}", 0.5 + image / 2, fog, c) for i, (image, fog, c) in enumerate(drawn)
    ]


@anytime.module(quality=lambda value: value)
def see(image):
    for step in range(1, 7):
        yield image * (1 - 0.5**step)


@anytime.module(quality=lambda value: value, name="act", features=lambda seen, fog: {"fog": fog})
def act_in_fog(seen, fog):
    for step in range(1, 7):
        yield seen * (1 - 0.8 * fog) * (1 - 0.5**step)


@anytime.module(quality=lambda value: value, name="act")
def act_anywhere(seen, fog):
    for step in range(1, 7):
        yield seen * (1 - 0.5**step)


def schedule(act, count=40):
    program = compiler.program(lambda image, fog: act(see(image), fog))
    return compiler.compile(
        program, anytime.measure(program, scenes(count, 0), seconds=1, clock=clock)
    )


def clock():
    return WorkClock(MACHINE)


@pytest.fixture(scope="module")
def foggy():
    return schedule(act_in_fog).validate(scenes(60, 1), clock=clock)


def test_promises_hold_on_problems_never_seen(foggy):
    assert foggy.holds
    assert foggy.problems == 60
    assert foggy.error < 0.1
    assert len(foggy.rows) == 6
    for row in foggy.rows:
        assert row.achieved_within[0] <= row.achieved <= row.achieved_within[1]


def test_a_promise_that_is_not_kept_is_shown():
    compiled = schedule(act_anywhere)
    dark = [Scene(s.name, 0.1, s.fog, s.length) for s in scenes(30, 2)]
    found = compiled.validate(dark, clock=clock, budgets=[0.06, 0.1])
    assert not found.holds
    assert "✗" in repr(found)
    assert "hold at 0 of 2 budgets" in repr(found)


def test_the_feature_that_would_help_is_named(foggy):
    (finding,) = foggy.findings
    assert not finding.enough
    assert "fog" in finding.candidate
    assert finding.correlation < -0.5
    assert "beside the quality of seen it depends on" in repr(foggy)


def test_where_quality_is_enough_nothing_is_found():
    @anytime.module(quality=lambda value: value, name="act")
    def shaky(seen, fog, *, rng):
        for step in range(1, 7):
            yield seen * (1 - 0.5**step) * float(rng.uniform(0.8, 1.0))

    (finding,) = schedule(shaky).validate(scenes(60, 3), clock=clock).findings
    assert finding.enough
    assert "is enough" in str(finding)


def test_pictures_keep_to_their_width_and_have_a_diagonal(foggy):
    assert max(map(len, repr(foggy).splitlines())) <= 100
    assert ">as promised<" in foggy._repr_html_()


def test_problems_that_do_not_fit_are_named():
    compiled = schedule(act_anywhere, 4)
    with pytest.raises(AnytimeError, match="two problems at least"):
        compiled.validate(scenes(1, 0), clock=clock)
    with pytest.raises(AnytimeError, match=r"problems\[0\] has no \.image"):
        compiled.validate([object(), object()], clock=clock)


def test_costs_are_compared_with_the_cheapest_known():
    @anytime.module(cost=lambda value: value, name="act")
    def walk(seen, fog):
        for step in range(1, 7):
            yield 10 + 10 * fog + 2.0 ** (5 - step) / max(seen, 0.1)

    found = schedule(walk).validate(scenes(30, 4), clock=clock)
    assert found.holds
    assert 0.2 < found.rows[0].achieved < found.rows[-1].achieved <= 1


def test_promises_can_be_calibrated_by_running():
    compiled = schedule(act_anywhere)
    dark = [Scene(f"dark {i}", 0.3 + 0.01 * i, 0.0, 0.0) for i in range(30)]
    found = compiled.calibrated(dark, clock=clock)
    assert not compiled.validate(dark, clock=clock).holds
    assert found.validate(dark, clock=clock).holds
    promised = [found.promise(seconds) for seconds in np.linspace(0, 0.2, 50)]
    assert promised == sorted(promised)
    for seconds in np.linspace(found.least, 0.2, 9):
        low, high = found.interval(seconds)
        assert low <= found.promise(seconds) <= high


@pytest.mark.parametrize("wrong", [7.0, float("nan")])
def test_a_score_that_is_none_is_refused_as_when_measuring(wrong):
    @anytime.module(
        quality=lambda value, scene: wrong if scene.name == "odd" else value, name="see"
    )
    def scored_oddly(x):
        anytime.charge(1)
        yield x

    def problem(name):
        return SimpleNamespace(name=name, x=0.5)

    library = anytime.measure(
        scored_oddly, [problem("a"), problem("b")], seconds=1.0, clock=lambda: WorkClock(MACHINE)
    )
    compiled = compiler.compile(scored_oddly, library)
    asked = {"budgets": np.array([0.01, 0.02]), "clock": lambda: WorkClock(MACHINE)}
    assert len(compiled.validate([problem("c"), problem("d")], **asked).rows) == 2
    with pytest.raises(AnytimeError, match=r"of 'see' is .* on problem"):
        compiled.validate([problem("c"), problem("odd")], **asked)
