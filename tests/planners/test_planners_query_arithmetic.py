"""Native arithmetic has CPython's bits and CPython's errors, in everything that is supported."""

from __future__ import annotations

import inspect
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import njit

from planners.query import arithmetic

SPECIAL = (0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1.5, 2.5, -2.5, 1e-320, 1e-30, 1e15, 1e17, 709.0, 710.0)
EDGES = (*SPECIAL, -750.0, 1e300, -1e300, math.inf, -math.inf, math.nan)


def numbers(count: int) -> list[float]:
    """Floats of all sizes, with the special ones."""
    rng = np.random.default_rng(5)
    wide = rng.normal(size=count) * 10.0 ** rng.uniform(-12, 12, count)
    near = rng.uniform(-1.2, 1.2, count)
    return [*EDGES, *wide.tolist(), *near.tolist()]


def outcome(function: Callable[..., Any], *arguments: float) -> Any:
    """The bits of a result, or the type of an error."""
    try:
        result = function(*arguments)
    except (ValueError, OverflowError, ZeroDivisionError) as error:
        return type(error)
    if isinstance(result, float):
        return "nan" if math.isnan(result) else struct.pack("d", result)
    return int(result)


def huge(function: Callable[..., Any], *arguments: float) -> bool:
    """Whether CPython gives an integer that no machine integer holds."""
    try:
        result = function(*arguments)
    except (ValueError, OverflowError):
        return False
    return isinstance(result, int) and abs(result) >= 9.2e18


UNARY = [n for n, f in vars(arithmetic.MODULE).items() if callable(f) and not n.startswith("_")]
BINARY = ("copysign", "atan2")


@pytest.mark.parametrize("name", sorted(set(UNARY) - set(BINARY)))
def test_functions_of_one_number(name):
    exact = getattr(math, name)
    found = getattr(arithmetic.MODULE, name)
    native = found if hasattr(found, "py_func") else njit(lambda x: found(x))
    for x in numbers(1500):
        expected = OverflowError if huge(exact, x) else outcome(exact, x)
        found = outcome(native, x)
        if name in ("ceil", "floor", "trunc") and math.isnan(x):  # any error will do
            assert isinstance(found, type)
        else:
            assert found == expected, (name, x)


@pytest.mark.parametrize("name", BINARY)
def test_functions_of_two_numbers(name):
    exact, native = getattr(math, name), getattr(arithmetic.MODULE, name)
    values = numbers(40)
    for x in values:
        for y in values:
            assert outcome(native, x, y) == outcome(exact, x, y), (name, x, y)


OPERATORS = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "floor_divide": lambda x, y: x // y,
    "modulo": lambda x, y: x % y,
    "less": lambda x, y: x < y,
    "equal": lambda x, y: x == y,
    "power_by_hand": lambda x, y: x * x * y,
}


@pytest.mark.parametrize("name", OPERATORS)
def test_operators(name):
    exact = OPERATORS[name]
    native = njit(exact)
    values = numbers(40)
    for x in values:
        for y in values:
            assert outcome(native, x, y) == outcome(exact, x, y), (name, x, y)
    for x in range(-7, 8):
        for y in range(-7, 8):
            assert outcome(native, x, y) == outcome(exact, x, y), (name, x, y)
            assert outcome(native, x, y + 0.5) == outcome(exact, x, y + 0.5), (name, x, y)


@njit
def smallest(x, y, z):
    return arithmetic.min_(arithmetic.min_(x, y), z), arithmetic.min_(x, y, z)


@njit
def largest(x, y, z):
    return arithmetic.max_(arithmetic.max_(x, y), z), arithmetic.max_(x, y, z)


def test_min_and_max_treat_nan_and_signed_zero_as_python_does():
    for x in EDGES:
        for y in EDGES:
            for z in (0.0, -0.0, math.nan, 2.0):
                for native, exact in ((smallest, min), (largest, max)):
                    expected = outcome(lambda *a, e=exact: e(*a), x, y, z)
                    nested = outcome(lambda *a, e=exact: e(e(a[0], a[1]), a[2]), x, y, z)
                    found = native(x, y, z)
                    assert outcome(lambda f=found: f[1]) == expected
                    assert outcome(lambda f=found: f[0]) == nested


@pytest.mark.parametrize(("native", "exact"), [(arithmetic.int_, int), (arithmetic.round_, round)])
def test_conversions_to_integers(native, exact):
    for x in numbers(1500):
        expected = OverflowError if huge(exact, x) else outcome(exact, x)
        found = outcome(native, x)
        if expected is ValueError:  # of NaN: any error will do
            assert isinstance(found, type)
        else:
            assert found == expected, x


def test_what_rounds_differently_is_missing():
    for name in ("hypot", "pow", "dist", "fsum", "fmod"):
        assert not hasattr(arithmetic.MODULE, name)
    assert inspect.ismodule(arithmetic.MODULE)
