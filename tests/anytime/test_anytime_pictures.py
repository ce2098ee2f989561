"""Pictures: sparklines, numbers in few characters, charts that are well-formed."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime.pictures import BARS, duration, elided, figure, line_chart, number, sparkline, thinned

finite = st.floats(-1e6, 1e6)


@given(st.lists(st.one_of(st.floats(0, 1), st.just(math.nan)), max_size=100))
def test_a_sparkline_has_one_mark_for_each_value(values):
    marks = sparkline(values)
    assert len(marks) == len(values)
    for value, mark in zip(values, marks, strict=True):
        assert (mark == " ") == math.isnan(value)


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_higher_value_never_has_a_lower_bar(one, other):
    low, high = sparkline(sorted((one, other)))
    assert BARS.index(low) <= BARS.index(high)


def test_a_sparkline_spans_all_bars():
    assert sparkline([i / 7.0 for i in range(8)]) == BARS
    assert sparkline([-5, 5, 0.5], 0.5, 0.5) == BARS[0] + BARS[-1] + BARS[0]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.814, ".81"),
        (1.0, "1.00"),
        (0.0, ".00"),
        (12.34, "12.3"),
        (-0.5, "-.50"),
        (0.999, "1.00"),
    ],
)
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_no_number_is_a_dash():
    assert number(math.nan) == "—"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0 ms"),
        (0.0001451, "145 µs"),
        (0.0796, "79.6 ms"),
        (1.2, "1.20 s"),
        (-0.5, "-500.0 ms"),
        (0.9999999, "1.00 s"),
        (0.0009999, "1.0 ms"),
        (math.inf, "∞"),
        (-math.inf, "-∞"),
        (math.nan, "—"),
    ],
)
def test_durations_are_short(seconds, text):
    assert duration(seconds) == text


@given(st.floats(allow_nan=True))
def test_no_number_and_no_duration_takes_a_line(value):
    assert len(number(value)) <= 10
    assert len(duration(value)) <= 12


# XML 1.0 has no control characters, surrogates or non-characters.
texts = st.text(st.characters(exclude_categories=("Cc", "Cs", "Cn")), max_size=30)


@st.composite
def charts(draw):
    """Lines of any length, also empty ones, with holes, flat ones and odd labels."""
    labels = draw(st.lists(texts, unique=True, max_size=4))
    series, bands = {}, {}
    for label in labels:
        xs = sorted(draw(st.lists(finite, max_size=8)))
        values = st.one_of(finite, st.just(math.nan))
        ys = draw(st.lists(values, min_size=len(xs), max_size=len(xs)))
        series[label] = (xs, ys)
        if draw(st.booleans()):
            bands[label] = (xs, [0.2] * len(xs), [0.8] * len(xs))
    return series, bands, draw(texts)


@given(charts())
def test_every_chart_is_well_formed(chart):
    series, bands, title = chart
    svg = line_chart(series, bands=bands, x_label="<x>", y_label='"y" & z', title=title)
    tree = ElementTree.fromstring(svg)
    space = "{http://www.w3.org/2000/svg}"
    lines = tree.findall(f"{space}path[@class='line']")
    assert len(lines) == len(series)
    assert len(tree.findall(f"{space}polygon")) == len(bands)
    assert "nan" not in "".join(line.get("d", "") for line in lines)
    width, height = float(tree.get("width", 0)), float(tree.get("height", 0))
    for line in lines:
        for point in re.findall("[^ML]+", line.get("d", "")):
            x, y = map(float, point.split(","))
            assert 0 <= x <= width
            assert 0 <= y <= height


def test_a_line_has_a_gap_where_nothing_is_known():
    levels = [0.0, 1.0, math.nan, 1.0, 0.0]
    svg = line_chart({"a": ([0, 1, 2, 3, 4], levels)}, x_label="x", y_label="y")
    drawn = re.search('class="line" d="([^"]*)"', svg)
    assert drawn is not None
    assert drawn[1].count("M") == drawn[1].count("L") == 2


def test_levels_without_a_range_are_drawn():
    assert "class" in line_chart(
        {"a": ([0, 1], [2, 2])}, x_label="x", y_label="y", y_range=(2.0, 2.0)
    )


@given(st.lists(finite), st.integers(1, 40))
def test_what_is_thinned_is_in_order_and_no_more_than_was_asked_for(values, most):
    kept = thinned(range(len(values)), most)
    assert len(kept) == min(len(values), most)
    assert list(kept) == sorted(set(kept))


def test_lines_are_told_apart_without_colour_too():
    svg = line_chart(
        {"one": ([0, 1], [0, 1]), "other": ([0, 1], [1, 0])},
        x_label="x",
        y_label="y",
        dashed=("other",),
    )
    assert svg.count("stroke-dasharray") == 2  # the line and its place in the legend
    assert ">one<" in svg
    assert ">other<" in svg


def test_ticks_are_round_numbers():
    svg = line_chart({"a": ([0, 0.2205], [0, 1])}, x_label="x", y_label="y")
    for tick in ("0.05", "0.1", "0.15", "0.2", "0.4", "0.6", "0.8"):
        assert f">{tick}</text>" in svg


def test_a_figure_carries_its_text_for_those_who_cannot_see_it():
    html = figure("<svg></svg>", "a < b")
    assert html.startswith("<div><svg>")
    assert "a &lt; b" in html


def test_a_long_name_loses_its_middle():
    assert elided("look", 10) == "look"
    assert elided("localize@particles=200", 12) == "local…es=200"
