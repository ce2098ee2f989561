"""Arguments of commands: whole numbers, places, and what users mean by FILE.py:NAME."""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

import experiments
from anytime import AnytimeError, commands
from anytime.__main__ import main
from anytime.command_line import destination, folder, natural, resolve, target
from anytime.library import read_profile


@given(some.integers(0, 10**17))
def test_a_whole_number_is_read_back(number):
    assert natural(str(number)) == number


@pytest.mark.parametrize("text", ["-1", "1.5", "", "1e3", "٣", " 1", "9" * 30])
def test_what_is_no_whole_number_is_refused_by_name(text):
    with pytest.raises(argparse.ArgumentTypeError, match="whole number"):
        natural(text)


def test_a_file_is_no_folder_and_a_folder_no_file(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    assert folder(str(tmp_path)) == tmp_path
    assert folder(str(tmp_path / "new")) == tmp_path / "new"
    assert target(str(file)) == file
    with pytest.raises(argparse.ArgumentTypeError, match="is a file"):
        folder(str(file))
    with pytest.raises(argparse.ArgumentTypeError, match="is a folder"):
        target(str(tmp_path))


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_done(tmp_path, monkeypatch):
    device = Path(os.devnull)
    monkeypatch.setattr(os, "access", lambda place, mode: False)  # root may write everywhere
    for kind, place in ((destination, tmp_path / "a" / "b"), (target, tmp_path / "file")):
        with pytest.raises(argparse.ArgumentTypeError, match=f"{tmp_path} cannot be written"):
            kind(str(place))
    assert folder(str(tmp_path)) == tmp_path
    assert target(str(device)) == device
    assert not list(tmp_path.iterdir())


def test_a_file_is_imported_once_so_that_its_classes_are_the_same(tmp_path):
    file = tmp_path / "imported_once.py"
    file.write_text("class Scene: pass\ndef scene(): return Scene()\n")
    assert isinstance(resolve(f"{file}:scene")(), resolve(f"{file}:Scene"))


@pytest.mark.parametrize(
    ("source", "reason"),
    [("import no_such_thing", "ModuleNotFoundError"), ("x = (", "SyntaxError"), ("1 / 0", "Zero")],
)
def test_a_file_that_cannot_be_imported_says_why_and_leaves_nothing(tmp_path, source, reason):
    file = tmp_path / "cannot_be_imported.py"
    file.write_text(source)
    with pytest.raises(AnytimeError, match=reason):
        resolve(f"{file}:x")
    assert file.stem not in sys.modules


def test_problems_that_are_none_are_refused_in_one_line(tmp_path, capsys):
    file = tmp_path / "no_problems.py"
    file.write_text(
        "import anytime\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def see(image):\n"
        "    yield 0.5\n"
        "def five(rng): return 5\n"
    )
    kept = tmp_path / "profiles"
    asked = ["profile", f"{file}:see", "--problems", f"{file}:five", "--library", str(kept)]
    assert main(asked) == 2
    told = capsys.readouterr().err
    assert "no_problems.py:five" in told
    assert "(rng)" in told
    assert not kept.exists()


@pytest.mark.parametrize("command", ["profile", "calibrate"])
@pytest.mark.parametrize("problems", ["5", "(1 / 0 for _ in range(2))", "[].of_theirs"])
def test_problems_that_fail_are_told_in_one_line(tmp_path, capsys, command, problems):
    file = tmp_path / f"failing_{command}_{len(problems)}.py"
    file.write_text(
        "import anytime\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def see(image):\n"
        "    yield 0.5\n"
        f"def problems(rng): return {problems}\n"
    )
    library = ["--library", str(tmp_path / "profiles")]
    assert main([command, f"{file}:see", "--problems", f"{file}:problems", *library]) == 2
    told = capsys.readouterr().err
    assert f"{file}:problems: " in told
    assert len(told.splitlines()) == 1


def test_a_folder_with_nothing_to_draw_is_refused(tmp_path, capsys):
    pictures = tmp_path / "pictures"
    assert main(["plot", str(tmp_path), "-o", str(pictures)]) == 2
    assert "nothing to draw" in capsys.readouterr().err
    assert not pictures.exists()


def test_every_profile_of_a_folder_is_drawn(tmp_path, capsys):
    file = tmp_path / "drawn_module.py"
    file.write_text(
        "import anytime\n"
        "from types import SimpleNamespace\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def guess(image):\n"
        "    yield 0.5\n"
        "    yield 1.0\n"
        "def problems(rng): return [SimpleNamespace(image=index) for index in range(3)]\n"
    )
    kept = tmp_path / "profiles"
    asked = ["profile", f"{file}:guess", "--problems", f"{file}:problems", "--library", str(kept)]
    assert main(asked) == 0
    capsys.readouterr()
    assert main(["plot", str(kept), "-o", str(tmp_path)]) == 0
    assert capsys.readouterr().out.split() == [str(tmp_path / "guess.profile.png")]
    other = tmp_path / "other"
    shutil.copytree(kept, other)
    assert main(["plot", str(kept), str(other), "-o", str(tmp_path)]) == 2
    assert "would both be drawn as" in capsys.readouterr().err


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_a_terminal_that_knows_few_characters_gets_what_it_knows(encoding):
    shipped = Path(experiments.__file__).parent / "data" / "profiles"
    ran = subprocess.run(
        [sys.executable, "-m", "anytime", "library", "--library", str(shipped)],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
        check=True,
    )
    assert "find_path" in ran.stdout.decode(encoding)


def test_a_bug_of_ours_is_one_line_with_the_path_of_a_report(monkeypatch, capsys):
    def broken(options):
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(commands, "doctor", broken)
    assert main(["doctor"]) == 70
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1
    report = Path(told.split("report: ")[1].strip())
    assert "ZeroDivisionError: of ours" in report.read_text()
    report.unlink()
    monkeypatch.setattr(tempfile, "tempdir", f"{os.devnull}/no")
    assert main(["doctor"]) == 70
    told = capsys.readouterr().err
    assert "ZeroDivisionError: of ours" in told
    assert told.endswith("report: above\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
def test_a_full_device_is_one_line():
    command = f"{sys.executable} -m anytime doctor --seconds 0.01 > /dev/full"
    for unbuffered in ("", "1"):
        environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        told = subprocess.run(
            ["sh", "-c", command], env=environment, capture_output=True, text=True, check=False
        )
        assert told.returncode == 2
        assert told.stderr.strip() == "anytime: standard output: No space left on device"


def test_modules_that_raise_after_a_result_or_that_nothing_reaches_are_told(tmp_path, capsys):
    file = tmp_path / "faulty.py"
    file.write_text(
        "import anytime, compiler\n"
        "from types import SimpleNamespace\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def guess(image):\n"
        "    yield 0.1\n"
        "    raise ValueError('a bug in every run')\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def slow(image):\n"
        "    while not anytime.expired():\n"
        "        pass\n"
        "@anytime.module(quality=lambda x: x)\n"
        "def use(found):\n"
        "    yield 1.0\n"
        "@compiler.program\n"
        "def both(image):\n"
        "    return use(slow(image))\n"
        "def problems(rng): return [SimpleNamespace(image=index) for index in range(3)]\n"
    )
    asked = ["--problems", f"{file}:problems", "--seconds", "0.01", "--library"]
    kept = tmp_path / "profiles"
    assert main(["profile", f"{file}:guess", *asked, str(kept)]) == 0
    told = capsys.readouterr().err
    assert "guess failed on 3 of 3 problems, with what it had by then as its result" in told
    assert "ValueError: a bug in every run" in told
    main(["profile", f"{file}:both", *asked, str(tmp_path / "others")])
    assert "use was not run: nothing reached it on 3 problems" in capsys.readouterr().err


def test_a_profile_that_is_a_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "see.profile")
    with pytest.raises(AnytimeError, match="a pipe or a device, no file"):
        read_profile(tmp_path / "see.profile")


def test_the_page_of_a_folder_is_refused(capsys):
    assert main(["replay", "."]) == 2
    assert "is a folder; give the log of a mission" in capsys.readouterr().err
