"""Maps: what they refuse, where their cells lie, where a robot may stand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anytime.errors import AnytimeError
from sensing import GridMap, map_folder, nearest_free, read_map


def test_a_map_can_not_be_changed():
    mine = np.ones((3, 4), bool)
    grid = GridMap(mine)
    mine[0, 0] = False
    assert grid.free.all()
    with pytest.raises(ValueError, match="read-only"):
        grid.free[0, 0] = False


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"free": np.ones(4, bool)}, "2-D"),
        ({"free": np.ones((0, 4), bool)}, "at least one row"),
        ({"free": np.ones((2, 2))}, "bool"),
        ({"free": np.ones((2, 2), bool), "unknown": np.zeros((2, 3), bool)}, "that of free"),
        ({"free": np.ones((2, 2), bool), "unknown": np.ones((2, 2), bool)}, "both free and"),
        ({"free": np.ones((2, 2), bool), "resolution": float("nan")}, "positive number"),
        ({"free": np.ones((2, 2), bool), "resolution": 0.0}, "positive number"),
        ({"free": np.ones((2, 2), bool), "origin": (0.0, float("inf"), 0.0)}, "finite"),
        ({"free": np.broadcast_to(np.True_, (10_000, 10_000))}, "at most"),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(arguments, complaint):
    with pytest.raises(AnytimeError, match=complaint) as caught:
        GridMap(**arguments)
    assert "\n" not in str(caught.value)


def test_cells_off_the_map_are_neither_on_it_nor_free():
    grid = GridMap(np.ones((3, 5), bool))
    assert grid.shape == (3, 5)
    assert grid.contains((2, 4))
    assert not grid.contains((3, 0))
    assert not grid.is_free((-1, 0))


@given(
    st.integers(0, 8),
    st.integers(0, 6),
    st.floats(0.01, 5),
    st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4)),
)
def test_a_cell_lies_where_its_middle_is(row, column, resolution, origin):
    grid = GridMap(np.ones((9, 7), bool), resolution=resolution, origin=origin)
    assert grid.cell_at(*grid.position_in_world((row, column))) == (row, column)


def test_the_lower_left_corner_is_the_origin():
    grid = GridMap(np.ones((10, 20), bool), resolution=0.5, origin=(3.0, 4.0, 0.0))
    assert grid.position_in_world((9, 0)) == (3.25, 4.25)
    assert grid.position_in_world((0, 0)) == (3.25, 8.75)


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**31), st.data())
def test_the_nearest_free_cell_is_nearest(rows, columns, seed, data):
    free = np.random.default_rng(seed).random((rows, columns)) < 0.1
    free[seed % rows, seed % columns] = True
    cell = data.draw(st.tuples(st.integers(0, rows - 1), st.integers(0, columns - 1)))
    found = nearest_free(free, cell)
    distances = [(r - cell[0]) ** 2 + (c - cell[1]) ** 2 for r, c in np.argwhere(free)]
    assert free[found]
    assert (found[0] - cell[0]) ** 2 + (found[1] - cell[1]) ** 2 == min(distances)


def test_a_map_without_free_cells_has_no_nearest_one():
    with pytest.raises(AnytimeError, match="no free cell"):
        GridMap(np.zeros((3, 3), bool)).nearest_free((1, 1))


def test_maps_are_equal_when_all_of_them_is():
    free = np.eye(3, dtype=bool)
    assert GridMap(free) == GridMap(free.copy())
    assert hash(GridMap(free)) == hash(GridMap(free.copy()))
    assert GridMap(free) != GridMap(~free)
    assert GridMap(free, ~free) != GridMap(free)
    assert GridMap(free) != "a map"


def test_a_map_tells_its_size_in_one_line():
    text = str(GridMap(np.ones((3, 5), bool), np.zeros((3, 5), bool), name="hall"))
    assert text == "hall: 3 x 5 cells of 1 m, 100% free, 0% unknown"


def test_a_file_that_is_no_map_is_named(tmp_path):
    with pytest.raises(AnytimeError, match=r"\.map \(MovingAI\) or \.yaml"):
        read_map(tmp_path / "plan.bmp")


def test_the_folder_of_maps_is_the_environments(tmp_path, monkeypatch):
    monkeypatch.setenv("ANYTIME_MAPS", str(tmp_path))
    assert map_folder() == tmp_path
    monkeypatch.setenv("ANYTIME_MAPS", str(tmp_path / "absent"))
    assert map_folder() is None
