"""What a way costs among obstacles that are independent of each other, by density and direction.

A way from far to near is longer than the octile distance by a factor that tends to a constant for
each density and direction (first-passage percolation): at 20 % by 3 % towards (3, 1), but by 13 %
along a diagonal, because corners are not cut. A search whose heuristic is that norm goes straight
through and is right about nearly every cell; a weight that is the same in all directions
punishes small detours at some and hardly any at others.
"""

import numpy as np
from numpy.typing import NDArray

from planners.search import DIAGONAL, STRAIGHT

_DENSITY = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.33, 0.35, 0.37)
_SLOPES = np.array([0.0, 0.3, 0.6, 1.0])
_FACTOR = (
    (1.0, 1.0117, 1.0278, 1.0484, 1.0826, 1.1255, 1.2057, 1.2708, 1.3589, 1.5363),
    (1.0, 1.0003, 1.0007, 1.0065, 1.0271, 1.0637, 1.1399, 1.2052, 1.2679, 1.4359),
    (1.0, 1.0003, 1.0052, 1.0248, 1.0521, 1.0892, 1.1515, 1.2166, 1.2871, 1.4433),
    (1.0, 1.0283, 1.0597, 1.0927, 1.1276, 1.1719, 1.2405, 1.3028, 1.3723, 1.5148),
)
"""Mean cost / octile distance at 300 cells, by near / far in `_SLOPES` (rows) and `_DENSITY`."""


def least_norm(diagonals: bool) -> NDArray[np.int64]:
    """The norm of an empty floor, which never says too much: octile, or without diagonals taxi."""
    return np.array([STRAIGHT, DIAGONAL - STRAIGHT if diagonals else STRAIGHT] * 3)


def expected_norm(density: float, scale: float, diagonals: bool) -> NDArray[np.int64]:
    """`scale` times what a way costs on floors of a density, as `improving.estimated` takes it.

    Three planes touch the measured values in four directions; the norm is convex, so the greatest
    of them lies between. Without diagonals the direction matters little.
    """
    factor = np.array([np.interp(density, _DENSITY, row) for row in _FACTOR])
    if not diagonals:
        return np.full(6, round(scale * STRAIGHT * factor[-1]))
    cost = scale * factor * (STRAIGHT + (DIAGONAL - STRAIGHT) * _SLOPES)
    near = np.diff(cost) / np.diff(_SLOPES)
    far = cost[:-1] - near * _SLOPES[:-1]
    return np.round(np.stack([far, near], axis=1)).astype(np.int64).reshape(6)
