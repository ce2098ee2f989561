"""The decision table is the optimum; what is computed of a policy is what its missions show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from monitor.certainty import resolve, worth_by_time_left
from monitor.decision_process import (
    DecisionProcess,
    Moment,
    steady_planning,
    uneven_progress,
)
from monitor.decision_table import evaluate, simulate, solve, solve_cautiously
from monitor.frame_rules import (
    argmax_contract,
    constant_rule,
    evaluate_frames,
    expected_lengths,
    paper_rule,
    simulate_frames,
    tuned_constant_rule,
)


def process(rate=0.6, thinking=0.0, value=None, factors=(0.5, 1.0, 1.5), frames=3):
    speeds = np.array([1.0, 2.0, 4.0])
    return DecisionProcess(
        frames=frames,
        lengths=(0, 9, 7, 6, 5),
        planning=steady_planning(4, rate),
        speeds=tuple(speeds),
        progress=uneven_progress(speeds, factors, (0.25, 0.5, 0.25)),
        energy=0.05 * speeds**2,
        value=10.0 * (np.arange(31) <= 24) if value is None else value,
        thinking=thinking,
    )


processes = st.builds(
    process,
    rate=st.floats(0.2, 1.0),
    thinking=st.sampled_from([0.0, 0.1, 0.4]),
    value=st.sampled_from([None, np.linspace(10, 0, 28), 8 * 0.9 ** np.arange(20)]),
    factors=st.sampled_from([(1.0, 1.0, 1.0), (0.4, 1.0, 1.3)]),
    frames=st.integers(1, 2),
)


def by_definition(p: DecisionProcess) -> float:
    """The optimum by recursion over what can happen, with nothing in common with the kernels."""

    @cache
    def worth(f, x, y, t):
        if t == p.ticks:
            return 0.0
        if f == 0 and x == 0:
            return float(p.value[t])
        options = []
        for think in (True, False) if f > 0 else (False,):
            levels = enumerate(p.planning[y]) if think else [(y, 1.0)]
            levels = [(z, share) for z, share in levels if share > 0]
            price = p.thinking if think else 0.0
            for v in range(len(p.speeds)) if x > 0 else (None,):
                steps = [(0, 1.0)] if v is None else enumerate(p.progress[v])
                cost = price + (0.0 if v is None else p.energy[v])
                options.append(
                    sum(
                        share * chance * worth(f, max(x - s, 0), z, t + 1)
                        for s, share in steps
                        if share > 0
                        for z, chance in levels
                    )
                    - cost
                )
        if x == 0 and y > 0:
            options.append(worth(f - 1, p.lengths[y], 0, t))
        return max(options)

    return worth(p.frames, 0, 0, 0)


@settings(max_examples=5, deadline=None)
@given(processes)
def test_table_is_the_optimum_by_definition(p):
    table = solve(p)
    assert table.promised == pytest.approx(by_definition(p), abs=1e-9)
    assert evaluate(p, table.actions) == pytest.approx(table.promised, abs=1e-9)


@settings(max_examples=6, deadline=None)
@given(processes)
def test_no_policy_is_worth_more_than_the_table(p):
    best = solve(p).promised + 1e-9
    assert evaluate(p, solve_cautiously(p).actions) <= best
    assert evaluate(p, resolve(p)) <= best
    assert evaluate(p, resolve(p, caution=2.0)) <= best
    assert evaluate_frames(p, paper_rule(p)) <= best
    assert evaluate_frames(p, paper_rule(p, gain=1.0)) <= best


@pytest.mark.parametrize("gain", [0.0, 1.0])
@pytest.mark.parametrize("thinking", [0.0, 0.1])
def test_computed_worth_of_a_frame_rule_is_the_mean_of_its_missions(gain, thinking):
    p = process(thinking=thinking)
    rng = np.random.default_rng(0)
    for rule in (paper_rule(p, gain), replace(constant_rule(p, 3, 1), gain=gain)):
        nets = simulate_frames(p, rule, rng.random((20_000, p.ticks, 2)))
        error = nets.std() / np.sqrt(len(nets))
        assert abs(nets.mean() - evaluate_frames(p, rule)) < 4 * error


def test_computed_worth_of_a_table_is_the_mean_of_its_missions():
    p = process(thinking=0.05)
    for actions in (solve(p).actions, resolve(p)):
        nets = simulate(p, actions, 20_000, np.random.default_rng(1))
        assert abs(nets.mean() - evaluate(p, actions)) < 4 * nets.std() / np.sqrt(len(nets))


def test_decide_is_a_look_up_of_the_table():
    p = process()
    table = solve(p)
    rng = np.random.default_rng(2)
    for _ in range(200):
        t, f, x, y = (int(rng.integers(0, size)) for size in p.shape)
        assert table.decide(Moment(f, x, y, t)) == p.move(int(table.actions[t, f, x, y]))


def test_first_it_stands_and_thinks_and_at_the_end_it_walks_without_thinking():
    table = solve(process())
    first, last = table.decide(Moment(3, 0, 0, 0)), table.decide(Moment(0, 5, 0, 10))
    assert (first.speed, first.think, first.start) == (0.0, True, False)
    assert last.speed > 0
    assert not last.think


def test_thinking_that_costs_is_stopped():
    p = process(thinking=0.5, rate=0.3)
    table = solve(p)
    assert not table.decide(Moment(2, 6, 3, 5)).think
    assert solve(process(rate=0.3)).decide(Moment(2, 6, 3, 5)).think


def test_more_time_is_never_worth_less_where_energy_is_free():
    table = solve(replace(process(), energy=np.zeros(3)))
    assert (np.diff(table.worth, axis=0) <= 1e-5).all()


def test_mission_that_is_not_worth_its_cost_is_never_begun():
    p = process(thinking=0.4, value=np.full(20, 0.5))
    table = solve(p)
    assert table.promised == 0.0
    assert table.decide(Moment(3, 0, 0, 0)) == (0.0, False, False)


def test_slower_planner_keeps_its_rates_in_proportion():
    p = process(rate=0.6)
    assert np.allclose(p.slower(1.5).planning, steady_planning(4, 0.4))
    assert p.thinking_times[0, 4] == pytest.approx(4 / 0.6)
    assert p.slower(1.5).thinking_times[0, 4] == pytest.approx(10.0)
    with pytest.raises(AnytimeError, match=">= 1"):
        p.slower(0.5)


def test_uneven_progress_keeps_its_mean():
    rows = uneven_progress([1.0, 2.0, 5.0], (0.4, 1.0, 1.3), (0.25, 0.5, 0.25))
    assert np.allclose(rows @ np.arange(rows.shape[1]), 0.925 * np.array([1, 2, 5]))
    assert np.allclose(rows.sum(axis=1), 1.0)


def test_paper_drives_slower_for_linear_value_when_energy_is_dear():
    p = process(value=np.linspace(10, 0, 28))
    dear = replace(p, energy=4 * p.energy)
    begun = Moment(2, 7, 0, 4)
    assert argmax_contract(dear)(begun)[1] <= argmax_contract(p)(begun)[1]


def test_tuned_constant_rule_is_the_best_constant_on_its_missions():
    p = process()
    chance = np.random.default_rng(3).random((200, p.ticks, 2))
    tuned = simulate_frames(p, tuned_constant_rule(p, chance), chance).mean()
    assert tuned >= simulate_frames(p, constant_rule(p, 5, 1), chance).mean()


def test_expected_length_falls_with_thinking():
    lengths = expected_lengths(process())
    assert (np.diff(lengths[1:]) <= 0).all()
    assert lengths[-1] == pytest.approx(5.0, rel=0.01)


def test_worth_by_time_left_is_smoothed_only_with_caution():
    p = process()
    sharp, smooth = (worth_by_time_left(p, caution, 30) for caution in (0.0, 2.0))
    assert set(np.unique(sharp)) == {0.0, 10.0}
    assert 0 < smooth[0, 24] < 10


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lengths": (1, 9, 7, 6, 5)}, "level 0"),
        ({"planning": np.eye(3)}, "planning has shape"),
        ({"planning": np.zeros((5, 5))}, "sum to 1"),
        ({"frames": 0}, "at least 1 frame"),
        ({"value": np.array([np.nan])}, "finite"),
        ({"energy": np.zeros(2)}, "energy has shape"),
    ],
)
def test_processes_that_do_not_fit_are_refused_in_one_line(change, message):
    with pytest.raises(AnytimeError, match=message):
        replace(process(), **change)
