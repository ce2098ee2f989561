"""Promises are what the divisions achieve, and never fall as the tables' level rises."""

from __future__ import annotations

import functools
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import anytime
import compiler
from anytime import Machine, WorkClock, measure
from compiler import compile
from compiler.calibrating import _blocks, _isotonic, _standing, calibrate_by_running
from compiler.division import divide, expected_quality, moments_within
from compiler.guarding import guards_of
from compiler.loading import check_calibration
from compiler.replaying import replay_of
from compiler.tables import tables
from experiments.benchmarks.compiler_promises import (
    FAMILIES,
    MACHINE,
    achieved,
    budgets_of,
    cases,
    compiled_from,
)

values_of = arrays(float, st.tuples(st.integers(2, 8), st.integers(1, 8)), elements=st.floats(0, 1))


@given(values_of)
def test_calibrations_never_fall_and_hold_their_promise_in_their_interval(values):
    """Not by the last bit, in which means of equal numbers differ: the reader is as strict."""
    levels = np.linspace(0.0, 1.0, values.shape[1])
    for lived in (values, np.repeat(values[:, :1], values.shape[1], axis=1)):
        calibration = _isotonic(levels, lived)
        check_calibration(Path("program.schedule"), np.array(calibration.rows()))
        asked = np.linspace(0, 1, 30)
        assert np.diff([calibration.promise(level) for level in asked]).min() >= -1e-12


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_pooling_keeps_the_mean_and_rises(means):
    blocks = _blocks(np.array(means))
    pooled = [float(np.mean(means[block])) for block in blocks]
    assert [i for b in blocks for i in range(b.start, b.stop)] == list(range(len(means)))
    assert (np.diff(pooled) > -1e-9).all()


def test_what_is_surely_worse_with_more_time_is_dropped():
    good = np.linspace(0.4, 0.6, 20)
    values = np.stack([good, good + 0.1, good - 0.1, good + 0.099, good + 0.2], axis=1)
    assert _standing(values).tolist() == [True, True, False, False, True]
    noisy = np.stack([good, good[::-1] - 0.01], axis=1)
    assert _standing(noisy).all()


@functools.cache
def smooth():
    return compiled_from(FAMILIES["smooth"](), cases(12, 1))


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_of_divisions_that_were_run_those_are_kept_that_are_the_best_with_no_more_time(seed):
    rng = np.random.default_rng(seed)
    compiled = smooth()
    jagged = np.clip(rng.normal(0.5, 0.2, 500), 0, 1)

    def run(budgets):
        at = np.searchsorted(compiled.frontier.budgets, budgets)
        return np.clip(jagged[at] + rng.normal(0, 0.02, (40, len(budgets))), 0, 1)

    kept, calibration = calibrate_by_running(compiled.tables, compiled.frontier, run)
    rows = np.searchsorted(compiled.frontier.budgets, kept.budgets)
    assert (np.diff(jagged[rows]) > -0.02).all()
    assert np.abs(kept.promised - jagged[rows]).max() < 0.05
    assert calibration.promise(0.0) == 0.0


@pytest.mark.parametrize("name", ["hard", "gated tree", "either", "chosen"])
def test_promises_are_kept_where_tables_are_mistaken(name):
    compiled = compiled_from(FAMILIES[name](), cases(60, 1))
    unseen = cases(150, 2)
    for budget in budgets_of(compiled, 6)[2:]:
        reached = achieved(compiled, unseen, float(budget)).mean()
        assert compiled.promise(budget) == pytest.approx(reached, abs=0.09)


def test_a_faster_module_never_promises_less_after_calibration():
    program = FAMILIES["hard"]()
    library = measure(program, cases(25, 3), seconds=0.06, clock=lambda: WorkClock(MACHINE))
    normal = compile(program, library)
    for module in library:
        quick = compile(program, library, machine=MACHINE.with_rate(module, 0.0006))
        for budget in np.linspace(normal.least, 0.06, 20):
            assert quick.promise(budget) >= normal.promise(budget) - 1e-9


@pytest.mark.parametrize("name", ["hard", "gated tree", "either"])
def test_on_the_machine_of_its_profiles_a_program_is_the_same(name):
    program = FAMILIES[name]()
    library = measure(program, cases(25, 3), seconds=0.06, clock=lambda: WorkClock(MACHINE))
    here, there = compile(program, library), compile(program, library, machine=MACHINE)
    assert np.allclose(here.frontier.budgets, there.frontier.budgets, rtol=1e-9)
    assert np.allclose(here.frontier.shares, there.frontier.shares, atol=1e-12)
    assert np.allclose(here.frontier.promised, there.frontier.promised)


# Living a division again


def replayed(name, count=60):
    program = FAMILIES[name]()
    library = measure(program, cases(count, 4), seconds=0.06, clock=lambda: WorkClock(MACHINE))
    made = tables(program, library)
    replay = replay_of(program, library, guards_of(library), made)
    return made, divide(made), replay


@pytest.mark.parametrize("name", ["ladder", "early", "either", "chosen"])
def test_a_life_on_recordings_is_that_of_the_executor(name):
    compiled = compiled_from(FAMILIES[name](), cases(30, 4))
    replay = compiled.replay
    assert replay is not None
    by_name = {case.name: case for case in cases(30, 4)}
    problems = [by_name[name] for name in replay.problems]
    for budget in budgets_of(compiled, 5)[1:] * 1.0001:
        shares = [*compiled.allocate(budget).shares.values()]
        lived = replay.achieved(shares, float(budget))
        assert lived.mean() == pytest.approx(achieved(compiled, problems, budget).mean(), abs=0.02)


@settings(max_examples=20)
@given(st.floats(0.004, 0.09))
def test_more_time_in_the_same_division_is_never_worse_for_the_last_call(budget):
    _, frontier, replay = LADDER
    index = max(frontier.index(0.006), 0)
    shares = [float(s) for s in frontier.shares[index]]
    least = sum(shares)
    one = replay.achieved([*shares[:-1], least - sum(shares[:-1])], least)
    more = replay.achieved([*shares[:-1], least + budget - sum(shares[:-1])], least + budget)
    assert (more >= one - 1e-12).all()


LADDER = replayed("ladder")


def test_a_module_that_is_faster_or_better_or_longer_is_lived_as_such():
    _, frontier, replay = LADDER
    budget = float(frontier.budgets[-1])
    shares = [float(s) for s in frontier.shares[-1]]
    now = replay.achieved(shares, budget).mean()
    assert replay.better("b").achieved(shares, budget).mean() > now
    assert replay.faster("a", 2.0).achieved(shares, budget).mean() >= now - 1e-12
    assert replay.longer("b").achieved([shares[0], 3 * shares[1]], 3 * budget).mean() > now
    inside = replay.achieved(shares, budget, np.array([3, 1]))
    assert inside.tolist() == replay.achieved(shares, budget)[[3, 1]].tolist()


def test_problems_of_profiles_measured_apart_are_put_side_by_side():
    program = FAMILIES["ladder"]()
    library = measure(program, cases(12, 4), seconds=0.06, clock=lambda: WorkClock(MACHINE))
    apart = measure(program, cases(9, 5), seconds=0.06, clock=lambda: WorkClock(MACHINE))
    mixed = {"a": library["a"], "b": apart["b"]}
    made = tables(program, mixed)
    replay = replay_of(program, mixed, guards_of(mixed), made)
    assert len(replay.problems) == 9
    shares = [float(table.times[-1]) for table in made]
    lived = replay.achieved(shares, sum(shares)).mean()
    level = expected_quality(made, moments_within(made, shares))
    assert lived == pytest.approx(level, abs=0.05)


def test_a_last_step_that_is_cheaper_than_the_first_is_promised_where_it_is_begun():
    @anytime.module(quality=lambda value, problem: value, name="late")
    def late(x):
        for work, quality in ((5, 0.5), (1, 0.9)):
            anytime.charge(work)
            yield quality * x

    machine = Machine("m").with_rate("late", 0.01)
    library = anytime.measure(
        late,
        [SimpleNamespace(x=1 - 1e-9 * i) for i in range(30)],
        seconds=1.0,
        clock=lambda: WorkClock(machine),
    )
    compiled = compiler.compile(late, library)
    for budget, quality in ((0.05, 0.5), (0.06, 0.9), (0.08, 0.9), (5.0, 0.9)):
        assert compiled.run(budget, clock=WorkClock(machine), x=1.0).value == quality
        assert compiled.promise(budget) == pytest.approx(quality, abs=1e-6)
