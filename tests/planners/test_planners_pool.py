"""Arrays that are kept for the next planner, of few sizes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from planners.pool import Pool

shapes = st.tuples(st.integers(1, 3), st.integers(1, 3))


def test_what_was_put_back_is_taken_again():
    pool = Pool(lambda rows, columns: np.zeros((rows, columns)))
    first = pool.take((2, 3))
    assert pool.take((2, 3)) is not first
    pool.put_back((2, 3), first)
    assert pool.take((2, 3)) is first


@given(st.lists(shapes, min_size=1))
def test_it_keeps_the_sizes_that_were_used_last(used):
    pool = Pool(lambda rows, columns: np.zeros((rows, columns)))
    for shape in used:
        pool.put_back(shape, pool.take(shape))
    latest = list(dict.fromkeys(reversed(used)))
    assert set(pool._kept) == set(latest[: Pool.SIZES])


def test_it_keeps_but_a_few_of_each_size():
    pool = Pool(lambda rows, columns: np.zeros((rows, columns)))
    for arrays in [pool.take((1, 1)) for _ in range(3 * Pool.EACH)]:
        pool.put_back((1, 1), arrays)
    assert len(pool._kept[1, 1]) == Pool.EACH
