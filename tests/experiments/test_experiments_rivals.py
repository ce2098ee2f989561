"""The rivals get the same program as we do, honestly turned into what each of them takes."""

from __future__ import annotations

import functools
import importlib.util
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from experiments.benchmarks.rivals import (
    RIVALS,
    KeyRng,
    Problem,
    Stop,
    TrialRng,
    Watch,
    installed,
    measured_layout,
    missing,
    plain_world,
)
from experiments.benchmarks.rivals.moving_peaks import (
    DIMENSIONS,
    PERIOD,
    Course,
    Landscape,
    offline_error,
    peaks,
)
from experiments.benchmarks.rivals.swarms import PEERS

DISTRIBUTIONS = {
    "flip": (lambda rng: rng.flip("a", 0.3), 0.3, 0.21),
    "randint": (lambda rng: rng.randint("a", 4), 1.5, 1.25),
    "gaussian": (lambda rng: rng.gaussian("a", 2.0, 3.0), 2.0, 9.0),
    "uniform": (lambda rng: rng.uniform("a", -1.0, 5.0), 2.0, 3.0),
    "categorical": (lambda rng: rng.categorical("a", (1.0, 0.0, 3.0)), 1.5, 0.75),
    "exponential": (lambda rng: rng.exponential("a", 2.0), 2.0, 4.0),
    "lognormal": (
        lambda rng: rng.lognormal("a", 0.1, 0.4),
        math.exp(0.18),
        (math.exp(0.16) - 1.0) * math.exp(0.36),
    ),
}


def five(rng: Any, w: Any) -> float:
    """The paper's program: as many numbers as it likes, whose sum shall be five."""
    total = 0.0
    while rng.flip("more", 0.7):
        total += rng.gaussian("value", 0.0, 1.0)
    return abs(total - w.wanted)


def stopped(call: Callable[[Any], Any], argument: Any) -> bool:
    """Whether the call stops its search."""
    try:
        call(argument)
    except Stop:
        return True
    return False


def problem() -> Problem:
    world = plain_world({"wanted": 5.0})
    return Problem(five, world, measured_layout(five, world, np.random.default_rng(0)))


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_evenly_spread_keys_give_the_mean_and_the_variance_of_the_distribution(name):
    draw, mean, variance = DISTRIBUTIONS[name]
    rng, values = KeyRng({"a": 1}), []
    for key in (np.arange(20_000) + 0.5) / 20_000:
        rng.load([float(key)])
        values.append(draw(rng))
    assert np.mean(values) == pytest.approx(mean, rel=1e-3)
    assert np.var(values) == pytest.approx(variance, rel=1e-2)


@pytest.mark.parametrize("name", DISTRIBUTIONS)
@given(key=st.floats(0.0, 1.0))
@settings(max_examples=30)
def test_every_key_gives_a_finite_value_and_a_larger_key_none_that_is_less(name, key):
    draw, _, _ = DISTRIBUTIONS[name]
    rng, values = KeyRng({"a": 1}), []
    for one in (0.0, key, 1.0):
        rng.load([one])
        values.append(draw(rng))
    assert np.isfinite(values).all()
    assert sorted(values, reverse=name == "flip") == values


def test_each_source_reads_its_own_stretch_and_is_neutral_beyond_it():
    rng = KeyRng({"x": 2, "more": 1})
    assert rng.size == 3
    rng.load([0.25, 0.75, 0.0])
    assert [rng.uniform("x", 0.0, 1.0) for _ in range(3)] == [0.25, 0.75, 0.5]
    assert [rng.flip("more", 0.7) for _ in range(2)] == [True, False]
    assert rng.gaussian("elsewhere", 3.0, 1.0) == 3.0
    rng.load([0.5, 0.5, 0.9])
    assert not rng.flip("more", 0.7)


def test_a_layout_without_calls_is_refused():
    with pytest.raises(AnytimeError, match="calls at most"):
        KeyRng({"x": -1})


def test_the_measured_layout_holds_most_random_runs():
    layout = measured_layout(five, plain_world({"wanted": 5.0}), np.random.default_rng(1))
    assert set(layout) == {"more", "value"}
    # P(calls of "more" > n) = 0.7^n, 5 % of which are left out.
    assert layout["more"] == pytest.approx(math.log(0.05) / math.log(0.7), abs=2)
    assert layout["value"] == layout["more"] - 1


def test_a_program_may_do_without_a_world_and_may_be_wrapped():
    @functools.lru_cache
    def wrapped(rng: Any) -> float:
        return rng.uniform("x", 0.0, 2.0)

    value = Problem(wrapped, None, {"x": 1}).objective()
    assert value(np.array([0.5])) == value([0.5]) == 1.0
    assert measured_layout(wrapped, None, np.random.default_rng(0)) == {"x": 1}


def test_the_plain_world_holds_python_numbers_under_the_same_indices():
    world = plain_world({"a": np.array([1.0, 2.0]), "b": np.eye(2), "c": 3})
    assert (world.a[1], world.b[1, 1], world.b[0, 1], world.c) == (2.0, 1.0, 0.0, 3)
    assert type(world.a[0]) is type(world.b[0, 0]) is float


def test_a_watch_counts_keeps_the_best_and_stops_at_the_target():
    watch = Watch(float, 60.0, 1.0)
    for value in (5.0, math.nan, 3.0, 4.0):
        watch(value)
    with pytest.raises(Stop):
        watch(0.5)
    trail = watch.trail
    assert (trail.evaluations, trail.best, trail.reached_evaluations) == (5, 0.5, 5)
    assert trail.reached_seconds == trail.seconds >= 0.0


def test_a_watch_stops_when_its_cpu_seconds_are_spent():
    watch = Watch(lambda value: value, 0.01, -1.0)
    while not stopped(watch, 1.0):
        pass
    trail = watch.trail
    assert trail.reached_seconds is None
    assert trail.reached_evaluations is None
    assert trail.rate * trail.seconds == pytest.approx(trail.evaluations)


def test_a_watch_without_a_budget_is_refused():
    with pytest.raises(AnytimeError, match="not positive"):
        Watch(float, 0.0, 1.0)


def test_every_rival_is_either_here_or_missing_with_the_reason():
    assert set(installed()) | set(missing()) == set(RIVALS)
    assert all("pip install" in reason for reason in missing().values())


@pytest.mark.parametrize("name", RIVALS)
def test_a_rival_reduces_the_toy_on_a_tiny_budget(name):
    if name in missing():
        pytest.skip(missing()[name])
    begin = time.thread_time()
    trail = RIVALS[name].search(problem(), 0.25, 2.0, 1)
    assert trail.evaluations > 1
    assert trail.best < 5.0
    assert trail.seconds <= time.thread_time() - begin
    assert (trail.reached_evaluations is None) == (trail.best > 2.0)


def test_a_rival_repeats_itself_with_the_same_seed():
    trails = [RIVALS["scipy.de"].search(problem(), 60.0, 0.01, 3) for _ in range(2)]
    assert trails[0].best == trails[1].best <= 0.01
    assert trails[0].evaluations == trails[1].evaluations


def test_a_trial_names_its_choices_by_source_and_index():
    class Trial:
        names: list[str] = []

        def suggest_float(self, name: str, low: float, high: float) -> float:
            self.names.append(name)
            return low + 0.25 * (high - low)

    rng = TrialRng(Trial())
    assert rng.uniform("x", 0.0, 4.0) == 1.0
    assert rng.flip("more", 0.7)
    assert rng.gaussian("x", 0.0, 1.0) == pytest.approx(-0.67449, abs=1e-5)
    assert Trial.names == ["x#0", "more#0", "x#1"]


def test_our_peaks_are_deaps_through_fifty_changes():
    if importlib.util.find_spec("deap") is None:
        pytest.skip("deap is not installed: pip install 'anytime-robots[bench]'")
    movingpeaks = importlib.import_module("deap.benchmarks.movingpeaks")

    class Draws:
        """A numpy generator with the names of Python's."""

        def __init__(self, rng: np.random.Generator) -> None:
            self.uniform, self.random = rng.uniform, rng.random
            self.gauss = rng.normal

    theirs = movingpeaks.MovingPeaks(
        DIMENSIONS, random=Draws(np.random.default_rng(4)), **movingpeaks.SCENARIO_2
    )
    ours, rng = Landscape(np.random.default_rng(4)), np.random.default_rng(5)
    keys = KeyRng({"x": DIMENSIONS})
    for _ in range(51):
        points = rng.uniform(-5.0, 105.0, (20, DIMENSIONS))
        world = plain_world(ours.world())
        for point, value in zip(points, ours.values(points), strict=True):
            expected = theirs(point.tolist(), count=False)[0]
            assert value == pytest.approx(expected, rel=0.0, abs=1e-12)
            keys.load((point / 100.0).tolist())
            assert peaks(keys, world) == pytest.approx(
                theirs.globalMaximum()[0] - expected, rel=0.0, abs=1e-12
            )
        ours.change()
        theirs.changePeaks()


def test_offline_error_is_deaps():
    if importlib.util.find_spec("deap") is None:
        pytest.skip("deap is not installed: pip install 'anytime-robots[bench]'")
    movingpeaks = importlib.import_module("deap.benchmarks.movingpeaks")
    rng = np.random.default_rng(7)

    class Draws:
        uniform, random, gauss = rng.uniform, rng.random, rng.normal

    theirs = movingpeaks.MovingPeaks(DIMENSIONS, random=Draws, **movingpeaks.SCENARIO_2)
    course = Course(Landscape(np.random.default_rng(7)), 3)
    points = np.random.default_rng(8).uniform(0.0, 100.0, (PERIOD + 700, DIMENSIONS))
    for point in points.tolist():
        theirs(point)
    course.evaluate(points)
    assert course.changes == 1
    assert course.offline_error == pytest.approx(theirs.offlineError(), rel=1e-9)


@given(cuts=st.lists(st.integers(1, 400), min_size=1, max_size=30))
@settings(max_examples=10, deadline=None)
def test_offline_error_depends_on_the_points_and_not_on_how_they_are_grouped(cuts):
    points = np.random.default_rng(9).uniform(0.0, 100.0, (2 * PERIOD, DIMENSIONS))
    whole, parts, native = (Course(Landscape(np.random.default_rng(2)), 2) for _ in range(3))
    with pytest.raises(Stop):
        whole.evaluate(points)
    assert [stopped(parts.evaluate, part) for part in np.split(points, np.cumsum(cuts))][-1]
    rest, field, stop = points, native.landscape, False
    while not stop:
        count = min(native.remaining, cuts[0])
        stop = stopped(native.charge, field.optimum - field.values(rest[:count]))
        rest = rest[count:]
    assert len(rest) == 0
    assert parts.offline_error == pytest.approx(whole.offline_error, rel=1e-12)
    assert native.offline_error == pytest.approx(whole.offline_error, rel=1e-12)


def test_native_evaluations_are_not_charged_across_a_change():
    course = Course(Landscape(np.random.default_rng(0)), 2)
    with pytest.raises(AnytimeError, match="5000"):
        course.charge(np.ones(PERIOD + 1))
    with pytest.raises(AnytimeError, match="periods"):
        Course(course.landscape, 0)


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_follows_the_peaks_far_better_than_random_points_do(name):
    def anywhere(course: Course, rng: np.random.Generator) -> None:
        while True:
            course.evaluate(rng.uniform(0.0, 100.0, (100, DIMENSIONS)))

    assert offline_error(PEERS[name], 3, 6) < 0.4 * offline_error(anywhere, 3, 6)
    assert offline_error(PEERS[name], 3, 2) == offline_error(PEERS[name], 3, 2)
