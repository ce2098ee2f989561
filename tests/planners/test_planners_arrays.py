"""Arrays of a search, in one piece of memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.arrays import zeroed

shapes = st.one_of(st.integers(1, 200), st.tuples(st.integers(1, 40), st.integers(1, 9)))
kinds = st.sampled_from([np.uint8, np.int32, np.int64, np.float64])


@given(st.lists(st.tuples(shapes, kinds), min_size=1, max_size=6))
def test_each_has_its_shape_and_type_and_none_lies_in_another(wanted):
    arrays = zeroed(**{f"array{number}": each for number, each in enumerate(wanted)})
    for (shape, kind), array in zip(wanted, arrays.values(), strict=True):
        assert array.shape == (shape if isinstance(shape, tuple) else (shape,))
        assert array.dtype == kind
        assert array.flags.c_contiguous
        assert array.flags.aligned
        assert not array.any()
        array[...] = 1
    assert all((array == 1).all() for array in arrays.values())
    for number, array in enumerate(arrays.values()):
        array[...] = number
    assert all((array == number).all() for number, array in enumerate(arrays.values()))


@pytest.mark.parametrize("cells", [1 << 17, 1 << 19, 1 << 21])
def test_large_ones_begin_with_a_large_page(cells):
    arrays = zeroed(label=(cells * 4, np.int32), slot=(cells, np.int32))
    assert arrays["label"].ctypes.data % (1 << 21) == 0
