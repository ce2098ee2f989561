"""Files of the library: whole or refused, in one line."""

from __future__ import annotations

import copy
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import anytime
from anytime import AnytimeError, Machine, Profile, ProfileLibrary
from anytime.files import checksum, write_atomically
from anytime.library import read_machine, read_profile, write_machine
from anytime.machines import Rate, processor
from anytime.recordings import Recording


def small(module="find", references=None, inputs=("boxes",)) -> Profile:
    rng = np.random.default_rng(5)
    runs = tuple(
        Recording(
            f"p{index}",
            module,
            {name: float(rng.random()) for name in inputs},
            {"density": float(rng.random())},
            np.cumsum(rng.random(3)),
            np.cumsum(rng.integers(1, 9, 3)).astype(float),
            rng.random(3),
            rng.random(3) if index else np.full(3, np.nan),
            (5.0, 40.0),
            bool(index % 2),
            3 + 10 * index,
            3 + 20 * index,
        )
        for index in range(3)
    )
    return Profile(module, tuple(inputs), runs, references or {}, "m")


@pytest.fixture
def written(tmp_path) -> Path:
    ProfileLibrary(profiles={"find": small()}).save(tmp_path)
    return tmp_path / "find.profile"


def rewritten(path: Path, content: dict) -> Path:
    """The content with a checksum that fits it, as a careful forger would write it."""
    content = {key: value for key, value in content.items() if key != "checksum"}
    content["checksum"] = checksum(content)
    path.write_text(json.dumps(content))
    return path


def read_or_refused(path: Path) -> Profile | None:
    """None where reading refuses the file, as it must, in one line."""
    try:
        return read_profile(path)
    except AnytimeError as error:
        if "\n" in str(error):
            raise AssertionError(f"more than one line: {error}") from error
        return None


def refused(path: Path) -> str:
    with pytest.raises(AnytimeError) as caught:
        read_profile(path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


# Round trips


def test_what_is_read_and_saved_again_is_the_same_byte_for_byte(tmp_path):
    machine = Machine("m", {"find": Rate(0.5, (), 1.2, 7), "see": Rate(0.0, (0.1, 0.2), 2.0, 4)})
    costs = small("path", {f"p{i}": 0.25 for i in range(3)})
    library = ProfileLibrary(profiles={"find": small(), "path": costs}, machine=machine)
    library.save(tmp_path / "a")
    ProfileLibrary(tmp_path / "a").save(tmp_path / "b")
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["find.profile", "machine.json", "path.profile"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert ProfileLibrary(tmp_path / "a").machine == machine


def test_what_is_read_says_the_same_as_what_was_saved(written):
    before, after = small(), read_profile(written)
    times = np.linspace(0, 6, 40)
    for condition in ({}, {"boxes": 0.3}, {"density": 0.3}):
        assert after.given(**condition).mean(times) == pytest.approx(
            before.given(**condition).mean(times), abs=1e-8
        )
    assert repr(after) == repr(before)


def test_a_row_of_the_file_is_a_run(written):
    assert sum('"problem"' in line for line in written.read_text().splitlines()) == 3


def test_one_library_updates_another():
    one = ProfileLibrary(profiles={"find": small()}, machine=Machine("a").with_rate("find", 1.0))
    other = ProfileLibrary(
        profiles={"see": small("see")}, machine=Machine("b").with_rate("see", 2.0)
    )
    both = one.updated(other)
    assert list(both) == ["find", "see"]
    assert set(both.machine.rates) == {"find", "see"}
    assert list(one) == ["find"]
    with pytest.raises(KeyError, match="measured: find, see"):
        both["walk"]
    assert max(map(len, repr(both).splitlines())) <= 100
    assert both._repr_html_().count("<svg") == 2


# Writing


def test_writing_that_fails_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "a.profile"
    write_atomically(path, b"old")

    def full(*_):
        raise OSError(28, "No space left on device")

    for step in ("fsync", "rename"):
        with monkeypatch.context() as patched:
            patched.setattr(os, "fsync" if step == "fsync" else "replace", full)
            patched.setattr(Path, "replace", full) if step == "rename" else None
            with pytest.raises(OSError, match="No space"):
                write_atomically(path, b"new")
        assert path.read_bytes() == b"old"
        assert [p.name for p in tmp_path.iterdir()] == ["a.profile"]


WRITER = """
import sys
from pathlib import Path
from anytime.library import write_machine
from anytime.machines import Machine
path, who = Path(sys.argv[1]), sys.argv[2]
for done in range(60):
    write_machine(path, Machine(who).with_rate(who, 1.0 + done))
"""


def test_of_several_writers_of_one_file_one_wins_whole(tmp_path):
    path, names = tmp_path / "machine.json", ("one", "other", "third")
    writers = [subprocess.Popen([sys.executable, "-c", WRITER, str(path), name]) for name in names]
    seen = set()
    while any(writer.poll() is None for writer in writers):
        if path.exists():
            machine = read_machine(path)
            assert list(machine.rates) == [machine.name], "a mixture of two writers"
            seen.add(machine.name)
    assert all(writer.returncode == 0 for writer in writers)
    assert seen <= set(names)
    assert read_machine(path).rates[read_machine(path).name].per_work == 60.0
    assert [file.name for file in tmp_path.iterdir()] == ["machine.json"]


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a folder that nobody can write to")
def test_where_nothing_can_be_written_the_command_says_so_in_one_line(tmp_path, capsys):
    from anytime.__main__ import main

    ProfileLibrary(profiles={"find": small()}).save(tmp_path)
    nowhere = "/proc/self/task"
    assert main(["plot", str(tmp_path / "find.profile"), "-o", nowhere]) == 2
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1
    assert nowhere in told


def test_a_number_that_is_not_finite_is_never_written(tmp_path):
    ProfileLibrary(profiles={"find": small()}).save(tmp_path)
    before = (tmp_path / "find.profile").read_bytes()
    bad = small()
    bad.recordings[0].raw[1] = np.nan
    with pytest.raises(AnytimeError, match="must be finite"):
        ProfileLibrary(profiles={"find": bad}).save(tmp_path)
    assert (tmp_path / "find.profile").read_bytes() == before


@pytest.mark.parametrize(
    "name", ["../x", "/etc/x", "a/b", "x\0", "", ".hidden", "a..b", "x" * 300, "naïve", "a\nb"]
)
def test_a_name_that_is_no_plain_file_name_is_refused(tmp_path, name):
    root = tmp_path / "library"
    with pytest.raises(AnytimeError, match="cannot name a file"):
        ProfileLibrary(profiles={name: small(name)}).save(root)
    assert not list(tmp_path.rglob("*x*"))


# Reading what is broken


def test_every_prefix_is_refused(written, tmp_path):
    content = written.read_bytes()
    cut = tmp_path / "cut.profile"
    for length in range(len(content) - 1):
        cut.write_bytes(content[:length])
        refused(cut)


def test_flipped_bits_are_refused_or_change_nothing(written, tmp_path):
    content = written.read_bytes()
    whole = read_profile(written)
    rng = np.random.default_rng(0)
    for _ in range(300):
        flipped = bytearray(content)
        flipped[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        path = tmp_path / "flipped.profile"
        path.write_bytes(flipped)
        profile = read_or_refused(path)  # not refused: a bit of white space
        assert profile is None or repr(profile.recordings) == repr(whole.recordings)


def edited(change):
    def make(content):
        content = copy.deepcopy(content)
        change(content)
        return content

    return make


def run0(**values):
    return edited(lambda content: content["runs"][0].update(values))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (edited(lambda c: c.update(schema="anytime.profile/0")), "needed is 'anytime.profile/1'"),
        (edited(lambda c: c.update(schema="anytime.profile/999")), "has schema"),
        (edited(lambda c: c.pop("schema")), "no 'schema'"),
        (edited(lambda c: c.update(extra=1)), "unknown field"),
        (edited(lambda c: c.pop("runs")), "missing required field"),
        (edited(lambda c: c.update(runs=[])), "at least one problem"),
        (edited(lambda c: c.update(module="../find")), "cannot name a file"),
        (edited(lambda c: c.update(module=3)), "Expected `str`"),
        (run0(seconds=[3.0, 2.0, 1.0]), "seconds must not decrease"),
        (run0(seconds=[-3.0, 2.0, 4.0]), "must not decrease or be negative"),
        (run0(work=[3.0, 2.0, 1.0]), "work must not decrease"),
        (run0(seconds=[1.0]), "differ in length"),
        (run0(estimates=[0.1]), "differ in length"),
        (run0(raw=[0.1, 0.2, 1.5]), r"outside \[0, 1\]"),
        (run0(raw=[0.1, -0.2, 0.5]), r"outside \[0, 1\]"),
        (run0(inputs={"boxes": 1.5}), r"outside \[0, 1\]"),
        (run0(inputs={}), "has inputs"),
        (run0(end=[-1.0, 2.0]), "negative"),
        (run0(results=2), "has 3 results, and says 2 in 3 steps are all"),
        (run0(steps=-1), "says 3 in -1 steps"),
        (run0(raw=["a", "b", "c"]), "Expected `float`"),
        (run0(raw=[None, 0.2, 0.3]), "Expected `float`"),
        (run0(complete="yes"), "Expected `bool`"),
        (edited(lambda c: c.update(references={"p0": 1.0})), "no reference cost"),
        (edited(lambda c: c.update(references={f"p{i}": -1.0 for i in range(3)})), "no reference"),
    ],
)
def test_a_file_that_lies_is_refused_with_the_reason(written, tmp_path, change, says):
    content = json.loads(written.read_text())
    import re

    assert re.search(says, refused(rewritten(tmp_path / "lies.profile", change(content))))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not JSON"),
        ("[]", "not one of our files"),
        ("3", "not one of our files"),
        ("null", "not one of our files"),
        ('{"a": NaN}', "NaN is not a number"),
        ('{"a": -Infinity}', "-Infinity is not a number"),
        ('{"a": 1e999}', "must be finite"),
        ('{"a": 1, "a": 2}', "a key occurs twice"),
        ('{"a": ' + "9" * 100000 + "}", "digits"),
        ("[" * 100000, "nested too deeply"),
        ("[" * 100000 + "]" * 100000, "nested too deeply"),
        *(("[" * depth + "]" * depth, "nested too deeply") for depth in (40, 300, 900, 950, 980)),
    ],
)
def test_text_that_is_no_file_of_ours_is_refused(tmp_path, text, says):
    path = tmp_path / "odd.profile"
    path.write_text(text)
    assert says in refused(path)


def test_bytes_folders_and_absent_files_are_refused(tmp_path):
    (tmp_path / "bytes.profile").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "folder.profile").mkdir()
    assert "UTF-8" in refused(tmp_path / "bytes.profile")
    assert "directory" in refused(tmp_path / "folder.profile")
    assert "no such file" in refused(tmp_path / "absent.profile")
    with pytest.raises(AnytimeError, match="no such folder"):
        ProfileLibrary(tmp_path / "absent")


def test_a_file_under_the_name_of_another_module_is_refused(written):
    written.rename(written.with_name("see.profile"))
    with pytest.raises(AnytimeError, match=r"holds the profile of 'find'; name it find\.profile"):
        ProfileLibrary(written.parent)


odd = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(max_size=5),
    st.lists(st.floats(-2, 2), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(-2, 2), max_size=2),
)


def mutated(draw, value):
    """A tree of JSON with one place of it replaced, removed or doubled."""
    if isinstance(value, dict) and value and draw(st.integers(0, 3)):
        key = draw(st.sampled_from(sorted(value)))
        return {**value, key: mutated(draw, value[key])}
    if isinstance(value, list) and value and draw(st.integers(0, 3)):
        index = draw(st.integers(0, len(value) - 1))
        action = draw(st.sampled_from(["change", "drop", "double"]))
        middle = {"change": [mutated(draw, value[index])], "drop": [], "double": [value[index]] * 2}
        return [*value[:index], *middle[action], *value[index + 1 :]]
    return draw(odd)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_content_with_a_fitting_checksum_is_valid_or_refused_in_one_line(tmp_path, data):
    ProfileLibrary(profiles={"find": small(references={f"p{i}": 0.2 for i in range(3)})}).save(
        tmp_path
    )
    content = json.loads((tmp_path / "find.profile").read_text())
    for _ in range(data.draw(st.integers(1, 3))):
        content = mutated(data.draw, content)
        if not isinstance(content, dict):
            return
    path = rewritten(tmp_path / "mutated.profile", content)
    profile = read_or_refused(path)
    if profile is None:
        return
    means = profile.mean(np.linspace(0, 10, 20))
    assert ((means >= 0) & (means <= 1)).all()
    assert len(repr(profile)) <= 100


# Machines


def test_a_machine_is_read_as_it_was_written(tmp_path):
    machine = Machine("m", {"see": Rate(0.0, (0.1, 0.2), 2.0, 4)})
    write_machine(tmp_path / "machine.json", machine)
    assert read_machine(tmp_path / "machine.json") == machine


@pytest.mark.parametrize("field", ["per_work", "p95_over_mean"])
def test_a_negative_rate_is_refused(tmp_path, field):
    path = tmp_path / "machine.json"
    write_machine(path, Machine("m", {"see": Rate(1.0, (0.1,), 2.0, 4)}))
    content = json.loads(path.read_text())
    content["rates"]["see"][field] = -1.0
    rewritten(path, content)
    with pytest.raises(AnytimeError, match=r"rates\.see has a negative number"):
        read_machine(path)


def test_a_library_of_another_kind_of_machine_warns_and_has_wider_bands(tmp_path):
    elsewhere = Machine("this", {}, "A Fast Processor × 64")
    known = small()
    ProfileLibrary(profiles={known.module: known}, machine=elsewhere).save(tmp_path)
    with pytest.warns(
        UserWarning, match=r"are those of A Fast Processor × 64, .*calibrate"
    ) as told:
        there = ProfileLibrary(tmp_path)[known.module]
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    times = np.linspace(0, 4 * known.times[-1], 50)
    low, high = there.band(times)
    sure_low, sure_high = known.band(times)
    assert (low <= sure_low + 1e-9).all()
    assert (high >= sure_high - 1e-9).all()
    assert (high - low).sum() > (sure_high - sure_low).sum()
    assert there.on(Machine("mine").with_rate(known.module, 0.1)).unsure == 1.0


def test_a_library_of_this_kind_of_machine_or_of_simulated_time_is_trusted(tmp_path, recwarn):
    for host in ("", processor()):
        machine = Machine("this", {}, host)
        ProfileLibrary(profiles={"find": small()}, machine=machine).save(tmp_path)
        assert ProfileLibrary(tmp_path)["find"].unsure == 1.0
        assert ProfileLibrary(tmp_path).machine.host == host
    assert not recwarn.list


def test_a_folder_that_mixes_machines_keeps_its_doubt():
    here = ProfileLibrary(profiles={"path": small()}, machine=Machine("this", {}, "here"))
    there = ProfileLibrary(profiles={"find": small()}, machine=Machine("this", {}, "there"))
    assert there.updated(here).machine.host == "there"
    assert ProfileLibrary().updated(here).machine.host == "here"
    simulated = ProfileLibrary(profiles={"path": small()}, machine=Machine("work", {}, ""))
    assert there.updated(simulated).machine.host == "there"
    assert here.updated(simulated).machine.host == ""


def test_a_library_that_is_read_again_answers_as_before(tmp_path):
    @anytime.module(quality=lambda value: value, name="third")
    def third(x):
        for step in range(1, 5):
            yield x * step / 4

    machine = anytime.Machine("m").with_rate("third", 1 / 300)
    library = anytime.measure(
        third,
        [SimpleNamespace(x=x / 30) for x in range(1, 21)],
        seconds=1.0,
        clock=lambda: anytime.WorkClock(machine),
    )
    library.save(tmp_path)
    again = anytime.ProfileLibrary(tmp_path)
    same_as = {run.problem: run for run in again["third"].recordings}
    for run in library["third"].recordings:
        same = same_as[run.problem]
        assert (run.seconds == same.seconds).all()
        assert (run.raw == same.raw).all()
    moments = np.arange(1, 5) / 300
    assert library["third"].mean(moments) == pytest.approx(again["third"].mean(moments))


def test_writing_goes_through_links_and_into_pipes_and_keeps_who_may_read(tmp_path):
    real, link, pipe = tmp_path / "real", tmp_path / "link", tmp_path / "pipe"
    real.write_bytes(b"old")
    real.chmod(0o600)
    link.symlink_to(real)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
    assert real.stat().st_mode & 0o777 == 0o600
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_atomically(pipe, b"told")
    assert os.read(reader, 10) == b"told"
    os.close(reader)
    with pytest.raises(AnytimeError, match="is a folder; give the name of a file"):
        write_atomically(tmp_path, b"new")
