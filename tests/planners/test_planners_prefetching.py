"""To ask for memory early changes nothing but when it comes."""

import numpy as np
from numba import njit

from planners.prefetching import prefetch


def _total(numbers, ahead):
    total = 0
    for place in range(numbers.size):
        prefetch(numbers, place + ahead)
        total += numbers[place]
    return total


def test_what_is_asked_for_may_lie_outside_of_an_array():
    numbers = np.arange(1000)
    for ahead in (0, 6, -5000, 10**9):
        assert njit(_total)(numbers, ahead) == _total(numbers, ahead) == numbers.sum()
