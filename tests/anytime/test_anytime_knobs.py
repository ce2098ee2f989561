"""Knobs: arguments that whoever divides the time may set."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import numpy as np
import pytest

import anytime
from anytime import AnytimeError, Machine, ProfileLibrary, WorkClock
from anytime.programs import program_of
from planners import weighted


@anytime.module(cost=lambda cost: cost)
def guess(size, *, effort=anytime.knob([1, 3]), mode=anytime.knob(["rough", "fine"])):
    """Costs less the more effort it makes."""
    anytime.charge(10 * effort)
    yield size / effort + (mode == "rough")


@dataclass(frozen=True)
class Problem:
    size: float


def clock():
    return WorkClock(Machine("lab").with_rate("guess", 0.001))


def test_a_module_runs_with_the_first_value_unless_it_is_set():
    assert anytime.run(guess, 6.0, seconds=1.0).value == 7.0
    assert anytime.run(guess.set(effort=3, mode="fine"), 6.0, seconds=1.0).value == 2.0


def test_every_setting_is_a_module_with_a_name_of_its_own():
    names = [each.name for each in guess.settings()]
    assert names[0] == "guess@effort=1,mode=rough"
    assert len(set(names)) == 4
    assert guess.set(effort=3, mode="fine").settings()[0].name == names[-1]


def test_settings_are_measured_against_the_cheapest_of_all_and_share_the_machine(tmp_path):
    library = anytime.measure(guess, [Problem(6.0), Problem(9.0)], seconds=1.0, clock=clock)
    ends = {name.partition("@")[2]: profile.mean(1.0)[0] for name, profile in library.items()}
    assert ends["effort=3,mode=fine"] == 1.0
    assert ends["effort=1,mode=rough"] == pytest.approx((2 / 7 + 3 / 10) / 2)
    assert library["guess@effort=3,mode=fine"].time_to(0.5) == pytest.approx(0.03)
    library.save(tmp_path)
    assert sorted(ProfileLibrary(tmp_path)) == sorted(library)


def test_a_program_calls_every_setting_with_the_same_arguments():
    program = program_of(weighted.find_path)
    assert [call.module.chosen["weight"] for call in program.calls] == [5.0, 2.0, 1.2, 1.0]
    assert len({call.arguments for call in program.calls}) == 1


def test_a_set_module_travels_by_name():
    fine = guess.set(effort=3, mode="fine")
    again = pickle.loads(pickle.dumps(fine))
    assert (again.name, again.chosen) == (fine.name, fine.chosen)
    assert pickle.loads(pickle.dumps(guess)) is guess


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1], "give two different values or more"),
        ([1, 1], "give two different values or more"),
        ([1, "1"], "give two different values or more"),
        ([1, None], "its values are numbers or words"),
        (["a b", "c"], "its values are numbers or words"),
    ],
)
def test_what_is_no_knob_is_refused_in_one_line(values, message):
    with pytest.raises(AnytimeError, match=message):
        anytime.knob(values)


def test_what_cannot_be_set_is_refused_in_one_line():
    with pytest.raises(AnytimeError, match=r"no knob effort with 2; it has effort \[1, 3\]"):
        guess.set(effort=2, mode="fine")
    with pytest.raises(AnytimeError, match="needs mode=…"):
        guess.set(effort=1)
    with pytest.raises(AnytimeError, match=r"among its inputs; put it behind a \*"):

        @anytime.module(quality=float)
        def wrong(image, size=anytime.knob([1, 2])):
            yield image


@pytest.mark.parametrize("values", [[1, 1.0], [float("nan"), 1], [True, 1]])
def test_values_of_a_knob_are_different_and_equal_to_themselves(values):
    with pytest.raises(AnytimeError, match="a knob of"):
        anytime.knob(values)


def test_whole_numbers_of_numpy_are_numbers():
    assert anytime.knob(np.array([3, 1])).values == (3, 1)
