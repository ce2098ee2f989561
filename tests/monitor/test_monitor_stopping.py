"""Stopping rules: what they may return, what a look costs, and that none is chosen by chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from monitor.stopping import (
    STOP,
    History,
    Runs,
    Stop,
    Task,
    choose,
    errors_apart,
    fixed_contract,
    held_out,
    parts,
    standard_error,
    stop_runs,
)
from monitor.stopping_regressions import forecast, true_of_seen
from monitor.stopping_rules import LEARNERS, dynamic_programming

SECONDS = np.arange(1.0, 31.0)
TASK = Task(lambda quality, seconds: 100.0 * quality - seconds)


def recorded(count=40, seed=0, seconds=SECONDS):
    """Runs of which half are soon through and half go on to gain."""
    rng = np.random.default_rng(seed)
    pace = np.where(np.arange(count) % 2, 3.0, 12.0)[:, None]
    quality = 1 - np.exp(-seconds / pace) + 0.01 * rng.normal(size=(count, len(seconds)))
    quality = np.maximum.accumulate(np.clip(quality, 0, 1), axis=1)
    return Runs(seconds, quality, 0.9 * quality)


def test_fixed_contract_stops_where_the_mean_is_best_and_never_looks():
    runs = recorded()
    stopped = stop_runs(fixed_contract(runs, TASK), runs, Task(TASK.utility, look=5.0))
    mean = runs.utilities(TASK).mean(axis=0)
    assert set(stopped.seconds) == {SECONDS[mean.argmax()]}
    assert not stopped.looks.any()
    assert stopped.utility.mean() == pytest.approx(mean.max())


def test_rule_of_ones_own_is_a_function_of_the_history():
    def patient(history):
        if len(history.seconds) >= 2 and history.quality[-1] - history.quality[-2] < 0.02:
            return STOP
        return 2.0

    runs = recorded()
    stopped = stop_runs(patient, runs, TASK)
    assert (stopped.looks == stopped.seconds / 2).all()
    assert stopped.seconds[1::2].mean() < stopped.seconds[::2].mean()


def test_each_look_is_paid_for():
    runs = recorded()
    free, dear = (
        stop_runs(lambda history: 3.0, runs, Task(TASK.utility, look=cost)) for cost in (0.0, 0.5)
    )
    assert np.allclose(free.utility - dear.utility, 0.5 * free.looks)


def test_rule_may_stop_later_without_looking():
    runs = recorded()
    rule = lambda history: 4.0 if not len(history.seconds) else Stop(2.5)  # noqa: E731
    stopped = stop_runs(rule, runs, TASK)
    assert set(stopped.seconds) == {7.0}
    assert set(stopped.looks) == {1}


def test_who_never_stops_is_stopped_by_the_last_time():
    stopped = stop_runs(lambda history: 1.0, recorded(), TASK)
    assert set(stopped.seconds) == {SECONDS[-1]}
    assert set(stopped.looks) == {len(SECONDS)}


def test_who_hardly_goes_on_comes_to_the_next_time():
    stopped = stop_runs(lambda history: 1e-9, recorded(), TASK)
    assert set(stopped.looks) == {len(SECONDS)}


def test_a_fixed_contract_that_is_asked_late_stops_at_the_same_time_or_at_once():
    runs = recorded()
    rule = fixed_contract(runs, TASK)
    best = rule(History(SECONDS[:0], SECONDS[:0])).after
    seen = runs.seen[0]
    assert 3 < best < 27
    assert rule(History(SECONDS[:3], seen[:3])).after == best - 3.0
    assert rule(History(SECONDS[:28], seen[:28])).after == 0.0


def test_who_stops_at_once_has_what_there_is_first():
    stopped = stop_runs(lambda history: STOP, recorded(), TASK)
    assert set(stopped.seconds) == {SECONDS[0]}
    assert not stopped.looks.any()


def test_seconds_count_from_the_last_look():
    runs = recorded()
    rule = lambda history: Stop(2.0) if len(history.seconds) else 1.0  # noqa: E731
    assert set(stop_runs(rule, runs, TASK).seconds) == {3.0}


@pytest.mark.parametrize(
    "answer", [0.0, -1.0, float("nan"), None, True, Stop, Stop(-1.0), Stop(float("inf"))]
)
def test_what_is_no_time_is_refused(answer):
    with pytest.raises(AnytimeError, match="a rule"):
        stop_runs(lambda history: answer, recorded(), TASK)


@pytest.mark.parametrize("name", LEARNERS)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 1000), begin=st.sampled_from([0.0, 1.0]))
def test_every_rule_stops_every_run_and_loses_nothing_impossible(name, seed, begin):
    runs = recorded(12, seed, SECONDS - 1 + begin)
    stopped = stop_runs(LEARNERS[name](runs, TASK), runs, TASK)
    assert (stopped.loss >= 0).all()
    assert np.isin(stopped.seconds, runs.seconds).all()


@pytest.mark.parametrize("name", ["forecast", "regression", "dynamic_programming"])
def test_looking_pays_where_runs_differ(name):
    runs = recorded(60)
    folds = parts(60, 6, np.arange(60))
    fixed = held_out(runs, TASK, fixed_contract, folds)
    assert errors_apart(fixed, held_out(runs, TASK, LEARNERS[name], folds)) > 2


def test_dynamic_programming_looks_less_the_dearer_a_look_is():
    runs = recorded(60)
    looks = []
    for cost in (0.0, 0.5, 1000.0):
        task = Task(TASK.utility, look=cost)
        looks.append(stop_runs(dynamic_programming(runs, task), runs, task).looks.mean())
    assert looks[0] >= looks[1] > 0
    assert looks[2] == 0


def test_looks_too_dear_make_of_dynamic_programming_the_fixed_contract():
    runs, task = recorded(), Task(TASK.utility, look=1000.0)
    ours = stop_runs(dynamic_programming(runs, task), runs, task).seconds
    assert (ours == stop_runs(fixed_contract(runs, task), runs, task).seconds).all()


def test_fixed_contract_is_kept_where_runs_are_alike():
    quality = np.tile(1 - np.exp(-SECONDS / 6), (20, 1))
    runs = Runs(SECONDS, quality, quality)
    choice = choose(runs, TASK, {"forecast": forecast}, folds=5, rng=np.random.default_rng(0))
    assert choice.name == "fixed"


def test_better_rule_is_chosen_and_of_two_equal_ones_the_first():
    learners = {"mine": forecast, "twin": forecast}
    choice = choose(recorded(60), TASK, learners, folds=6, rng=np.random.default_rng(0))
    assert choice.name == "mine"
    assert set(choice.losses) == {"mine", "twin", "fixed"}


def test_runs_are_parted_in_ten_unless_told_otherwise():
    choose(recorded(10), TASK, {"forecast": forecast}, rng=np.random.default_rng(0))
    with pytest.raises(AnytimeError, match="9 runs in 10 folds"):
        choose(recorded(9), TASK, {"forecast": forecast}, rng=np.random.default_rng(0))


def test_folds_share_the_runs_out():
    folds = parts(23, 5, np.random.default_rng(0).permutation(23))
    assert sorted(np.concatenate(folds)) == list(range(23))
    assert {len(fold) for fold in folds} == {4, 5}
    assert [len(parts(count, folds, np.arange(count))) for count, folds in ((2, 2), (5, 2))] == [
        2,
        2,
    ]
    for folds in (0, 1, 4, 5):
        with pytest.raises(AnytimeError, match="folds"):
            parts(3, folds, np.arange(3))


def test_scale_of_what_is_seen_is_learnt():
    intercept, slope = true_of_seen(recorded())
    assert intercept == pytest.approx(0.0, abs=1e-9)
    assert slope == pytest.approx(1 / 0.9)


@pytest.mark.parametrize(
    ("seconds", "quality", "message"),
    [
        (np.arange(3.0), np.zeros((2, 4)), "seconds has shape"),
        (np.zeros(4), np.zeros((2, 4)), "increase"),
        (np.arange(4.0), np.full((2, 4), np.nan), "finite"),
        (np.arange(4.0), np.zeros(4), "same shape"),
        (np.arange(4.0), np.zeros((2, 2, 4)), "same shape"),
        (np.arange(4.0), np.zeros((0, 4)), "seconds has shape"),
        (np.array([0.0, 1.0, 1.0, 2.0]), np.zeros((2, 4)), "increase"),
    ],
)
def test_runs_that_do_not_fit_are_refused(seconds, quality, message):
    with pytest.raises(AnytimeError, match=message):
        Runs(seconds, quality, quality)


@pytest.mark.parametrize("utility", [lambda q, t: 5.0, lambda q, t: q * np.nan])
def test_a_utility_must_be_a_finite_number_at_every_time(utility):
    with pytest.raises(AnytimeError, match="utility must give a finite number for each"):
        fixed_contract(recorded(), Task(utility))
    with pytest.raises(AnytimeError, match="give a function"):
        Task(None)  # pyright: ignore[reportArgumentType]


def test_what_was_seen_is_as_much_as_there_was_and_finite():
    there = np.zeros((2, 4))
    with pytest.raises(AnytimeError, match="same shape"):
        Runs(np.arange(4.0), there, np.zeros((2, 3)))
    one_missing = np.array([[0.0, 0.0, np.nan, 0.0]] * 2)
    for quality, seen in ((one_missing, there), (there, one_missing)):
        with pytest.raises(AnytimeError, match="finite"):
            Runs(np.arange(4.0), quality, seen)


@pytest.mark.parametrize("look", [-0.1, float("nan"), float("inf")])
def test_a_look_costs_a_finite_number(look):
    with pytest.raises(AnytimeError, match="look"):
        Task(TASK.utility, look)


def patient(unit):
    """Looks every third of a unit of time, three times, and stops a third later."""
    return lambda history: unit / 3 if len(history.seconds) < 3 else Stop(unit / 3)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 86400.0, 1e12])
def test_the_unit_of_time_makes_no_difference(unit):
    runs = recorded(seconds=unit * np.arange(1, 31) / 3)
    stopped = stop_runs(patient(unit), runs, TASK)
    assert set(stopped.looks) == {3}
    assert set(stopped.seconds) == {runs.seconds[3]}


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_unit_of_utility_makes_no_difference_to_what_is_missed(unit):
    runs = recorded()
    task = Task(lambda quality, seconds: unit * TASK.utility(quality, seconds))
    ours, theirs = (stop_runs(lambda history: 3.0, runs, each) for each in (task, TASK))
    assert ours.loss == pytest.approx(theirs.loss)
    best = runs.utilities(TASK).max(axis=1)
    assert theirs.loss * best == pytest.approx(best - theirs.utility)


def test_the_standard_error_is_of_a_mean_of_a_sample():
    assert standard_error(np.array([0.0, 2.0])) == pytest.approx(1.0)
    assert standard_error(np.array([1.0, 2.0, 3.0, 4.0])) == pytest.approx(np.sqrt(5 / 12))


def at_time(seconds):
    """Learns nothing and stops there."""
    return lambda runs, task: lambda history: Stop(seconds)


@given(st.integers(0, 500), st.integers(0, 29), st.integers(0, 29))
@settings(max_examples=60)
def test_a_rule_is_chosen_if_it_is_a_standard_error_better_and_nearly_the_best(seed, one, other):
    runs = recorded(10, seed)
    learners = {"one": at_time(SECONDS[one]), "other": at_time(SECONDS[other])}
    choice = choose(runs, TASK, learners, folds=5, rng=np.random.default_rng(seed))
    losses = {name: loss.mean() for name, loss in choice.losses.items()}

    def apart(more, less):
        difference = choice.losses[more] - choice.losses[less]
        return difference.mean() / max(difference.std(ddof=1) / np.sqrt(10), 1e-12)

    best = min(losses, key=losses.get)
    nearly = [name for name in learners if apart(name, best) <= 1.0]
    better = [name for name in nearly if apart("fixed", name) >= 1.0]
    assert choice.name == (better[0] if better else "fixed")


def test_a_run_in_which_nothing_can_be_had_does_not_decide_alone():
    seconds = np.arange(0.0, 20.0)
    scale = np.random.default_rng(0).choice([3.0, 8.0], (60, 1))
    quality = 1 - np.exp(-seconds / scale)
    task = Task(lambda q, t: 100 * q - t)
    names = []
    for stuck in (False, True):
        if stuck:
            quality[0] = 0.0
        chosen = choose(
            Runs(seconds, quality, quality), task, LEARNERS, folds=5, rng=np.random.default_rng(1)
        )
        names.append(chosen.name)
        assert all(np.abs(losses).max() < 100 for losses in chosen.losses.values())
    assert names[0] == names[1] != "fixed"


def test_a_rule_that_is_better_than_fixed_is_taken_though_one_before_it_is_not():
    noise = np.random.default_rng(398).normal(0.5, 0.15, (20, 3))
    quality = np.clip(noise + np.array([0, 0.02, 0.03]), 0.05, 1)

    def at(level):
        return lambda runs, task: (
            lambda history: STOP if len(history.seconds) and history.quality[-1] > level else 1.0
        )

    chosen = choose(
        Runs([1.0, 2.0, 3.0], quality, quality),
        Task(lambda q, t: q + 0 * t),
        {"one": at(0.75), "two": at(0.55)},
        folds=5,
        rng=np.random.default_rng(0),
    )
    assert errors_apart(chosen.losses["fixed"], chosen.losses["two"]) >= 1.0
    assert chosen.name == "two"


def test_no_rule_may_be_called_fixed():
    runs = Runs([1.0, 2.0], np.ones((4, 2)), np.ones((4, 2)))
    with pytest.raises(AnytimeError, match="'fixed' is the fixed contract"):
        choose(
            runs, Task(lambda q, t: q), {"fixed": fixed_contract}, folds=2,
            rng=np.random.default_rng(0),
        )  # fmt: skip


def test_a_rule_cannot_change_what_was_recorded():
    quality = np.linspace(0, 1, 6).reshape(2, 3)
    runs = Runs([1.0, 2.0, 3.0], quality, quality)

    def cheats(history):
        history.quality[:] = 1.0
        return STOP

    with pytest.raises(ValueError, match="read-only"):
        stop_runs(lambda history: cheats(history) if len(history.seconds) else 1.0, runs, TASK)
    assert (quality == np.linspace(0, 1, 6).reshape(2, 3)).all()
