"""Laws of divisions: optimal where it can be checked, and never below the plain ones."""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError
from anytime.joins import Best, Several
from anytime.structure import Arm
from compiler import division, equal_shares, maximal, minimal
from compiler.advising import advise
from compiler.baselines import divided
from compiler.division import divide, expected_quality, moments_within, output_chances
from compiler.explaining import explain
from compiler.objectives import EXPECTED, at_least, cvar, expected, quantile
from compiler.tables import Table
from experiments.benchmarks.compiler_trees import mismatch, random_program

SHAPES = {
    "one": ([],),
    "chain": ([], [0]),
    "three": ([], [0], [1]),
    "tree": ([], [], [0, 1]),
    "shared": ([], [0], [0, 1]),
    "four": ([], [0], [1], [2]),
}


def chancy(feeds: list[list[int]], seed: int, rising: bool = True) -> tuple[Table, ...]:
    """Tables of modules whose results are left to chance; `rising`: as time goes they improve."""
    rng = np.random.default_rng(seed)
    tables: list[Table] = []
    for place, fed in enumerate(feeds):
        count, moments = int(rng.integers(2, 6)), int(rng.integers(2, 7))
        levels = np.concatenate([[0.0], np.sort(rng.random(count - 1))])
        times = np.concatenate([[0.0], np.cumsum(rng.random(moments - 1) + 0.05)])
        shape = [len(tables[f].levels) for f in fed]
        chances = rng.dirichlet(np.full(count, 0.5), size=(*shape, moments))
        if rising:  # stochastically larger with time: the chance of each level or less falls
            below = np.minimum.accumulate(chances.cumsum(axis=-1), axis=-2)
            chances = np.diff(below, prepend=0.0, axis=-1)
        chances[..., 0, :] = np.eye(count)[0]
        for axis in range(len(shape)):
            chances[(slice(None),) * axis + (0,)] = np.eye(count)[0]
        chances = np.clip(chances, 0.0, None)
        chances /= chances.sum(axis=-1, keepdims=True)
        labels = tuple(f"call {f}" for f in fed)
        tables.append(
            Table(f"call {place}", f"m{place}", labels, levels, times, chances, float(times[1]))
        )
    return tuple(tables)


programs = st.builds(
    chancy,
    st.sampled_from(list(SHAPES.values())),
    st.integers(0, 2**32),
    st.booleans(),
)


def total(tables) -> float:
    return float(sum(table.times[-1] for table in tables))


# Against brute force


@pytest.mark.parametrize("shared", [False, True])
def test_no_division_of_a_program_without_chance_beats_the_compiled_one(shared):
    rng = np.random.default_rng(11 + shared)
    assert sum(mismatch(random_program(rng, shared)) for _ in range(300)) == 0


@pytest.mark.parametrize("most", [division.ALL, 0])
def test_a_result_of_quality_zero_is_not_mistaken_for_no_result(most, monkeypatch):
    """The first module's only result is worthless by itself, and yet the others need it."""
    monkeypatch.setattr(division, "ALL", most)
    quality = np.array([0.0, 0.0])
    sure = np.zeros((2, 2))
    sure[0, 0] = sure[1, 1] = 1.0
    fed = np.zeros((2, 2, 2))
    fed[..., 0] = 1.0
    fed[1, 1] = [0.0, 1.0]
    times = np.array([0.0, 1.0])
    tables = (
        Table("a", "a", (), quality, times, sure, 1.0),
        Table("b", "b", ("a",), quality, times, fed, 1.0),
        Table("c", "c", ("b",), np.array([0.0, 0.9]), times, fed, 1.0),
    )
    assert not mismatch(tables)
    assert divide(tables).promise(3.0) == 0.9


@given(
    st.builds(chancy, st.sampled_from([SHAPES["three"], SHAPES["shared"]]), st.integers(0, 2**32))
)
@settings(max_examples=12)
def test_what_is_called_exact_is_beaten_by_no_division(tables):
    frontier = divide(tables)
    assert frontier.exact
    assert (np.diff(frontier.budgets) > 0).all()
    assert (np.diff(frontier.promised) > 0).all()
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 1e-8


@given(st.builds(chancy, st.sampled_from([SHAPES["one"], SHAPES["chain"]]), st.integers(0, 2**32)))
def test_one_and_two_calls_are_divided_optimally_over_distributions(tables):
    frontier = divide(tables)
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 1e-8


@settings(max_examples=40)
@given(st.sampled_from([SHAPES["three"], SHAPES["tree"], SHAPES["shared"]]), st.integers(0, 2**32))
def test_three_calls_are_divided_nearly_optimally_over_distributions(feeds, seed):
    """No law: the pairwise exchange may miss a little. It must miss little."""
    tables = chancy(feeds, seed)
    frontier = divide(tables)
    for moments in itertools.product(*(range(len(table.times)) for table in tables)):
        spent = sum(t.times[m] for t, m in zip(tables, moments, strict=True))
        assert frontier.promise(spent) >= expected_quality(tables, moments) - 0.005


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_longer_chains_promise_at_least_the_best_of_random_divisions(seed):
    tables = chancy(SHAPES["four"], seed)
    frontier, rng = divide(tables), np.random.default_rng(seed)
    for budget in np.linspace(0.2, 1.0, 5) * total(tables):
        drawn = rng.dirichlet(np.ones(len(tables)), size=60) * budget
        best = max(expected_quality(tables, moments_within(tables, shares)) for shares in drawn)
        assert frontier.promise(budget) >= best - 0.005


# Laws at every budget


@given(programs)
def test_shares_fit_their_budget_and_keep_their_promise(tables):
    frontier = divide(tables)
    assert (np.diff(frontier.budgets) > 0).all()
    assert (frontier.shares >= 0).all()
    assert frontier.shares.sum(axis=1) == pytest.approx(frontier.budgets)
    for shares, promised in zip(frontier.shares, frontier.promised, strict=True):
        assert expected_quality(tables, moments_within(tables, shares)) == pytest.approx(promised)


@given(programs)
def test_more_time_never_promises_less(tables):
    frontier = divide(tables)
    budgets = np.linspace(0, 1.1 * total(tables), 60)
    promised = np.array([frontier.promise(budget) for budget in budgets])
    assert (np.diff(promised) >= 0).all()
    assert ((promised >= 0) & (promised <= 1)).all()


@given(programs)
def test_the_compiled_division_is_never_below_min_max_and_equal_shares(tables):
    frontier = divide(tables)
    budgets = np.linspace(0, 1.2 * total(tables), 80)
    promised = np.array([frontier.promise(budget) for budget in budgets])
    by_tables = divided(tables, frontier, budgets)
    assert (by_tables >= promised - 1e-8).all()
    for plain in (minimal, maximal, equal_shares):
        assert (promised >= plain(tables, budgets) - 1e-8).all(), plain.__name__


@given(programs, st.integers(0, 5), st.floats(1, 10))
def test_a_faster_module_never_promises_less(tables, place, factor):
    place %= len(tables)
    changed = [*tables]
    changed[place] = tables[place].faster(factor)
    before, after = divide(tables), divide(changed)
    exact = len(tables) <= 2
    for budget in np.linspace(0, total(tables), 12):
        assert after.promise(budget) >= before.promise(budget) - (1e-8 if exact else 0.005)


@settings(max_examples=30)
@given(programs, st.floats(0.1, 1.0))
def test_advice_and_prices_are_never_negative(tables, share):
    frontier = divide(tables)
    if not len(frontier.budgets):
        return
    budget = max(share * total(tables), float(frontier.budgets[0]))
    advice = advise("program", tables, frontier, budget)
    gains = [change.gain for change in advice.changes]
    assert gains == sorted(gains, reverse=True)
    assert min(gains) >= 0
    explanation = explain("program", tables, frontier, budget)
    assert all(price.gain >= 0 for price in explanation.prices)
    assert sum(price.share for price in explanation.prices) == pytest.approx(budget)
    assert explanation.less <= explanation.promised <= explanation.more


def test_flat_profiles_are_divided_the_same_way_every_time():
    tables = tuple(
        replace(t, chances=np.broadcast_to(t.chances[..., -1:, :], t.chances.shape))
        for t in chancy(SHAPES["three"], 3)
    )
    one, other = divide(tables), divide(tables)
    assert (np.diff(one.promised) > 0).all()
    assert one.shares.tobytes() == other.shares.tobytes()
    assert one.promised.tobytes() == other.promised.tobytes()


def test_a_program_that_never_has_a_result_has_no_division():
    never = np.zeros((3, 1))
    never[:] = 1.0
    table = Table("a", "a", (), np.array([0.0]), np.array([0.0, 1, 2]), never, 2.0)
    assert len(divide((table,)).budgets) == 0
    fed = Table("b", "b", ("a",), np.array([0.0, 1.0]), np.array([0.0, 1]), np.ones((1, 2, 2)), 1.0)
    fed.chances[...] = [1.0, 0.0]
    assert len(divide((table, fed)).budgets) == 0
    last = replace(fed, label="c", feeds=("b",), chances=np.array([fed.chances[0]] * 2))
    assert len(divide((table, fed, last)).budgets) == 0


@pytest.mark.parametrize("most", [division.ALL, 0])
def test_a_poor_program_of_three_calls_still_has_a_result(most, monkeypatch):
    """Each call rarely has a result, so that its mean is nearer to none than to any."""
    monkeypatch.setattr(division, "ALL", most)

    def rare(label, feeds):
        chances = np.zeros((*([2] * len(feeds)), 2, 2))
        chances[..., 0] = 1.0
        chances[(*([1] * len(feeds)), 1)] = [0.8, 0.2]
        return Table(label, label, feeds, np.array([0.0, 1.0]), np.array([0.0, 1.0]), chances, 1.0)

    tables = (rare("a", ()), rare("b", ("a",)), rare("c", ("b",)))
    assert divide(tables).promise(3.0) == pytest.approx(0.2**3)


@given(programs, st.data())
def test_chances_of_the_output_sum_to_one(tables, data):
    moments = [data.draw(st.integers(0, len(table.times) - 1)) for table in tables]
    chances = output_chances(tables, moments)
    assert chances.sum() == pytest.approx(1)
    assert chances @ tables[-1].levels == pytest.approx(expected_quality(tables, moments))


@given(programs, st.lists(st.floats(0, 5), min_size=4, max_size=4))
def test_the_moments_within_shares_are_the_last_that_they_reach(tables, shares):
    for table, share, moment in zip(
        tables, shares, moments_within(tables, shares[: len(tables)]), strict=False
    ):
        assert table.times[moment] <= share + 1e-9
        assert moment == len(table.times) - 1 or table.times[moment + 1] > share


# Other objectives

OBJECTIVES = (
    EXPECTED,
    at_least(0.5),
    quantile(0.5),
    cvar(0.3),
    expected(lambda quality, seconds: 2.0 * quality - 0.2 * seconds - 1.0),
)


def weighed(tables, objective):
    """(Seconds, value) of every division there is."""
    return [
        (
            float(sum(t.times[m] for t, m in zip(tables, moments, strict=True))),
            division.value_of(tables, moments, objective),
        )
        for moments in itertools.product(*(range(len(table.times)) for table in tables))
    ]


@pytest.mark.parametrize("objective", OBJECTIVES, ids=repr)
@given(
    st.builds(chancy, st.sampled_from([SHAPES["chain"], SHAPES["shared"]]), st.integers(0, 2**32))
)
@settings(max_examples=8)
def test_for_every_objective_no_division_is_worth_more_and_none_no_more_than_nothing(
    objective, tables
):
    frontier, every = divide(tables, objective), weighed(tables, objective)
    none = np.eye(len(tables[-1].levels))[0]
    nothing = float(objective.value(none, tables[-1].levels, np.zeros(())))
    for budget in {seconds for seconds, _ in every}:
        best = max(value for seconds, value in every if seconds <= budget + 1e-12)
        if best > nothing + 1e-8:
            assert frontier.promise(budget) == pytest.approx(best, abs=1e-8)
        elif best < nothing + 1e-10:
            assert frontier.index(budget) == -1


# Where there are too many divisions to weigh all


@contextlib.contextmanager
def too_many():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(division, "ALL", 0)
        yield


@given(st.builds(chancy, st.just(SHAPES["chain"]), st.integers(0, 2**32)))
@settings(max_examples=15)
def test_a_pair_of_calls_exchanges_its_time_to_the_optimum(tables):
    with too_many():
        frontier = divide(tables)
    for seconds, value in weighed(tables, EXPECTED):
        assert frontier.promise(seconds) >= value - 0.005
    assert frontier.promise(total(tables)) == pytest.approx(divide(tables).promise(total(tables)))


@pytest.mark.parametrize("objective", [EXPECTED, OBJECTIVES[-1]], ids=repr)
@given(st.builds(chancy, st.sampled_from([*SHAPES.values()][1:]), st.integers(0, 2**32)))
@settings(max_examples=12)
def test_exchanged_divisions_are_nearly_the_best_and_keep_their_promise(objective, tables):
    best = divide(tables, objective)
    with too_many():
        frontier = divide(tables, objective)
    assert not frontier.exact
    assert (np.diff(frontier.budgets) > 0).all()
    assert (np.diff(frontier.promised) > 0).all()
    assert frontier.shares.sum(axis=1) == pytest.approx(frontier.budgets)
    for shares, promised in zip(frontier.shares, frontier.promised, strict=True):
        moments = moments_within(tables, shares)
        assert division.value_of(tables, moments, objective) == pytest.approx(promised)
    for budget, promised in zip(best.budgets, best.promised, strict=True):
        assert frontier.index(budget) >= 0
        assert promised - 0.005 <= frontier.promise(budget) <= promised + 1e-8
    if objective == EXPECTED:
        budgets = np.linspace(0, 1.2 * total(tables), 20)
        promised = np.array([frontier.promise(budget) for budget in budgets])
        for plain in (minimal, maximal, equal_shares):
            assert (promised >= plain(tables, budgets) - 1e-8).all(), plain.__name__


def test_what_has_a_result_at_once_is_divided_as_well():
    for seed in range(3):
        tables = tuple(
            replace(t, chances=np.concatenate([t.chances[..., 1:, :], t.chances[..., -1:, :]], -2))
            for t in chancy(SHAPES["three"], seed)
        )
        with too_many():
            frontier = divide(tables)
        assert frontier.budgets[0] == 0
        for seconds, value in weighed(tables, EXPECTED):
            assert frontier.promise(seconds) >= value - 0.005


@pytest.mark.parametrize("shared", [False, True])
def test_without_chance_it_says_when_it_is_exact(shared):
    rng = np.random.default_rng(5)
    with too_many():
        for _ in range(20):
            tables = random_program(rng, shared)
            frontier = divide(tables)
            assert frontier.exact
            assert (np.diff(frontier.budgets) > 0).all()
            assert not mismatch(tables)
            assert not divide(tables, OBJECTIVES[-1]).exact


def test_what_is_exchanged_is_hardly_ever_less_than_the_best():
    """No law: of the steps of the exact frontiers of many programs, how many are found."""
    found = []
    for seed in range(6):
        for name in ("three", "tree", "shared", "four"):
            tables = chancy(SHAPES[name], seed)
            best = divide(tables)
            with too_many():
                frontier = divide(tables)
            found += [
                frontier.promise(budget) >= promised - 1e-9
                for budget, promised in zip(best.budgets, best.promised, strict=True)
            ]
    assert np.mean(found) > 0.98


# Modules that can be set


def set_in(*ways):
    """A module that is set in one of several ways: (quality, seconds, chance of it) of each."""
    levels = np.unique([0.0, *(quality for quality, _, _ in ways)])
    settings_ = [
        Table(
            f"m@k={place}",
            f"m@k={place}",
            (),
            np.array([0.0, quality]),
            np.array([0.0, seconds]),
            np.array([[1.0, 0.0], [1.0 - chance, chance]]),
            seconds,
        )
        for place, (quality, seconds, chance) in enumerate(ways)
    ]
    chances = np.zeros((*[2] * len(ways), 1, len(levels)))
    for cell in np.ndindex(*chances.shape[:-2]):
        made = [t.levels[1] for t, there in zip(settings_, cell, strict=True) if there]
        chances[(*cell, 0, int(np.searchsorted(levels, max(made, default=0.0))))] = 1.0
    feeds = tuple(table.label for table in settings_)
    best = Table("best", "", feeds, levels, np.zeros(1), chances, 0.0, rule=Best(True))
    return (*settings_, best)


@pytest.mark.parametrize(
    ("ways", "steps"),
    [
        ([(0.4, 1.0), (0.9, 3.0)], [(1.0, 0.4), (3.0, 0.9)]),
        ([(0.9, 3.0), (0.4, 1.0), (0.5, 3.0)], [(1.0, 0.4), (3.0, 0.9)]),  # as long, and better
        ([(0.5, 3.0), (0.4, 1.0)], [(1.0, 0.4), (3.0, 0.5)]),
        ([(0.4, 1.0), (0.4, 2.0)], [(1.0, 0.4)]),  # as good, and earlier
        ([(0.4, 1.0), (0.2, 2.0)], [(1.0, 0.4)]),
    ],
)
def test_of_the_settings_of_a_module_the_best_for_each_budget_has_the_time(ways, steps):
    frontier = divide(set_in(*((*way, 1.0) for way in ways)))
    assert [*zip(frontier.budgets, frontier.promised, strict=True)] == steps
    assert ((frontier.shares > 0).sum(axis=1) == 1).all()
    assert frontier.exact


def test_the_settings_of_a_module_are_divided_exactly_if_each_is():
    with too_many():
        assert divide(set_in((0.4, 1.0, 1.0), (0.9, 3.0, 1.0))).exact
        assert not divide(set_in((0.4, 1.0, 1.0), (0.9, 3.0, 0.7))).exact


# Several results that share nothing


def together(parts, weights, deadlines):
    """One program of several, whose results count by their weights up to their deadlines."""
    tables = [
        replace(
            table,
            label=f"{place} {table.label}",
            feeds=tuple(f"{place} {fed}" for fed in table.feeds),
        )
        for place, part in enumerate(parts)
        for table in part
    ]
    feeds = tuple(f"{place} {part[-1].label}" for place, part in enumerate(parts))
    shares = np.array(weights) / sum(weights)
    qualities = sum(
        np.expand_dims(share * part[-1].levels, [a for a in range(len(parts)) if a != axis])
        for axis, (share, part) in enumerate(zip(shares, parts, strict=True))
    )
    levels, place = np.unique(qualities, return_inverse=True)
    chances = np.eye(len(levels))[place.reshape(qualities.shape)][..., None, :]
    rule = Several(tuple(weights), tuple(deadlines))
    return (*tables, Table("all", "", feeds, levels, np.zeros(1), chances, 0.0, rule=rule))


halves = st.builds(chancy, st.sampled_from([SHAPES["one"], SHAPES["chain"]]), st.integers(0, 2**32))


@given(
    st.lists(halves, min_size=2, max_size=3),
    st.lists(st.sampled_from([0.5, 1.0, 3.0]), min_size=3, max_size=3),
    st.lists(st.sampled_from([0.8, 1.6, 2.4, np.inf]), min_size=3, max_size=3),
)
@settings(max_examples=15)
def test_independent_results_are_each_ready_by_their_deadline_and_worth_the_most_together(
    parts, weights, deadlines
):
    weights, deadlines = weights[: len(parts)], deadlines[: len(parts)]
    tables = together(parts, weights, deadlines)
    frontier = divide(tables)
    assert frontier.exact
    assert frontier.shares.sum(axis=1) == pytest.approx(frontier.budgets)
    for shares, promised in zip(frontier.shares, frontier.promised, strict=True):
        assert expected_quality(tables, moments_within(tables, shares)) == pytest.approx(promised)
    best = {0.0: 0.0}
    for place in np.argsort(deadlines, kind="stable"):
        ways = [(0.0, 0.0), *weighed(parts[place], EXPECTED)]
        share = weights[place] / sum(weights)
        more: dict[float, float] = {}
        for (before, value), (seconds, quality) in itertools.product(best.items(), ways):
            if seconds == 0 or before + seconds <= deadlines[place]:
                ends = round(before + seconds, 9)
                more[ends] = max(more.get(ends, 0.0), value + share * quality)
        best = more
    reached = 0.0
    for seconds in sorted(best):
        reached = max(reached, best[seconds])
        assert frontier.promise(seconds + 1e-9) == pytest.approx(reached, abs=1e-7)


def test_a_result_that_is_ready_at_its_deadline_is_in_time():
    sure = Table(
        "a", "a", (), np.array([0.0, 1.0]), np.array([0.0, 0.5]), np.eye(2), 0.5
    )  # a result for sure, after half a second
    both = together([(sure,), (sure,)], [1.0, 1.0], [0.5, 1.0])
    assert divide(both).promise(1.0) == 1.0
    late = together([(sure,), (sure,)], [1.0, 1.0], [0.5, 0.9])
    assert divide(late).promise(9.0) == 0.5


def test_independent_results_are_exact_if_each_is():
    three = chancy(SHAPES["three"], 1)
    sure = random_program(np.random.default_rng(0), shared=False)
    with too_many():
        assert not divide(together([three, sure], [1.0, 1.0], [np.inf, np.inf])).exact
        assert not divide(together([sure, three], [1.0, 1.0], [np.inf, np.inf])).exact
        assert divide(together([sure, sure], [1.0, 1.0], [np.inf, np.inf])).exact


def sharing(tables, outputs):
    """A program of several results, which may come of the same calls."""
    qualities = sum(
        np.expand_dims(
            tables[call].levels / len(outputs), [a for a in range(len(outputs)) if a != axis]
        )
        for axis, call in enumerate(outputs)
    )
    levels, place = np.unique(qualities, return_inverse=True)
    chances = np.eye(len(levels))[place.reshape(qualities.shape)][..., None, :]
    feeds = tuple(tables[call].label for call in outputs)
    rule = Several((1.0,) * len(outputs), (np.inf,) * len(outputs))
    return (*tables, Table("all", "", feeds, levels, np.zeros(1), chances, 0.0, rule=rule))


@pytest.mark.parametrize(
    ("feeds", "outputs"),
    [(([], [0], [0]), (1, 2)), (([], [0]), (0, 1)), (([], [], [1], [1]), (0, 2, 3))],
)
def test_results_that_share_a_call_are_divided_together(feeds, outputs):
    for seed in range(4):
        tables = sharing(chancy(feeds, seed), outputs)
        assert division.independent(tables) is None
        frontier, every = divide(tables), weighed(tables, EXPECTED)
        for budget in {seconds for seconds, _ in every}:
            best = max(value for seconds, value in every if seconds <= budget + 1e-12)
            assert frontier.promise(budget) == pytest.approx(best, abs=1e-8)


def test_a_result_that_is_told_twice_is_one():
    (one,) = chancy(SHAPES["one"], 3)
    levels = one.levels
    chances = np.eye(len(levels))[:, None, :]
    rule = Several((1.0, 2.0), (np.inf, np.inf))
    twice = Table("all", "", ("call 0",), levels, np.zeros(1), chances, 0.0, rule=rule)
    assert divide((one, twice)).promise(9.0) == pytest.approx(divide((one,)).promise(9.0))


def test_the_calls_of_independent_results_are_told_apart():
    tables = together([chancy(SHAPES["chain"], 1), chancy(SHAPES["one"], 2)], [1, 1], [9.0, 9.0])
    assert division.independent(tables) == ((0, 1), (2,))
    arms = [replace(t, path=(Arm("fork", place, 0),)) for place, t in enumerate(tables[1:3])]
    assert division.independent((tables[0], *arms, tables[3])) is None
    assert division.independent(tables[:2]) is None


@pytest.mark.parametrize("objective", [OBJECTIVES[2], OBJECTIVES[4]], ids=repr)
def test_what_is_no_mean_of_quality_is_not_the_sum_of_independent_results(objective):
    one = chancy(SHAPES["one"], 1)
    with pytest.raises(AnytimeError, match="not the sum"):
        divide(together([one, one], [1.0, 1.0], [np.inf, np.inf]), objective)
