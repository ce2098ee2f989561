"""Append-only files: what was acknowledged is there, what was torn is not."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from anytime.files import Stored
from anytime.journals import opened


class About(Stored):
    seed: int


class Note(Stored):
    text: str


def written(path, texts, seed=0):
    with opened(path, About(seed=seed), Note) as journal:
        for text in texts:
            journal.append(Note(text=text))
        return [note.text for note in journal.kept]


@settings(max_examples=25)
@given(st.lists(st.text(max_size=5), max_size=4), st.lists(st.text(max_size=5), max_size=4))
def test_what_is_appended_is_kept_in_its_order(tmp_path_factory, first, then):
    path = tmp_path_factory.mktemp("journal") / "file"
    assert written(path, first) == []
    assert written(path, then) == first
    assert written(path, []) == first + then


@settings(max_examples=25)
@given(st.integers(0, 60))
def test_wherever_it_was_torn_the_whole_lines_are_kept(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("journal") / "file"
    written(path, ["one", "two", "three"])
    content = path.read_bytes()
    path.write_bytes(content[: max(0, len(content) - cut)])
    kept = max(0, path.read_bytes().count(b"\n") - 1)
    assert written(path, ["more"]) == ["one", "two", "three"][:kept]
    assert written(path, []) == [*["one", "two", "three"][:kept], "more"]


def test_a_journal_of_something_else_is_refused(tmp_path):
    path = tmp_path / "file"
    written(path, ["one"])
    with pytest.raises(AnytimeError, match=r"holds runs with seed 0, asked is 1; start anew"):
        written(path, ["two"], seed=1)
    path.write_text('{"seed": 0}\n{"words": 3}\n')
    with pytest.raises(AnytimeError, match=r"file:2: not one of our runs"):
        written(path, [])


@pytest.mark.parametrize("content", ['{"precious": [1, 2]}', "words without a line's end"])
def test_a_file_of_somebody_else_is_refused_and_left_as_it_is(tmp_path, content):
    path = tmp_path / "file"
    path.write_text(content)
    with pytest.raises(AnytimeError, match="not one of our files"):
        written(path, ["one"])
    assert path.read_text() == content


def test_what_was_kept_makes_way_for_the_first_new_record_and_not_before(tmp_path):
    path = tmp_path / "file"
    written(path, ["one", "two"])
    with opened(path, About(seed=1), Note, anew=True) as journal:
        assert journal.kept == ()
    assert written(path, []) == ["one", "two"]
    with opened(path, About(seed=1), Note, anew=True) as journal:
        journal.append(Note(text="three"))
        journal.append(Note(text="four"))
    assert written(path, [], seed=1) == ["three", "four"]


def test_who_starts_anew_waits_for_another_that_writes(tmp_path):
    path = tmp_path / "file"
    with (
        opened(path, About(seed=0), Note) as journal,
        pytest.raises(AnytimeError, match="another process writes to it"),
        opened(path, About(seed=0), Note, anew=True),
    ):
        pass
    assert journal.kept == ()


def test_a_file_of_somebody_else_makes_way_for_nothing(tmp_path):
    path = tmp_path / "file"
    path.write_text('{"precious": [1, 2]}\n')
    with (
        pytest.raises(AnytimeError, match="not one of our runs"),
        opened(path, About(seed=0), Note, anew=True),
    ):
        pass
    assert path.read_text() == '{"precious": [1, 2]}\n'
