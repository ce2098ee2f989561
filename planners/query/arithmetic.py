"""Arithmetic for native models with CPython's bits and CPython's errors.

Native code and CPython call the same C library for most of `math`, so the bits agree; what CPython
adds is that a result out of the domain or the range is an error. Functions that round differently
(`hypot`, `pow`, the operator `**`) are missing here and refused when a model is read. A test
compares everything here with CPython, bit by bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from anytime.machine_code import njit


def _checked(function: Callable[[float], float], overflows: bool) -> Any:
    """A function of one number that raises where CPython does."""

    @njit
    def checked(x: float) -> float:
        x = float(x)
        result = function(x)
        if result != result and x == x:
            raise ValueError("math domain error")
        if math.isinf(result) and math.isfinite(x):
            if overflows:
                raise OverflowError("math range error")
            raise ValueError("math domain error")
        return result

    checked.__name__ = function.__name__
    return checked


def _guarded(function: Callable[[float], float], outside: Callable[[float], bool]) -> Any:
    """The same, where the number alone tells. What is raised before the function is called stands
    not between two of them: of sin(x) and cos(x) the compiler makes one call."""

    @njit(forceinline=True)
    def guarded(x: float) -> float:
        x = float(x)
        if outside(x):
            raise ValueError("math domain error")
        return function(x)

    guarded.__name__ = function.__name__
    return guarded


@njit(forceinline=True)
def _infinite(x: float) -> bool:
    return math.isinf(x)


@njit(forceinline=True)
def _negative(x: float) -> bool:
    return x < 0.0


_GUARDED = {"sin": _infinite, "cos": _infinite, "tan": _infinite, "sqrt": _negative}
_TOTAL = ("asin", "acos", "atan", "log", "log10", "log1p", "tanh")
_OVERFLOWING = ("exp", "expm1", "sinh", "cosh")
_EXACT = ("isfinite", "isinf", "isnan")


def _ceil_and_floor() -> dict[str, Any]:
    @njit
    def to_int(x: float) -> Any:
        if not -9.2e18 < x < 9.2e18:
            raise OverflowError("cannot convert a float this large, infinite or NaN to an integer")
        return np.int64(x)

    @njit
    def floor(x: float) -> int:
        return to_int(math.floor(float(x)))

    @njit
    def ceil(x: float) -> int:
        return to_int(math.ceil(float(x)))

    @njit
    def trunc(x: float) -> int:
        return to_int(float(x))

    return {"floor": floor, "ceil": ceil, "trunc": trunc}


@njit
def _fabs(x: float) -> float:
    return abs(float(x))


@njit
def _copysign(x: float, y: float) -> float:
    return math.copysign(float(x), float(y))


@njit
def _atan2(y: float, x: float) -> float:
    return math.atan2(float(y), float(x))


@njit
def _degrees(x: float) -> float:
    return float(x) * (180.0 / math.pi)


@njit
def _radians(x: float) -> float:
    return float(x) * (math.pi / 180.0)


def _module(name: str, contents: dict[str, Any]) -> ModuleType:
    module = ModuleType(name)
    vars(module).update(contents)
    return module


MODULE = _module(
    "math",
    {
        **{name: _guarded(getattr(math, name), outside) for name, outside in _GUARDED.items()},
        **{name: _checked(getattr(math, name), False) for name in _TOTAL},
        **{name: _checked(getattr(math, name), True) for name in _OVERFLOWING},
        **{name: getattr(math, name) for name in (*_EXACT, "pi", "e", "tau", "inf", "nan")},
        **_ceil_and_floor(),
        "fabs": _fabs,
        "copysign": _copysign,
        "atan2": _atan2,
        "degrees": _degrees,
        "radians": _radians,
    },
)
"""What a native model sees as `math`."""

ARRAYS = _module(
    "numpy",
    {
        name: getattr(np, name)
        for name in ("zeros", "ones", "full", "float64", "int64", "inf", "pi", "nan")
    },
)
"""What a native model sees as `numpy`: arrays to work in."""


def min_(a: Any, b: Any, c: Any = None) -> Any:
    """The builtin `min` of two or three numbers: the first of the smallest."""


def max_(a: Any, b: Any, c: Any = None) -> Any:
    """The builtin `max` of two or three numbers: the first of the largest."""


@overload(min_)
def _min(a, b, c=None):
    if c is None or isinstance(c, types.Omitted):
        return lambda a, b, c=None: b if b < a else a

    def of_three(a, b, c=None):
        least = b if b < a else a
        return c if c < least else least

    return of_three


@overload(max_)
def _max(a, b, c=None):
    if c is None or isinstance(c, types.Omitted):
        return lambda a, b, c=None: b if b > a else a

    def of_three(a, b, c=None):
        most = b if b > a else a
        return c if c > most else most

    return of_three


@njit
def int_(x):
    """The builtin `int` of a number."""
    if not -9.2e18 < x < 9.2e18:
        raise OverflowError("cannot convert a float this large, infinite or NaN to an integer")
    return np.int64(x)


@njit
def round_(x: float):
    """The builtin `round` of a number to an integer: halves go to the even one."""
    x = float(x)
    if not -9.2e18 < x < 9.2e18:
        raise OverflowError("cannot convert a float this large, infinite or NaN to an integer")
    below = math.floor(x)
    part = x - below
    if part > 0.5 or (part == 0.5 and np.int64(below) & 1):
        return np.int64(below) + 1
    return np.int64(below)
