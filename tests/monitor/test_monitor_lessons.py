"""What a mission taught is kept, is found again, and is never wrong for long."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from monitor.robots import lessons
from monitor.robots.lessons import KEPT, NO_MEMORY, Memory, user_memory


@dataclass(frozen=True)
class Lesson:
    length: float
    rows: tuple[tuple[float, ...], ...]


LESSON = Lesson(0.1, ((1.0, 2.0 / 3.0), (3.0,)))


@pytest.fixture
def memory(tmp_path):
    return Memory(tmp_path / "lessons")


def refuse():
    raise AssertionError("it was to be remembered")


def test_a_lesson_is_learnt_once_and_comes_back_as_it_was(memory):
    assert memory.recall("way", b"a floor", Lesson, lambda: LESSON) == LESSON
    assert memory.recall("way", b"a floor", Lesson, refuse) == LESSON


def test_another_floor_or_another_question_is_another_lesson(memory):
    memory.recall("way", b"a floor", Lesson, lambda: LESSON)
    for what, floor in (("way", b"another floor"), ("spread", b"a floor")):
        with pytest.raises(AssertionError):
            memory.recall(what, floor, Lesson, refuse)


def test_other_code_learns_anew(memory, monkeypatch):
    memory.recall("way", b"a floor", Lesson, lambda: LESSON)
    monkeypatch.setattr(lessons, "code_digest", lambda: b"changed")
    with pytest.raises(AssertionError):
        memory.recall("way", b"a floor", Lesson, refuse)


@pytest.mark.parametrize("content", [b"", b"{}", b'{"schema": "anytime.lesson/1"}'])
def test_a_file_that_was_cut_is_learnt_anew_and_replaced(memory, content):
    memory.recall("way", b"a floor", Lesson, lambda: LESSON)
    (file,) = memory.folder.glob("*.json")
    file.write_bytes(content)
    assert memory.recall("way", b"a floor", Lesson, lambda: LESSON) == LESSON
    assert memory.recall("way", b"a floor", Lesson, refuse) == LESSON


def test_a_folder_that_cannot_be_written_is_no_obstacle(tmp_path):
    (tmp_path / "file").write_text("in the way")
    inside = Memory(tmp_path / "file" / "lessons")
    assert inside.recall("way", b"a floor", Lesson, lambda: LESSON) == LESSON


def test_old_lessons_make_room(memory):
    for floor in range(KEPT + 3):
        memory.recall("way", str(floor).encode(), Lesson, lambda: LESSON)
    assert len(list(memory.folder.glob("*.json"))) == KEPT


def test_without_a_folder_everything_is_learnt_anew():
    assert NO_MEMORY.recall("way", b"a floor", Lesson, lambda: LESSON) is LESSON


def test_a_user_without_a_home_has_no_memory(monkeypatch):
    for name in ("ANYTIME_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    assert user_memory() is NO_MEMORY
    monkeypatch.setenv("ANYTIME_CACHE", "here")
    assert user_memory() == Memory(Path("here") / "lessons")
