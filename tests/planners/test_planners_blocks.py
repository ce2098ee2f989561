"""Regions of blocks: exactly what hangs together, by flood fill as by words."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from planners.blocks import MOST, SIDE, UNKNOWN, new_regions, part
from planners.map_features import features
from planners.search import UNLIMITED
from sensing import clustered, maze, rooms, uniform


def regions_of(free):
    """Every region of a floor, as a set of cells, by words."""
    rows, columns = free.shape
    regions, cost = (
        new_regions(rows, columns),
        np.ascontiguousarray(free).view(np.uint8).reshape(-1),
    )
    across, found = -(-columns // SIDE), set()
    for block in range(regions.count.size):
        part(cost, 0, 1, columns, block, regions)
        top, left = block // across * SIDE, block % across * SIDE
        for k in range(regions.count[block]):
            mask = int(regions.mask[k * regions.count.size + block])
            bits = [bit for bit in range(SIDE * SIDE) if mask >> bit & 1]
            found.add(frozenset((top + bit // SIDE, left + bit % SIDE) for bit in bits))
    return found


@given(st.integers(0, 2**32), st.integers(1, 40), st.integers(1, 40), st.floats(0.0, 1.0))
@settings(max_examples=100)
def test_regions_are_what_hangs_together_within_a_block(seed, rows, columns, density):
    free = uniform((rows, columns), density, np.random.default_rng(seed))
    expected = set()
    for top in range(0, rows, SIDE):
        for left in range(0, columns, SIDE):
            labels, count = ndimage.label(free[top : top + SIDE, left : left + SIDE])
            for k in range(1, count + 1):
                cells = np.argwhere(labels == k) + np.array([top, left])
                expected.add(frozenset(map(tuple, cells.tolist())))
    assert regions_of(free) == expected


def test_a_checkerboard_fills_a_block_with_as_many_regions_as_it_can_hold():
    free = np.indices((8, 8)).sum(0) % 2 == 0
    assert len(regions_of(free)) == MOST < UNKNOWN


def test_clustering_tells_walls_from_independent_obstacles():
    rng = np.random.default_rng(0)
    kinds = {
        "independent": uniform(512, 0.3, rng),
        "rooms": rooms(512, rng),
        "clustered": clustered(512, 0.3, rng),
        "maze": maze(512, rng),
    }
    found = {}
    for name, free in kinds.items():
        cost = free.view(np.uint8).reshape(-1)
        density, clustering, cells = features(cost, 0, 1, 512, 64)
        assert abs(density - (~free).mean()) < 0.08
        assert cells <= UNLIMITED
        found[name] = clustering
    assert found["independent"] < 0.05
    assert min(found["rooms"], found["clustered"], found["maze"]) > 0.2


@pytest.mark.parametrize("size", [72, 128, 256, 512, 1024])
def test_walls_at_even_distances_are_neither_all_nor_none_of_what_is_looked_at(size):
    free = rooms(size, np.random.default_rng(0))
    density, clustering, _ = features(free.view(np.uint8).reshape(-1), 0, 1, size, 64)
    assert abs(density - (~free).mean()) < 0.02
    assert clustering > 0.2
