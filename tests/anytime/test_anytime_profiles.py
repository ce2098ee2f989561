"""Laws of conditional performance profiles."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime import AnytimeError, Machine, Profile
from anytime.recordings import Recording

qualities = st.floats(0, 1)


def recording(problem="a", values=(), times=None, inputs=None, features=None, end=None):
    times = np.arange(1.0, len(values) + 1) if times is None else np.array(times, dtype=float)
    last = float(times[-1]) if len(times) else 0.0
    return Recording(
        problem,
        "see",
        inputs or {},
        features or {},
        times,
        times,
        np.array(values, dtype=float),
        np.full(len(values), np.nan),
        (max(last, end or 0.0), last),
        True,
    )


@st.composite
def runs(draw, inputs=(), features=()):
    """One run: qualities may rise and fall, and there may be none at all."""
    values = draw(st.lists(qualities, max_size=6))
    gaps = draw(st.lists(st.integers(0, 20), min_size=len(values), max_size=len(values)))
    return recording(
        draw(st.sampled_from("abcd")),
        values,
        np.cumsum(gaps) / 8,
        {name: draw(qualities) for name in inputs},
        {name: draw(st.floats(-5, 5)) for name in features},
        draw(st.floats(0, 20)),
    )


@st.composite
def profiles(draw, inputs=(), features=()):
    recordings = draw(st.lists(runs(inputs, features), min_size=1, max_size=12))
    return Profile("see", tuple(inputs), tuple(recordings))


moments = st.lists(st.floats(-1, 20), min_size=1, max_size=20).map(lambda times: np.sort(times))


@given(profiles(), moments)
def test_expected_quality_never_falls_with_time_and_stays_in_the_unit_interval(profile, times):
    means = profile.mean(times)
    assert (np.diff(means) >= 0).all()
    assert ((means >= 0) & (means <= 1)).all()


def test_perfect_runs_expect_one_and_not_a_bit_more():
    perfect = tuple(recording(f"{number}", [1.0], [1.0 + number]) for number in range(20))
    assert Profile("see", (), perfect).mean([30.0], as_measured=True).tolist() == [1.0]


@given(profiles(), moments)
def test_the_envelope_is_the_best_so_far_of_what_was_measured(profile, times):
    measured = profile.mean(times, as_measured=True)
    assert measured == pytest.approx([profile.at(t).mean for t in times])
    assert (profile.mean(times) >= measured - 1e-12).all()
    every = np.unique(np.concatenate([[0.0], *(run.seconds for run in profile.recordings)]))
    for time, mean in zip(times, profile.mean(times), strict=True):
        before = every[every <= time]
        best = profile.mean(before, as_measured=True).max() if len(before) else 0.0
        assert mean == pytest.approx(best)


def test_the_envelope_holds_between_the_moments_that_are_kept():
    """More changes than moments: a short peak between two of them still counts afterwards."""
    rng = np.random.default_rng(0)
    spiky = [recording(str(i), rng.random(60), np.sort(rng.random(60))) for i in range(40)]
    profile = Profile("see", (), tuple(spiky))
    assert len(profile.times) <= 512
    assert (np.diff(profile.mean(np.linspace(0, 1, 5001))) >= 0).all()


@given(profiles(("boxes",), ("density",)), qualities, st.floats(-10, 10))
def test_weights_sum_to_one_under_every_condition(profile, boxes, density):
    conditions = ({}, {"boxes": boxes}, {"density": density}, {"boxes": boxes, "density": density})
    for condition in conditions:
        weights = profile.given(**condition).weights
        assert weights.sum() == pytest.approx(1)
        assert (weights >= 0).all()


@given(profiles(), st.floats(-1, 20))
def test_no_result_counts_nothing_and_is_told_apart_from_a_poor_one(profile, seconds):
    distribution = profile.at(seconds)
    reached = distribution.at_least(0.0)
    assert reached + distribution.no_result == pytest.approx(1)
    assert distribution.mean <= reached + 1e-12


@given(profiles(), st.floats(0, 20), qualities, qualities)
def test_quantiles_and_chances_are_monotone(profile, seconds, one, other):
    low, high = sorted((one, other))
    distribution = profile.at(seconds)
    below, above = distribution.quantile(low), distribution.quantile(high)
    assert np.isnan(below) or below <= above
    assert distribution.at_least(high) <= distribution.at_least(low) + 1e-12
    assert profile.quantile(high, seconds) == pytest.approx(above, nan_ok=True)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_quantile_is_of_a_share(share):
    with pytest.raises(AnytimeError, match=r"in \[0, 1\]"):
        Profile("see", (), (recording(values=[0.5]),)).quantile(share, 1.0)


def test_the_time_to_a_quality_is_that_of_half_of_the_runs_unless_another_share_is_given():
    halves = [recording(str(i), [0.8], [2.0 * i]) for i in range(1, 5)]
    profile = Profile("see", (), tuple(halves))
    assert [profile.time_to(0.8), profile.time_to(0.8, 0.75)] == [4.0, 6.0]
    assert profile.time_to(0.0, 0.25) == 2.0, "no result is no result of quality 0"


@pytest.mark.parametrize("count", [511, 512, 513, 900])
def test_at_most_512_moments_are_kept_the_first_and_the_last_among_them(count):
    changes = np.arange(1.0, count)  # and 0, which is always one
    profile = Profile("see", (), (recording("a", changes / count, changes),))
    assert len(profile.times) == min(count, 512)
    assert profile.times[[0, -1]].tolist() == [0.0, count - 1.0]


@given(profiles(), qualities, st.floats(0.01, 1))
def test_the_time_to_a_quality_is_when_that_share_of_runs_has_had_it(profile, quality, share):
    seconds = profile.time_to(quality, share)
    had = [
        weight
        for row, (weight, run) in enumerate(zip(profile.weights, profile.recordings, strict=True))
        if (profile.quality_at(run.seconds[run.seconds <= seconds])[row] >= quality).any()
    ]
    if np.isinf(seconds):
        assert sum(had) < share + 1e-9
    else:
        assert sum(had) >= share - 1e-9


@given(profiles(), qualities, st.floats(0, 5))
def test_progress_is_a_distribution_of_what_came_later(profile, quality, seconds):
    later = profile.progress(quality, seconds)
    assert later.weights.sum() == pytest.approx(1)
    seen = {float(value) for values in profile.qualities for value in values}
    assert {float(value) for value in later.values if not np.isnan(value)} <= seen


def test_progress_tells_where_runs_with_this_quality_went():
    steady = [recording(f"p{i}", [0.2, 0.4, 0.6, 0.8]) for i in range(20)]
    later = Profile("see", (), tuple(steady)).progress(0.4, 2.0)
    assert later.mean == pytest.approx(0.8)


def test_progress_asks_the_nearest_tenth_of_all_moments_and_eight_at_least():
    for problems, asked in ((1, 8), (20, 8), (50, 20)):
        steady = [recording(f"p{i}", np.linspace(0.1, 0.4, 4) + i / 100) for i in range(problems)]
        later = Profile("see", (), tuple(steady)).progress(0.2, 1.0)
        assert len(later.values) == min(asked, 4 * problems)


def test_in_progress_a_run_speaks_once_however_often_it_registered():
    often, once = recording("a", [0.5] * 6 + [0.1]), recording("b", [0.7])
    assert Profile("see", (), (often, once)).progress(0.5, 99.0).mean == pytest.approx(0.4)


def test_progress_of_a_profile_that_never_has_a_result_is_no_result():
    assert Profile("see", (), (recording(),)).progress(0.5, 1.0).no_result == 1


def test_progress_leaves_out_runs_that_the_condition_leaves_out():
    runs_ = [recording("a", [0.5, level], inputs={"boxes": level}) for level in (0.0, 0.5, 1.0)]
    later = Profile("see", ("boxes",), tuple(runs_)).given(boxes=1.0).progress(0.5, 1.0)
    assert later.mean == 1.0


@given(profiles(), moments)
def test_the_band_contains_the_mean(profile, times):
    low, high = profile.band(times, resamples=50)
    for mean in (profile.mean(times), profile.mean(times, as_measured=True)):
        assert (mean <= high + 1e-9).all()
    assert (low <= profile.mean(times, as_measured=True) + 1e-9).all()
    assert ((low >= 0) & (high <= 1)).all()


@given(profiles(), st.floats(0, 20), st.floats(1.1, 4))
@settings(max_examples=20)
def test_where_the_pace_is_unsure_the_band_holds_all_that_it_may_be(profile, time, unsure):
    low, high = replace(profile, unsure=unsure).band([time], resamples=50)
    bands = [profile.band([time * pace], resamples=50) for pace in (1 / unsure, 1.0, unsure)]
    assert low[0] == min(low[0] for low, _ in bands)
    assert high[0] == max(high[0] for _, high in bands)


def test_the_band_is_narrow_where_the_problems_agree_and_wide_where_they_do_not():
    apart = [recording(f"p{i}", [0.5, i / 10], features={"x": float(i)}) for i in range(11)]
    for profile in (Profile("see", (), tuple(apart)), Profile("see", (), tuple(apart)).given(x=3)):
        low, high = profile.band([1.0, 2.0])
        assert high - low == pytest.approx([0.0, (high - low)[1]], abs=1e-6)
        assert high[1] - low[1] > 0.1


def test_a_band_of_more_confidence_is_wider_and_covers_so_often():
    rng = np.random.default_rng(2)
    widths, covered = [], []
    for _ in range(60):
        few = [recording(f"p{i}", [float(rng.random())]) for i in range(30)]
        bands = [
            Profile("see", (), tuple(few)).band([1.0], share, resamples=100)
            for share in (0.5, 0.95)
        ]
        widths.append([float(high[0] - low[0]) for low, high in bands])
        covered.append([low[0] <= 0.5 <= high[0] for low, high in bands])
    assert all(narrow < wide for narrow, wide in widths)
    shares = np.mean(covered, axis=0)
    assert 0.3 < shares[0] < 0.7
    assert shares[1] > 0.85


def test_the_band_narrows_with_problems():
    rng = np.random.default_rng(1)
    runs_ = [recording(f"p{i}", [rng.random()]) for i in range(400)]
    few, many = (Profile("see", (), tuple(runs_[:count])) for count in (10, 400))
    width = [high[0] - low[0] for low, high in (few.band([2.0]), many.band([2.0]))]
    assert width[1] < width[0] / 3


# Conditions


@given(at=qualities)
def test_given_interpolates_between_the_strata_of_each_problem(at):
    """Two problems, one easy and one hard, each run at its own two input qualities."""
    runs_ = (
        recording("easy", [0.8], inputs={"boxes": 0.0}),
        recording("easy", [1.0], inputs={"boxes": 1.0}),
        recording("hard", [0.0], inputs={"boxes": 0.0}),
        recording("hard", [0.4], inputs={"boxes": 1.0}),
    )
    profile = Profile("find", ("boxes",), runs_).given(boxes=at)
    assert profile.mean(5.0)[0] == pytest.approx(0.4 + 0.3 * at)
    assert profile.effective_problems == pytest.approx(2)


def test_on_a_machine_that_is_known_nothing_is_unsure_any_more():
    here = Profile("see", (), (recording(values=[0.5]),), unsure=3.0)
    assert here.on(Machine("m").with_rate("see", 1.0)).unsure == 1.0


def test_given_does_not_reach_beyond_what_a_problem_was_run_on():
    runs_ = (
        recording("a", [0.3], inputs={"boxes": 0.4}),
        recording("a", [0.7], inputs={"boxes": 0.6}),
    )
    profile = Profile("find", ("boxes",), runs_)
    assert profile.given(boxes=0.0).mean(9)[0] == pytest.approx(0.3)
    assert profile.given(boxes=1.0).mean(9)[0] == pytest.approx(0.7)


def test_good_inputs_do_not_borrow_from_easy_problems():
    """Only the easy problem had a good input; the hard one still speaks at every level."""
    runs_ = (
        recording("easy", [0.9], inputs={"boxes": 1.0}),
        recording("hard", [0.1], inputs={"boxes": 0.2}),
    )
    assert Profile("find", ("boxes",), runs_).given(boxes=1.0).mean(9)[0] == pytest.approx(0.5)


def test_several_inputs_are_met_exactly_where_they_were_run():
    runs_ = tuple(
        recording("a", [0.1 + 0.5 * a + 0.3 * b], inputs={"left": a, "right": b})
        for a in (0.0, 1.0)
        for b in (0.0, 1.0)
    )
    profile = Profile("merge", ("left", "right"), runs_)
    assert profile.given(left=1.0, right=0.0).mean(9)[0] == pytest.approx(0.6, abs=1e-6)
    assert 0.1 <= profile.given(left=0.5, right=0.5).mean(9)[0] <= 0.9


def test_features_tell_easy_inputs_from_hard_ones():
    runs_ = tuple(
        recording(f"p{i}", [0.9 if i < 10 else 0.1], features={"density": i / 20})
        for i in range(20)
    )
    profile = Profile("see", (), runs_)
    assert profile.features == ("density",)
    easy, hard = profile.given(density=0.1), profile.given(density=0.9)
    assert easy.mean(9)[0] > 0.8
    assert hard.mean(9)[0] < 0.2
    assert easy.effective_problems < 20


def test_a_run_that_lacks_a_feature_hardly_counts_where_it_is_asked_for():
    runs_ = (recording("a", [0.9], features={"density": 0.5}), recording("b", [0.1]))
    assert Profile("see", (), runs_).given(density=0.5).mean(9)[0] == pytest.approx(0.9, abs=1e-3)


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan"), float("inf")])
def test_the_quality_of_an_input_lies_in_the_unit_interval(value):
    profile = Profile("find", ("boxes",), (recording(values=[0.5], inputs={"boxes": 1.0}),))
    with pytest.raises(AnytimeError, match=r"\[0, 1\]"):
        profile.given(boxes=value)


def test_a_feature_asked_for_is_a_finite_number():
    profile = Profile("see", (), (recording(values=[0.5], features={"density": 1.0}),))
    with pytest.raises(AnytimeError, match="finite"):
        profile.given(density=float("nan"))


def test_an_unknown_condition_names_the_known_ones():
    profile = Profile("find", ("boxes",), (recording(values=[0.5], inputs={"boxes": 1.0}),))
    with pytest.raises(AnytimeError, match="not conditioned on 'see'; known: boxes"):
        profile.given(see=0.8)


def test_a_profile_of_no_runs_is_refused():
    with pytest.raises(AnytimeError, match="at least one problem"):
        Profile("see", (), ())


@given(
    st.sampled_from([("boxes",), ("boxes", "way")]).flatmap(lambda names: profiles(names)),
    st.integers(0, 2**32),
)
@settings(max_examples=15)
def test_many_conditions_at_once_weigh_as_each_alone(profile, seed):
    asked = np.random.default_rng(seed).random((130, len(profile.inputs)))
    together = profile.weights_given(profile.inputs, asked)
    for place in (0, 63, 64, 65, 127, 128, 129):
        alone = profile.given(**dict(zip(profile.inputs, asked[place], strict=True))).weights
        assert together[place] == pytest.approx(alone)
    assert together.sum(axis=1) == pytest.approx(1)


def test_a_feature_counts_by_a_gaussian_as_wide_as_scott_says():
    """Two problems at 0 and 1: the standard deviation is 1/2, the width 1/2 · 2^(-1/5)."""
    ends = [recording("a", [1.0], features={"x": 0.0}), recording("b", [0.0], features={"x": 1.0})]
    profile = Profile("see", (), tuple(ends))
    mean = profile.given(x=0.0).mean(9)[0]
    assert (1 - mean) / mean == pytest.approx(np.exp(-0.5 * (2 * 2**0.2) ** 2))
    assert profile.given(x=0.5).mean(9)[0] == pytest.approx(0.5)


# Costs


def test_quality_of_a_cost_is_the_cheapest_known_for_the_problem_by_it():
    runs_ = (recording("a", [10.0, 5.0]), recording("b", [8.0]), recording("c", [0.0]))
    for least in (1.0, 0.0):  # of what costs nothing the reference may be nothing, too
        profile = Profile("find", (), runs_, {"a": 5.0, "b": 4.0, "c": least})
        assert [q.tolist() for q in profile.qualities] == [[0.5, 1.0], [0.5], [1.0]]


def test_the_unit_of_a_cost_makes_no_difference():
    for unit in (1e-6, 1.0, 1e6):
        profile = Profile("find", (), (recording("a", [4 * unit, 2 * unit]),), {"a": 1 * unit})
        assert profile.qualities[0] == pytest.approx([0.25, 0.5])


def test_a_beaten_reference_gives_no_quality_above_one():
    profile = Profile("find", (), (recording("a", [2.0]),), {"a": 4.0})
    assert profile.qualities[0].tolist() == [1.0]


# Texts and pictures


@given(profiles(("boxes",), ("density",)), qualities)
def test_texts_fit_a_line_and_pictures_are_drawn_for_every_profile(profile, boxes):
    for each in (profile, profile.given(boxes=boxes), profile.given(density=1.0)):
        assert len(repr(each)) <= 100
        assert "\n" not in repr(each)
    assert "<svg" in profile._repr_html_()


@pytest.mark.parametrize(("end", "told"), [(0.2, True), (0.84, True), (0.86, False), (0.9, False)])
def test_the_text_says_when_results_get_worse_and_by_how_much_it_matters(end, told):
    text = repr(Profile("see", (), (recording("a", [0.9, end]),)))
    assert "q .9" in text
    assert (f"then {end:g}".replace("0.", ".") in text) == told


def test_the_text_says_how_long_the_runs_were_and_when_there_was_a_first_result():
    long, short = recording("a", [0.4, 0.9], [1.0, 2.0], end=8.0), recording("a", [], end=3.0)
    text = repr(Profile("see", (), (short, long)))
    assert text.startswith("see  ▁▁")
    assert "in 8.00 s, first 1.00 s" in text
    assert "1 problems, 2 runs" in text
    assert "q .40 in 500.0 ms" in repr(Profile("see", (), (recording("a", [0.4], [0.5]),)))
    assert len(repr(Profile("x" * 200, (), (long,)))) == 100


def test_a_picture_begins_with_no_time_at_all():
    picture = Profile("see", (), (recording("a", [0.5], [25.0]),)).picture()
    times = re.findall(r'text-anchor="middle">([^<]*)</text>', picture)
    assert times[:6] == ["0", "5", "10", "15", "20", "25"]
    left = re.findall(r'<text x="([^"]*)"[^>]*text-anchor="middle">0<', picture)
    assert re.findall(r'class="line" d="M([^,]*),', picture) == left


def test_the_picture_of_one_input_shows_what_is_to_expect_of_poor_usual_and_good_ones():
    strata = [recording("a", [b], inputs={"boxes": b}) for b in np.linspace(0, 1, 11)]
    profile = Profile("find", ("boxes",), tuple(strata))
    picture = profile.picture()
    assert all(f"boxes = {level}" in picture for level in (0.1, 0.5, 0.9))
    assert "boxes = " not in profile.given(boxes=0.5).picture()
    thirds = [recording("a", [b], inputs={"boxes": b, "way": 1.0}) for b in (1 / 3, 2 / 3)]
    assert "boxes = 0.37<" in Profile("find", ("boxes",), tuple(thirds)).picture()
    assert "boxes = " not in Profile("find", ("boxes", "way"), tuple(thirds)).picture()


def test_the_text_says_how_many_problems_a_condition_leaves():
    runs_ = tuple(recording(f"p{i}", [0.5], features={"density": float(i)}) for i in range(9))
    text = repr(Profile("see", (), runs_).given(density=0.0))
    assert "given density=0 | 9 problems as 3, 9 runs" in text


@given(profiles(), st.floats(0.1, 10))
def test_a_machine_twice_as_fast_gives_the_same_quality_in_half_the_time(profile, rate):
    slow, fast = (
        profile.on(Machine(name).with_rate("see", each))
        for name, each in (("slow", 2 * rate), ("fast", rate))
    )
    work = np.unique(np.concatenate([[0.0], *(run.work for run in profile.recordings)]))
    middles = (work[:-1] + work[1:]) / 2 if len(work) > 1 else work
    assert slow.mean(2 * rate * middles) == pytest.approx(fast.mean(rate * middles))
    assert replace(slow, machine="x", recordings=fast.recordings) == replace(fast, machine="x")


def run_of(value, **inputs):
    return Recording(
        "p", "m", inputs, {}, np.array([0.1]), np.array([1.0]), np.array([value]),
        np.array([np.nan]), (0.2, 1.0), True,
    )  # fmt: skip


def test_of_several_inputs_too_runs_on_equal_inputs_count_alike():
    runs = (run_of(0.1, a=1.0, b=1.0), run_of(0.9, a=1.0, b=1.0), run_of(0.3, a=0.5, b=0.5))
    for order in itertools.permutations(runs):
        profile = Profile("m", ("a", "b"), order)
        assert profile.given(a=1.0, b=1.0).mean(0.1)[0] == pytest.approx(0.5)
        assert profile.given(a=0.5, b=0.5).mean(0.1)[0] == pytest.approx(0.3)
        assert profile.given(a=0.75, b=0.75).mean(0.1)[0] == pytest.approx(0.4)


@given(profiles(), st.floats(0.01, 1), st.floats(0.01, 1))
def test_the_time_to_a_quality_is_the_first_at_which_a_share_of_the_runs_has_had_it(
    profile, quality, share
):
    found = profile.time_to(quality, share)
    moments = np.unique(np.concatenate([run.seconds for run in profile.recordings]))
    reached = np.maximum.accumulate(
        np.nan_to_num(profile.quality_at(moments), nan=-1.0) >= quality, axis=1
    )
    hits = moments[profile.weights @ reached >= share - 1e-9]
    assert found == (hits[0] if len(hits) else np.inf)


def test_questions_about_no_time_or_no_share_of_the_runs_are_refused():
    profile = Profile("m", (), (run_of(0.5),))
    for ask in (profile.at, profile.mean, lambda time: profile.quantile(0.5, time)):
        with pytest.raises(AnytimeError, match="seconds holds NaN"):
            ask(float("nan"))
    for share in (0.0, -1.0, 5.0):
        with pytest.raises(AnytimeError, match=r"a share of .* of the runs; give one in"):
            profile.time_to(0.5, share)
