"""What a model may say, what is refused with the line and the way out, and what is kept."""

from __future__ import annotations

import functools
import math
import subprocess
import sys
from math import sin as sine
from pathlib import Path

import numpy as np
import pytest

from planners import nao_plan, query
from planners.query import ModelError, NativeError, Query

TAGS = ("a", "b")
WEIGHTS = np.array([0.2, 0.8])
SOURCE = "step"


def line_of(text: str) -> int:
    """The line of this file that contains a text for the first time."""
    return next(
        number
        for number, line in enumerate(Path(__file__).read_text().splitlines(), 1)
        if text in line
    )


def helper(rng, x, scale=2.0):
    """A helper has defaults, constants of its own and helpers of its own."""
    return scale * rng.gaussian(SOURCE, x, WEIGHTS[1]) + deeper(x)


def deeper(x: float) -> float:
    y: float = sine(x)
    return math.floor(y) + nao_plan.CROUCH + min(x, 3.0, y) + max(1, 2) + int(y) + round(x)


def made(offset):
    @query.model
    def enclosed(rng, w):
        value = helper(rng, w.x) + offset
        for i, weight in enumerate((1.0, 2.0)):
            value += weight * i
        if nao_plan.standing(rng.randint("posture", 6)) and not rng.flip("b"):
            value -= 0.5
        scratch = np.zeros(3)
        scratch[rng.categorical("c", WEIGHTS)] = value
        return abs(scratch[0] + scratch[1])

    return enclosed


def test_helpers_constants_closures_and_modules_are_made_native_with_the_model():
    for offset in (0.25, -4.0):
        model = made(offset)
        searches = [Query(model, {"x": 0.3}, seed=2, native=native) for native in (True, False)]
        for searched in searches:
            searched.step(5)
        native, plain = (searched.best for searched in searches)
        assert native.value == plain.value
        assert dict(native.choices) == dict(plain.choices)


@query.model
def computed(rng):
    return sum_of([rng.gaussian(f"x{i}") for i in range(3)])  # the name is computed


def sum_of(values):
    total = 0.0
    for value in values:
        total += value
    return total


@query.model
def looped(rng):
    total = 0.0
    for tag in TAGS:
        total += rng.gaussian(tag)  # the name is a variable
    return total


@query.model
def far(rng):
    return math.hypot(rng.gaussian("x"), 2.0)  # rounds differently


@query.model
def powerful(rng):
    return rng.gaussian("x") ** 2  # a power


@query.model
def summing(rng):
    return sum([rng.gaussian("x")])  # a builtin


@query.model
def recursive(rng):
    return again(rng)


def again(rng):
    return again(rng) if rng.flip("more") else 0.0  # calls itself


@query.model
def nested(rng):
    def inner(x):  # a function within
        return x

    return inner(rng.gaussian("x"))


@query.model
def worldly(rng):
    return rng.gaussian("x") * len(SETTINGS)  # a dictionary


SETTINGS = {"a": 1}


def doubled(function):
    @functools.wraps(function)
    def inner(x):
        return 2.0 * function(x)

    return inner


@doubled
def decorated(x):
    return abs(x)


@query.model
def helped(rng):
    return decorated(rng.gaussian("x"))


@query.model
def told(rng):
    print(rng.gaussian("x"))  # a choice that is printed
    return abs(rng.gaussian("x"))


@query.model
def popped(rng):
    values = [rng.gaussian("x"), 1.0]
    print(values.pop())  # a change that is printed
    return values[0]


def _described(x):
    return x * 2.0


@query.model
def described(rng):
    x = rng.gaussian("x")
    print(_described(x), f"{x:.3f}")
    for i in range(2):
        x += rng.at("step", i).gaussian("y")
        print(i)
    leg = rng.at("leg", rng.flip("second"))
    return leg.gaussian("y") + x


@query.model
def unordered(rng):
    total = 0
    for i in {30, 1, 17}:  # a set
        total = total * 3 + i
    return total + rng.gaussian("x")


@query.model
def shifted(rng):
    return 1 << rng.randint("n", 4)  # a shift


@query.model
def inverted(rng):
    return ~rng.flip("b")  # an inversion


@query.model
def added(rng):
    values = np.zeros(40)
    values[0] = rng.gaussian("x")
    return values.sum()  # a sum of an array


@pytest.mark.parametrize(
    ("model", "says", "at"),
    [
        (computed, "the name in rng.gaussian(…) is computed", "# the name is computed"),
        (looped, "the name in rng.gaussian(…) is computed", "# the name is a variable"),
        (far, "math.sqrt(x * x + y * y)", "# rounds differently"),
        (powerful, "x * x", "# a power"),
        (summing, "a loop that adds", "# a builtin"),
        (recursive, "again calls itself", None),
        (nested, "a function within the function", "# a function within"),
        (worldly, "put it into the world", "# a dictionary"),
        (helped, "decorated is decorated", None),
        (told, "make it before", "# a choice that is printed"),
        (popped, "make it before", "# a change that is printed"),
        (unordered, "write a tuple", "# a set"),
        (shifted, "multiply or divide", "# a shift"),
        (inverted, "not x", "# an inversion"),
        (added, "a loop that adds", "# a sum of an array"),
    ],
)
def test_what_has_no_native_form_is_refused_with_the_line_and_the_way_out(model, says, at):
    with pytest.raises(NativeError) as error:
        Query(model)
    message = str(error.value)
    assert says in message
    assert "native=False" in message
    assert "\n" not in message
    if at:
        assert f"{Path(__file__).name}:{line_of(at)}:" in message


def test_a_refused_model_may_stay_plain():
    refused = (computed, looped, far, powerful, summing, nested, worldly)
    for model in (*refused, helped, told, unordered, shifted, inverted, added):
        searched = Query(model, native=False, population=8)
        searched.step(2)
        assert searched.model.replay(searched.best.choices) == searched.value


@query.model
def ambiguous(rng):
    if rng.flip("kind"):
        return rng.gaussian("x")
    return rng.uniform("x")


def test_a_source_of_two_distributions_is_refused_natively_and_plain():
    for native in (True, False):
        with pytest.raises(ModelError, match="'x' is asked for gaussian and for uniform"):
            Query(ambiguous, native=native, population=8).step(3)


@query.model
def mistyped(rng):
    return rng.randint("n", 2.5)


def test_prints_that_do_nothing_else_are_left_out_and_a_place_may_be_a_flip():
    searched = Query(described, population=8, seed=1)
    searched.step(3)
    assert described.replay(searched.best.choices) == searched.value


@query.model
def slashed(rng):
    return rng.gaussian("a/0/b") + rng.at("a", 0).gaussian("b")


def test_a_name_that_could_be_a_path_is_refused_natively_and_plain():
    for native in (True, False):
        with pytest.raises(ModelError, match="holds a /"):
            Query(slashed, native=native, population=8).step(1)


@query.model
def misplaced(rng):
    return rng.at("a", 2.5).gaussian("x")


def test_a_place_is_an_integer():
    with pytest.raises(NativeError, match="takes an integer place"):
        Query(misplaced)


def test_what_the_compiler_refuses_is_told_in_one_line():
    with pytest.raises(NativeError) as error:
        Query(mistyped)
    assert "randint(source, n) takes an integer" in str(error.value)
    assert "\n" not in str(error.value)


MODEL = """
from planners import query
import sys
SCALE = {scale}

@query.model
def kept(rng, w):
    return abs(SCALE * rng.gaussian("x") - w.goal)

searched = query.Query(kept, {{"goal": 2.0}}, seed=1)
searched.step(20)
print(searched._native.cached, round(searched.best.choices["x", 0], 3))
"""


def test_native_code_is_kept_between_processes_and_made_anew_when_a_constant_changes(tmp_path):
    def run(scale: float) -> str:
        file = tmp_path / "kept.py"
        if not file.exists() or f"SCALE = {scale}" not in file.read_text():
            file.write_text(MODEL.format(scale=scale))
        done = subprocess.run(
            [sys.executable, str(file)], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    assert run(1.0) == "False 2.0"
    assert run(1.0) == "True 2.0"
    assert run(4.0) == "False 0.5"
