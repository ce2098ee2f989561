"""Comparisons with rivals: what a figure says, in whose favour, and how sure."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.benchmarks.figures import (
    UNBOUNDED,
    Benchmark,
    median_interval,
    ratio_interval,
    reasons,
)
from experiments.commands import BENCHMARKS as ALL
from experiments.commands import _nested
from experiments.reproduction.catalogue import BENCHMARKS, COMPARISONS
from experiments.reproduction.comparisons import Comparison
from experiments.reproduction.page import page
from experiments.reproduction.results import results
from experiments.reproduction.rivals import flat
from experiments.reproduction.samples import SAMPLES

READINGS = ("times", "share", "more", "margin", "gap")


def told(reading, value, low, high):
    comparison = Comparison("planner", "key", "ours", "theirs", reading)
    return comparison.told({"key": value, "key_low": low, "key_high": high})


@given(
    st.sampled_from(READINGS),
    st.lists(st.floats(0.01, 0.9), min_size=3, max_size=3, unique=True).map(sorted),
)
def test_an_interval_of_a_figure_becomes_one_of_how_many_times_as_good_ours_is(reading, ends):
    low, value, high = ends
    row = told(reading, value, low, high)
    assert row["low"] <= row["times"] <= row["high"]


def test_every_reading_says_how_many_times_as_good_ours_is():
    for reading, figure in (("times", 4.0), ("share", 0.25), ("more", 3.0), ("margin", 0.75)):
        assert told(reading, figure, figure, figure)["times"] == pytest.approx(4.0)
    assert told("gap", 0.75, 0.75, 0.75)["times"] == pytest.approx(0.25)


def test_ours_is_better_or_worse_only_if_the_whole_interval_is():
    assert told("times", 2.0, 1.1, None)["verdict"] == "better"
    assert told("times", 2.0, 0.9, 3.0)["verdict"] == "equal"
    assert told("times", 1.0, 1.0, 1.0)["verdict"] == "equal"
    assert told("times", 0.5, 0.4, 0.9)["verdict"] == "worse"
    assert told("share", 2.0, 1.5, 3.0)["verdict"] == "worse"
    assert told("share", 0.5, 0.4, None)["verdict"] == "equal"  # it may never get there


def test_what_was_not_measured_has_no_row():
    assert Comparison("planner", "key", "ours", "theirs").told({"key": None}) is None
    assert Comparison("planner", "key", "ours", "theirs").told({}) is None


def test_every_benchmark_is_compared_and_no_figure_twice():
    assert set(BENCHMARKS) == set(ALL)
    assert set(SAMPLES) <= set(BENCHMARKS)
    keys = [(each.benchmark, each.key) for each in COMPARISONS]
    assert len(set(keys)) == len(keys)


_WORDS = st.lists(st.sampled_from("abc"), min_size=3, max_size=3).map(".".join)


@given(st.dictionaries(_WORDS, st.one_of(st.none(), st.floats(0, 1))))
def test_what_a_benchmark_prints_has_its_figures_by_their_names(figures):
    assert dict(flat(_nested(figures))) == figures


@given(st.integers(6, 40), st.integers(0, 2**32))
def test_bounds_of_a_median_are_repetitions_on_both_sides_of_it(count, seed):
    values = np.random.default_rng(seed).normal(size=count)
    found = median_interval("a", values)
    assert found["a_low"] <= found["a"] <= found["a_high"]
    assert {found["a_low"], found["a_high"]} <= set(values)


@pytest.mark.parametrize("count", [6, 9, 11, 30])
def test_bounds_of_a_median_cover_it_nineteen_times_in_twenty(count):
    draws = np.random.default_rng(0).exponential(size=(2000, count))
    found = [median_interval("a", row) for row in draws]
    covered = [each["a_low"] <= np.log(2.0) <= each["a_high"] for each in found]
    assert np.mean(covered) >= 0.94  # 0.95 less what 2,000 draws may miss it by


def test_a_ratio_of_means_has_bounds_unless_the_second_may_be_nothing():
    rng = np.random.default_rng(0)
    found = ratio_interval("a", rng.normal(3.0, 0.1, 50), rng.normal(1.5, 0.1, 50))
    assert found["a_low"] < found["a"] < found["a_high"]
    assert found["a"] == pytest.approx(2.0, abs=0.1)
    rare = ratio_interval("a", np.ones(10), np.arange(10) == 0)
    assert rare["a_high"] is None
    assert rare["a_low"] > 1.0


def test_whatever_is_none_has_its_reason():
    figures = ratio_interval("a", [1.0, 1.0], [0.0, 1.0])
    assert figures["a_high"] is None
    found = Benchmark("any", {**figures, "b": None}, {"not_measured": {"b": "no time"}})
    assert reasons(found) == {"a_high": UNBOUNDED, "b": "no time"}


def told_of(rows):
    return {
        "figures": {"claims": {"total": 0, "held": 0}},
        "settings": {
            "quick": False, "cut": [], "claims": {},
            "comparisons": rows, "pictures": [], "animations": [], "sweeps": [],
        },
        "machine": {"python": "3", "system": "any"},
        "seed": 7,
    }  # fmt: skip


@pytest.fixture
def told_rows():
    return [
        Comparison("query", "vs_cpp.nao", "ours", "C++").told(
            {"vs_cpp.nao": 1.5, "vs_cpp.nao_low": 1.2, "vs_cpp.nao_high": None}
        ),
        Comparison("deadline", "free.vs_floor", "ours", "a loop").told(
            {"free.vs_floor": 0.5, "free.vs_floor_low": 0.4, "free.vs_floor_high": 0.6}
        ),
    ]


def test_page_and_document_name_what_measures_a_row_again_and_say_the_verdict_in_words(
    told_rows, tmp_path
):
    found = told_of(told_rows)
    for text in (page(found, tmp_path), results(found)):
        for word in ("anytime bench query --seed 7", "▲ better", "▼ worse", "1.2 to —", "C++"):
            assert word in text
        assert "better in 1, worse in 1" in text


@pytest.mark.browser
@pytest.mark.parametrize("width", [380, 1400])
def test_the_table_fits_its_window(browser, told_rows, tmp_path, width):
    file = tmp_path / "page.html"
    file.write_text(page(told_of(told_rows), tmp_path), encoding="utf-8")
    browser.errors.clear()
    browser.open(file.as_uri(), width)
    assert browser.run("document.scrollingElement.scrollWidth <= innerWidth")
    right = "e => e.getBoundingClientRect().right"  # what may scroll is seen at once, too
    signs = f"[...document.querySelectorAll('td.better, td.worse')].map({right})"
    assert max(browser.run(signs)) <= width
    assert browser.errors == []
