"""What contracts of each length are worth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime import AnytimeError
from compiler.curves import POINTS, curve


@given(
    data=st.lists(st.tuples(st.floats(1e-4, 100), st.floats(0, 1)), min_size=1, max_size=400),
)
def test_a_curve_rises_and_never_promises_more_than_its_points(data):
    lengths = np.unique([length for length, _ in data])
    qualities = np.array([quality for _, quality in data][: len(lengths)])
    if qualities.max() <= 1e-9:
        with pytest.raises(AnytimeError, match="'m' never has a result"):
            curve(lengths, qualities, "m")
        return
    made = curve(lengths, qualities, "m")
    assert len(made.lengths) <= POINTS
    assert (np.diff(made.lengths) > 0).all()
    assert (np.diff(made.qualities) > 0).all()
    best = np.maximum.accumulate(qualities)
    assert (made.quality(lengths) <= best + 1e-12).all()
    assert made.quality(np.array([lengths[-1]])) == pytest.approx(best[-1], abs=1e-8)
    assert made.quality(np.array([lengths[0] / 2])) == 0
