"""Calibration: each module's speed here against there, and whether it is still the same module."""

import functools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
from anytime import AnytimeError, Machine, ProfileLibrary, WorkClock, examining
from anytime.calibrating import PROBLEMS, calibrate
from compiler import program

THERE = Machine("there").with_rate("look", 0.01).with_rate("go", 0.002)


class Other(WorkClock):
    """Another machine: each module slower by its own factor, with a heavy tail."""

    def __init__(self, seed=0, **factors):
        super().__init__(THERE)
        self.factors, self.rng = factors, np.random.default_rng(seed)

    def spend(self, module, work, step):
        if module in self.factors:
            tail = self.rng.lognormal(-0.5 * 0.3**2, 0.3)
            work = work * self.factors[module] * tail
        super().spend(module, work, step)


@anytime.module(quality=lambda value, problem: 1 - abs(value - problem.truth))
def look(start, *, rng):
    value = start
    for _ in range(20):
        anytime.charge(1)
        value += 0.2 * (0.5 - value) + 0.01 * rng.random()
        yield value


@anytime.module(quality=lambda value, problem: 1 - abs(value - problem.truth))
def go(seen):
    for share in np.linspace(0.3, 1.0, 30):
        anytime.charge(2)
        yield share * seen


@program
def both(start):
    return go(look(start))


def problems(count=40):
    return [SimpleNamespace(start=i / count, truth=0.5) for i in range(count)]


@pytest.fixture(scope="module")
def library():
    clock = functools.partial(WorkClock, THERE)
    return anytime.measure(both, problems(), seconds=0.25, clock=clock)


def test_each_module_has_a_ratio_of_its_own_whose_interval_holds_the_truth(library):
    seeds = iter(range(10_000))
    found = calibrate(library, both, problems(), clock=lambda: Other(next(seeds), look=1.5, go=3.0))
    by_name = {each.module: each for each in found.modules}
    for name, factor in (("look", 1.5), ("go", 3.0)):
        each = by_name[name]
        assert len(each.ratios) == PROBLEMS
        assert 0.85 * factor < each.low <= factor * 1.1
        assert each.low < each.ratio < 1.2 * factor
        assert each.changed is None
        rate = found.library.machine.rates[name].per_work
        assert rate == pytest.approx(each.ratio * library.machine.rates[name].per_work)


def test_the_same_machine_is_itself_and_its_profiles_stay(library):
    found = calibrate(library, both, problems(), clock=functools.partial(WorkClock, THERE))
    assert [each.ratio for each in found.modules] == pytest.approx([1.0, 1.0])
    for name, profile in library.items():
        for was, run in zip(profile.recordings, found.library[name].recordings, strict=True):
            np.testing.assert_allclose(run.seconds, was.seconds)


def test_quality_over_work_stays_as_it_was(library):
    found = calibrate(library, both, problems(), clock=lambda: Other(look=1.5))
    for name, profile in library.items():
        for was, run in zip(profile.recordings, found.library[name].recordings, strict=True):
            np.testing.assert_array_equal(run.raw, was.raw)
            np.testing.assert_array_equal(run.work, was.work)


def test_a_module_that_has_changed_is_told_from_a_machine_that_is_slower(library):
    look_profile = library["look"]
    runs = tuple(replace(run, raw=run.raw * 0.9) for run in look_profile.recordings)
    other = {**library, "look": replace(look_profile, recordings=runs)}
    kept = ProfileLibrary(profiles=other, machine=library.machine)
    found = calibrate(kept, both, problems(), clock=lambda: Other(look=2.0))
    by_name = {each.module: each for each in found.modules}
    assert "after 1 units of work" in by_name["look"].changed
    assert by_name["go"].changed is None
    assert "it has changed" in repr(found)


def test_problems_that_the_library_does_not_know_are_refused(library):
    strange = [SimpleNamespace(start=7.0, truth=0.5)]
    with pytest.raises(AnytimeError, match="know none of the 1 problems"):
        calibrate(library, both, strange)
    with pytest.raises(AnytimeError, match="no profile for module 'look'"):
        calibrate(ProfileLibrary(), both, problems())


def test_a_machine_is_quiet_when_nothing_is_late_unsteady_or_busy():
    quiet = examining.Examination(2, 0.2, 5e7, 1.1, 1e-6, 1e-5, 1e-4, ())
    assert quiet.quiet
    assert replace(quiet, load=None).quiet
    assert not replace(quiet, load=1.0).quiet
    assert not replace(quiet, unsteady=2.0).quiet
    assert not replace(quiet, late_p99=0.01).quiet


def test_the_doctor_says_how_fast_and_how_quiet_this_machine_is(capsys):
    from anytime.__main__ import main

    assert main(["doctor", "--seconds", "0.1"]) == 0
    out = capsys.readouterr().out
    assert "million turns of an empty loop" in out
    assert "to measure in real time" in out
    assert "broken" not in out


def test_the_command_writes_the_library_of_this_machine(tmp_path, capsys):
    from anytime.__main__ import main

    script = tmp_path / "mine.py"
    script.write_text(
        "import anytime\nfrom types import SimpleNamespace\n"
        "@anytime.module(quality=lambda value: value)\n"
        "def climb(start):\n"
        "    for share in range(1, 9):\n"
        "        sum(range(2000))\n"
        "        yield min(1.0, start + share / 16)\n"
        "def problems(rng):\n"
        "    for _ in range(6):\n"
        "        yield SimpleNamespace(start=rng.random() / 2)\n"
    )
    kept, moved = str(tmp_path / "kept"), str(tmp_path / "moved")
    asked = (f"{script}:climb", "--problems", f"{script}:problems", "--library", kept)
    assert main(["profile", *asked, "--seconds", "0.1"]) == 0
    assert main(["calibrate", *asked, "-o", moved]) == 0
    assert "climb  ×" in capsys.readouterr().out
    assert len(ProfileLibrary(moved)["climb"].recordings) == 6
