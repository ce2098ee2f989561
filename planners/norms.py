"""What a way costs among obstacles that are independent of each other, by density and direction.

A way from far to near is longer than the octile distance by a factor that tends to a constant for
each density and direction (first-passage percolation): at 20 % by 3 % towards (3, 1), but by 13 %
along a diagonal, because corners are not cut. A search whose heuristic is that norm goes straight
through and is right about nearly every cell; a weight that is the same in all directions
punishes small detours at some and hardly any at others.
"""

import numpy as np

from anytime.machine_code import njit
from planners.search import DIAGONAL, STRAIGHT

CALLED = "a205cc50c874"

_SLOPES = np.array([0.0, 0.3, 0.6, 1.0])
_DENSITIES = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.33, 0.35, 0.37])
_FACTORS = np.array(
    [
        [1.0, 1.0, 1.0, 1.0],
        [1.0117, 1.0003, 1.0003, 1.0283],
        [1.0278, 1.0007, 1.0052, 1.0597],
        [1.0484, 1.0065, 1.0248, 1.0927],
        [1.0826, 1.0271, 1.0521, 1.1276],
        [1.1255, 1.0637, 1.0892, 1.1719],
        [1.2057, 1.1399, 1.1515, 1.2405],
        [1.2708, 1.2052, 1.2166, 1.3028],
        [1.3589, 1.2679, 1.2871, 1.3723],
        [1.5363, 1.4359, 1.4433, 1.5148],
    ]
)
"""Mean cost / octile distance over 300 cells, by density and by near / far as in `_SLOPES`."""


@njit(cache=True, nogil=True, error_model="numpy")
def least_norm(diagonals, norm):
    """Write the norm of an empty floor, which never says too much: octile, or taxi."""
    for place in range(0, 6, 2):
        norm[place], norm[place + 1] = STRAIGHT, DIAGONAL - STRAIGHT if diagonals else STRAIGHT


@njit(cache=True, nogil=True, error_model="numpy")
def expected_norm(density, scale, diagonals, norm):
    """Write `scale` times what a way costs on floors of a density, for `improving.estimated`.

    Three planes touch the measured values in four directions; the norm is convex, so the greatest
    of them lies between. Without diagonals the direction matters little.
    """
    above = 1
    while above < _DENSITIES.size - 1 and _DENSITIES[above] <= density:
        above += 1
    low, high = _DENSITIES[above - 1], _DENSITIES[above]
    share = min((density - low) / (high - low), 1.0)
    costs = np.empty(_SLOPES.size)
    for place in range(_SLOPES.size):
        one, other = _FACTORS[above - 1, place], _FACTORS[above, place]
        costs[place] = scale * (one + share * (other - one))
    if not diagonals:
        for place in range(6):
            norm[place] = round(STRAIGHT * costs[-1])
        return
    for place in range(_SLOPES.size):
        costs[place] *= STRAIGHT + (DIAGONAL - STRAIGHT) * _SLOPES[place]
    for place in range(3):
        near = (costs[place + 1] - costs[place]) / (_SLOPES[place + 1] - _SLOPES[place])
        norm[2 * place] = round(costs[place] - near * _SLOPES[place])
        norm[2 * place + 1] = round(near)
