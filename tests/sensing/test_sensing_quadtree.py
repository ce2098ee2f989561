"""The quad-tree: a parent is the mean of its children, and off the map all is blocked."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from anytime.errors import AnytimeError
from sensing import quad_tree

floors = hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, max_side=21))


@given(blocked=floors)
def test_a_position_holds_the_share_of_its_block_that_is_blocked(blocked):
    tree = quad_tree(blocked)
    side = 2**tree.level_max
    padded = np.ones((side, side), bool)
    padded[: blocked.shape[0], : blocked.shape[1]] = blocked
    for level, grid in enumerate(tree.levels):
        block = 2**level
        assert grid.dtype == np.float32
        assert grid.shape == tuple(-(-extent // block) for extent in blocked.shape)
        means = padded.reshape(side // block, block, side // block, block).mean(axis=(1, 3))
        assert np.array_equal(grid, means[: grid.shape[0], : grid.shape[1]])
    assert tree.levels[-1].shape == (1, 1)


@given(
    chance=hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=17),
        elements=st.floats(0, 1, width=32),
    )
)
def test_a_parent_is_the_mean_of_its_children(chance):
    tree = quad_tree(chance)
    for level in range(1, tree.level_max + 1):
        for (row, column), share in np.ndenumerate(tree.levels[level]):
            children = [
                tree.obstacleness(level - 1, (2 * row + down, 2 * column + right))
                for down in (0, 1)
                for right in (0, 1)
            ]
            assert share == pytest.approx(np.mean(children), abs=1e-6)


@given(blocked=floors, data=st.data())
def test_a_cell_lies_in_the_position_it_is_projected_on(blocked, data):
    tree = quad_tree(blocked)
    row = data.draw(st.integers(0, blocked.shape[0] - 1))
    column = data.draw(st.integers(0, blocked.shape[1] - 1))
    for level, grid in enumerate(tree.levels):
        i, j = tree.project((row, column), level)
        assert i * 2**level <= row < (i + 1) * 2**level
        assert j * 2**level <= column < (j + 1) * 2**level
        assert tree.obstacleness(level, (i, j)) == grid[i, j]


def test_off_the_map_all_is_blocked():
    tree = quad_tree(np.zeros((5, 3), bool))
    assert tree.obstacleness(0, (0, 3)) == 1.0
    assert tree.obstacleness(0, (-1, 0)) == 1.0
    assert tree.obstacleness(1, (2, 1)) == 0.75


@pytest.mark.parametrize(("shape", "levels"), [((1, 1), 1), ((1, 9), 5), ((8, 8), 4), ((3, 2), 3)])
def test_the_most_abstract_level_is_one_position(shape, levels):
    assert len(quad_tree(np.zeros(shape, bool)).levels) == levels


def test_the_levels_end_where_one_asks():
    tree = quad_tree(np.zeros((3, 2), bool), level_max=3)
    assert [grid.shape for grid in tree.levels] == [(3, 2), (2, 1), (1, 1), (1, 1)]
    assert tree.obstacleness(3, (0, 0)) == 1 - 6 / 64
    assert quad_tree(np.zeros((100, 2), bool), level_max=2).level_max == 2


def test_what_is_no_floor_is_refused():
    with pytest.raises(AnytimeError, match="2-D"):
        quad_tree(np.zeros(4, bool))
    with pytest.raises(AnytimeError, match="not empty"):
        quad_tree(np.zeros((0, 4), bool))
    with pytest.raises(AnytimeError, match="probabilities"):
        quad_tree(np.array([[0.5, np.nan]]))
    with pytest.raises(AnytimeError, match="level_max is -1"):
        quad_tree(np.zeros((4, 4), bool), level_max=-1)
    with pytest.raises(AnytimeError, match="from 0 to 2"):
        quad_tree(np.zeros((4, 4), bool)).obstacleness(3, (0, 0))
