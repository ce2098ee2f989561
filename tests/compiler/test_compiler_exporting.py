"""Compiled programs without Python: as JSON and as a C header, with the same answers."""

from __future__ import annotations

import bisect
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from anytime.__main__ import main
from compiler.exporting import Exported, exported, write_json
from compiler.headers import header, identifier, identifiers
from compiler.policies import Policy
from experiments.benchmarks.compiler_constructs import KINDS
from experiments.benchmarks.compiler_export import (
    AS_CPP,
    STRICT,
    budgets_for,
    constructed,
    from_divisions,
    look_up,
    mismatches,
    random_frontier,
)

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")
needs_gpp = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")


def programs(seed, count):
    rng = np.random.default_rng(seed)
    made = [from_divisions(random_frontier(rng), f"f{index}") for index in range(count)]
    return made + [constructed(KINDS[n % len(KINDS)], rng, f"c{n}") for n in range(count)]


def thinned(compiled, rng):
    budgets = budgets_for(exported(compiled), rng)
    return np.unique(np.concatenate([budgets[:3], rng.choice(budgets, 150), budgets[-3:]]))


def one_row(share, text="x"):
    """Half a second divided: `share` seconds for one call, the rest for the other."""
    us = int(1e6 * share)
    return Exported(
        name="x",
        text=text,
        machine="m",
        calls=("a", "b"),
        from_ms=np.array([500]),
        share_us=np.array([[us, -us]]),
        rest=np.array([[False, True]]),
        promised=np.array([0.5]),
    )


def read(tables, budget_ms):
    """What a reader of the JSON does; the page on exporting shows it."""
    row = bisect.bisect_right(tables["from_ms"], budget_ms) - 1
    if row < 0:
        return [0] * (len(tables["calls"]) + 1)
    both = zip(tables["share_us"][row], tables["rest"][row], strict=True)
    return [*(us + rest * 1000 * budget_ms for us, rest in both), tables["promised"][row]]


# Answers


def test_every_answer_of_the_tables_is_that_of_allocate(tmp_path):
    rng = np.random.default_rng(0)
    for compiled in programs(1, 6):
        write_json(exported(compiled), tmp_path / "x.json")
        tables = json.loads((tmp_path / "x.json").read_text())
        budgets = thinned(compiled, rng)
        answers = np.array([read(tables, ms) for ms in budgets.tolist()], dtype=float)
        assert mismatches(compiled, budgets, answers) == 0


def test_a_mismatch_would_be_found():
    rng = np.random.default_rng(0)
    (compiled, *_) = programs(1, 1)
    budgets = thinned(compiled, rng)
    wrong = np.zeros((len(budgets), len(compiled.labels) + 1))
    assert mismatches(compiled, budgets, wrong) > len(budgets) / 10


def test_rows_that_no_whole_millisecond_takes_are_left_out():
    tables = exported(programs(3, 1)[0])
    assert (np.diff(tables.from_ms) > 0).all()
    assert (np.diff(tables.promised) >= 0).all()


@needs_gcc
@pytest.mark.parametrize("flags", [STRICT, AS_CPP], ids=["c99", "c++"])
def test_every_answer_of_the_header_is_that_of_allocate(flags):
    rng = np.random.default_rng(4)
    made = programs(5, 6)
    asked = [thinned(compiled, rng) for compiled in made]
    found = look_up([exported(compiled) for compiled in made], asked, flags)
    for compiled, budgets, answers in zip(made, asked, found, strict=True):
        assert mismatches(compiled, budgets, answers) == 0


# Names


AWKWARD = [
    "größe",
    "switch",
    "int",
    "2x",
    "a b",
    "a_b",
    "a__b",
    "_a",
    "A",
    "a",
    "",
    "*/ x",
    "%s??/",
]


@needs_gcc
@pytest.mark.parametrize("flags", [STRICT, AS_CPP], ids=["c99", "c++"])
def test_programs_of_any_name_live_in_one_file(flags):
    rng = np.random.default_rng(6)
    made = []
    for place, name in enumerate(AWKWARD):
        labels = [*AWKWARD[place:], *AWKWARD[:place]][:4]
        frontier = random_frontier(rng)
        while frontier.shares.shape[1] != len(labels):
            frontier = random_frontier(rng)
        tables = exported(from_divisions(frontier, "plain"))
        made.append(replace(tables, name=name, text=f"{name}({labels})", calls=tuple(labels)))
    asked = [np.arange(3, dtype=np.int32)] * len(made)
    assert len(look_up(made, asked, (*flags, "-Wconversion", "-Wshadow"))) == len(AWKWARD)


@given(names=st.lists(st.text(max_size=8), min_size=2, unique=True, max_size=8))
def test_different_names_stay_different_and_are_plain(names):
    made = [identifier(name) for name in names]
    assert len(set(made)) == len(made)
    for each in made:
        assert each.isascii()
        assert each.isidentifier()
        assert "__" not in each
        assert not each.startswith("_")


@given(labels=st.lists(st.sampled_from(["a", "a_2", "a_2_2", "A", "ä"]), max_size=12))
def test_each_call_has_a_field_of_its_own(labels):
    assert len(set(identifiers(labels))) == len(labels)


def test_a_name_that_is_plain_stays():
    assert identifiers(["see", "find_path", "Find2"]) == ["see", "find_path", "Find2"]


@given(text=st.text(max_size=60))
def test_a_comment_ends_where_it_should(text):
    written = header(one_row(0.0, text=text))
    assert written.count("*/") == written.count("/*")
    assert "??" not in written
    comment = written[: written.index("*/")]
    assert "\\" not in comment


# Limits


def test_budgets_beyond_32_bits_are_refused():
    (compiled, *_) = programs(1, 1)
    long = replace(compiled.frontier, budgets=compiled.frontier.budgets + 3e6)
    with pytest.raises(AnytimeError, match="milliseconds in 32 bits"):
        exported(replace(compiled, frontier=long))


def test_a_program_that_decides_while_it_runs_is_refused():
    (compiled, *_) = programs(1, 1)
    deciding = replace(compiled, policy=Policy((), {}, {}))
    with pytest.raises(AnytimeError, match="decides while it runs"):
        exported(deciding)


@needs_gcc
@pytest.mark.parametrize("kind", KINDS)
def test_every_construct_is_exported(kind):
    rng = np.random.default_rng(9)
    made = [constructed(kind, rng, f"{kind} {number}") for number in range(4)]
    asked = [thinned(compiled, rng) for compiled in made]
    found = look_up([exported(compiled) for compiled in made], asked)
    for compiled, budgets, answers in zip(made, asked, found, strict=True):
        assert mismatches(compiled, budgets, answers) == 0


@needs_gcc
def test_a_single_division_and_days_of_budget_compile():
    for share in (0.1, 3600.0):
        asked = np.array([499, 500, 2**31 - 1], dtype=np.int32)
        (answers,) = look_up([one_row(share)], [asked])
        rest = 1000.0 * np.array([500, 2**31 - 1]) - 1e6 * share
        assert answers[0].tolist() == [0, 0, 0]
        assert answers[1:, 1].tolist() == rest.tolist()


# The command


@pytest.fixture
def saved(tmp_path):
    compiled = programs(8, 2)[-1]
    compiled.save(tmp_path / "x.schedule")
    return compiled, tmp_path / "x.schedule"


def call(capsys, *arguments):
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as left:
        code = int(left.code or 0)
    return code, *capsys.readouterr()


def test_the_command_writes_both(saved, tmp_path, capsys):
    compiled, file = saved
    c, tables = tmp_path / "x.h", tmp_path / "x.json"
    code, out, err = call(capsys, "export", file, "--c", c, "--json", tables)
    assert (code, err) == (0, "")
    assert "written to" in out
    assert c.read_text() == header(exported(compiled))
    assert json.loads(tables.read_text())["calls"] == list(compiled.labels)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "nothing to write; add --c FILE.h"),
        (["--c", "."], "is a folder"),
        (["--json"], "expected one argument"),
    ],
)
def test_what_cannot_be_written_is_one_line(saved, capsys, arguments, says):
    code, out, err = call(capsys, "export", saved[1], *arguments)
    assert code == 2
    assert out == ""
    assert len(err.splitlines()) == 1
    assert says in err


def test_a_file_that_is_none_is_one_line(tmp_path, capsys):
    code, _, err = call(capsys, "export", tmp_path / "no.schedule", "--c", tmp_path / "x.h")
    assert (code, len(err.splitlines())) == (2, 1)
    assert not (tmp_path / "x.h").exists()
