"""Digests: equal values have equal ones in every process, others another."""

import subprocess
import sys
from dataclasses import dataclass
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest

from anytime.digests import digest_of

WORDS = {"north", "south", "east", "west"}


def test_a_digest_is_the_same_in_a_process_that_hashes_otherwise():
    within = f"Fraction, {WORDS!r}, SimpleNamespace(doors=frozenset({WORDS!r}))"
    program = (
        "from fractions import Fraction; from types import SimpleNamespace\n"
        f"from anytime.digests import digest_of; print(digest_of({within}, dict(a=1, b=2)))"
    )
    for seed in ("1", "2"):
        told = subprocess.run(
            [sys.executable, "-c", program],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        )
        room = SimpleNamespace(doors=frozenset(WORDS))
        assert told.stdout.strip() == digest_of(Fraction, WORDS, room, {"b": 2, "a": 1})


def test_a_value_of_a_script_has_the_same_digest_where_the_script_is_imported(tmp_path):
    script = tmp_path / "cart.py"
    script.write_text(
        "from dataclasses import dataclass\n"
        "from anytime.digests import digest_of\n"
        "@dataclass\nclass Place:\n    at: float\n"
        "def here(): return digest_of(Place(1.0), here)\n"
        "if __name__ == '__main__': print(here())\n"
    )
    told = [
        subprocess.run(
            [sys.executable, *how],
            env={"PYTHONPATH": ":".join([str(tmp_path), *sys.path])},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for how in ([str(script)], ["-c", "import cart; print(cart.here())"])
    ]
    assert told[0] == told[1]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (["ab", "ab"], ["ab", "".join(["a", "b"])]),
        (np.asfortranarray(np.eye(3)), np.eye(3)),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
    ],
)
def test_equal_values_have_equal_digests(one, other):
    assert digest_of(one) == digest_of(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (np.zeros((2, 8)), np.zeros((4, 4))),
        (np.zeros(4), np.zeros(4, np.float32)),
        (["ab", "c"], ["a", "bc"]),
        ([[1], 2], [1, [2]]),
        ((1, 2), [1, 2]),
        (np.ma.array([1, 2], mask=[0, 1]), np.ma.array([1, 2], mask=[1, 0])),
        (np.array([object]), np.array([int])),
    ],
)
def test_other_values_have_other_digests(one, other):
    assert digest_of(one) != digest_of(other)
    assert digest_of(one, other) != digest_of(other, one)


def test_what_holds_itself_has_a_digest():
    here, there = SimpleNamespace(at=1), SimpleNamespace(at=2)
    here.next, there.next = here, there
    assert digest_of(here) == digest_of(here)
    assert digest_of(here) != digest_of(there)


@dataclass(slots=True)
class Door:
    other: object = None


def test_what_is_shared_or_goes_in_a_circle_is_written_once():
    tower = [1.0]
    for _ in range(60):
        tower = SimpleNamespace(left=tower, right=tower)
    assert len(digest_of(tower)) == 16
    one, other = Door(), Door()
    one.other, other.other = other, one
    assert digest_of(one) == digest_of(other)


def test_what_cannot_be_pickled_is_named():
    with pytest.raises(TypeError, match="function cannot be pickled"):
        digest_of(lambda: None)


def test_functions_without_a_name_of_their_own_are_not_taken_for_each_other():
    for nameless in (lambda: 1, lambda: 2):
        with pytest.raises(TypeError, match="cannot be pickled"):
            digest_of(nameless)
