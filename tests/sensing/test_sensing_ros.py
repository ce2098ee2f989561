"""ROS maps: what is written is read back, what is malformed is refused in one line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from anytime.errors import AnytimeError
from sensing import GridMap, map_folder, read_map, write_ros_map
from sensing.images import read_pgm, write_pgm

files = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
SETTINGS = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[-10.0, -10.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def write(folder, pixels=b"P5\n3 1\n255\n\x00\xcd\xfe", **changed):
    chosen = {**SETTINGS, **changed}
    text = "".join(f"{key}: {value}\n" for key, value in chosen.items() if value is not None)
    (folder / "map.yaml").write_text(text)
    (folder / "map.pgm").write_bytes(pixels)
    return folder / "map.yaml"


@files
@given(
    kinds=hnp.arrays(
        np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.integers(0, 2)
    ),
    resolution=st.floats(0.001, 10),
    origin=st.tuples(*[st.floats(-1e6, 1e6)] * 3),
)
def test_a_map_that_is_written_is_read_back(tmp_path, kinds, resolution, origin):
    unknown = kinds == 2
    grid = GridMap(kinds == 1, unknown if unknown.any() else None, resolution, origin, "plan")
    write_ros_map(grid, tmp_path / "plan.yaml")
    assert read_map(tmp_path / "plan.yaml") == grid


def test_the_name_of_a_file_may_be_long_and_have_spaces(tmp_path):
    place = tmp_path / ("the second floor of a building in the street " * 3 + ".yaml")
    grid = GridMap(np.array([[True, False]]), name=place.stem)
    write_ros_map(grid, place)
    assert read_map(place) == grid


def test_black_is_blocked_grey_unknown_white_free(tmp_path):
    grid = read_map(write(tmp_path))
    assert grid.free.tolist() == [[False, False, True]]
    assert grid.unknown is not None
    assert grid.unknown.tolist() == [[False, True, False]]
    assert grid.resolution == 0.05
    assert grid.origin == (-10.0, -10.0, 0.0)


def test_unknown_is_never_free_at_the_thresholds_of_nav2(tmp_path):
    assert read_map(write(tmp_path, free_thresh="0.25")).free.tolist() == [[False, False, True]]


def test_negate_swaps_black_and_white(tmp_path):
    grid = read_map(write(tmp_path, pixels=b"P5\n3 1\n255\n\x00\x80\xfe", negate="1"))
    assert grid.free.tolist() == [[True, False, False]]
    assert grid.unknown is not None
    assert grid.unknown.tolist() == [[False, True, False]]


def test_the_top_of_the_image_is_the_top_of_the_map(tmp_path):
    grid = read_map(write(tmp_path, pixels=b"P5\n1 2\n255\n\xfe\x00"))
    assert grid.free.tolist() == [[True], [False]]
    assert grid.position_in_world((0, 0))[1] > grid.position_in_world((1, 0))[1]


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"image": None}, "no 'image'"),
        ({"negate": None}, "no 'negate'"),
        ({"image": "absent.pgm"}, "no such image"),
        ({"image": "../map.pgm"}, ":1: image is '../map.pgm'; it must lie in the folder"),
        ({"image": "/etc/passwd"}, "must lie in the folder"),
        ({"image": "map.png"}, "must be a PGM"),
        ({"image": "[1]"}, "name of a PGM"),
        ({"resolution": "0"}, ":2: resolution is 0"),
        ({"resolution": ".nan"}, ":2: resolution is nan"),
        ({"resolution": ".inf"}, "resolution is inf"),
        ({"resolution": "fine"}, "resolution is 'fine'"),
        ({"resolution": "true"}, "resolution is True"),
        ({"origin": "[0, 0]"}, r":3: origin is \[0, 0\]; it must be \[x, y, yaw\]"),
        ({"origin": "[0, .nan, 0]"}, "three finite numbers"),
        ({"origin": "5"}, "must be"),
        ({"negate": "2"}, "negate is 2; it must be 0 or 1"),
        ({"negate": "[0]"}, "must be 0 or 1"),
        ({"occupied_thresh": "1.5"}, "occupied_thresh is 1.5"),
        ({"free_thresh": "0.7"}, "free_thresh is 0.7; it must be from 0 to occupied_thresh"),
        ({"mode": "scale"}, "mode is 'scale'; only trinary"),
        ({"mode": "raw"}, "only trinary"),
        ({"mode": "[" * 500}, "no yaml"),
        ({"mode": "!!python/object/apply:os.system [id]"}, ":7: no yaml"),
        ({"mode": "2001-99-99"}, "no yaml"),
        ({"mode": "{a: b"}, "no yaml"),
        ({"mode": "!!int ''"}, "no yaml"),
        ({"mode": "!!bool maybe"}, "no yaml"),
        ({"mode": "!!timestamp today"}, "no yaml"),
        ({"mode": "!<%0A> x"}, "no yaml"),
        ({"mode": "1" * 5000}, "no yaml"),
        ({"resolution": "1" * 4000}, "resolution is 111"),
        ({"resolution": "0x" + "f" * 5000}, "resolution is a number of thousands of digits"),
    ],
)
def test_wrong_settings_are_refused_in_one_line(tmp_path, changed, complaint):
    path = write(tmp_path, **changed)
    with pytest.raises(AnytimeError, match=complaint) as caught:
        read_map(path)
    assert len(str(caught.value).splitlines()) == 1


def test_a_nest_of_aliases_is_refused_before_it_unfolds(tmp_path):
    nest = "a0: &a0 [1, 1]\n"
    nest += "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30))
    path = write(tmp_path, origin=None, image=None)
    path.write_text(nest + path.read_text() + "origin: *a29\nimage: *a29\n")
    with pytest.raises(AnytimeError, match=r"origin is a list; it must be \[x, y, yaw\]"):
        read_map(path)


@pytest.mark.parametrize("content", [b"", b"text", b"- 1\n- 2\n", b"\x00\x01", b"a" * 100_000])
def test_a_file_without_settings_is_refused(tmp_path, content):
    path = tmp_path / "map.yaml"
    path.write_bytes(content)
    with pytest.raises(AnytimeError, match=r"map\.yaml"):
        read_map(path)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "does not begin as a PGM"),
        (b"P6\n1 1\n255\nabc", "does not begin as a PGM"),
        (b"\x89PNG\r\n\x1a\n", "does not begin as a PGM"),
        (b"P5\n0 4\n255\n", "at least one pixel"),
        (b"P5\n2147483648 1\n255\n", "does not begin"),
        (b"P5\n100000 100000\n255\n", "at most"),
        (b"P5\n1 1\n65535\n\x00\x00", "8 bits"),
        (b"P5\n1 1\n0\n\x00", "8 bits"),
        (b"P5\n2 2\n255\nabc", "cut short"),
        (b"P5\n2 2\n255\nabcde", "bytes follow the last pixel"),
        (b"P5\n2 2\n255\n" + bytes(10_000), "bytes follow a header"),
        (b"P5\n1 1\n100\n\xff", "a pixel is 255"),
        (b"P5\n2 2\n255abcde", "no white space"),
        (b"P2\n2 1\n255\n1 2 3", "3 pixels follow"),
        (b"P2\n2 1\n255\n1 -2", "no whole number"),
        (b"P2\n2 1\n255\n1 256", "a pixel is 256"),
    ],
)
def test_a_malformed_image_is_refused_in_one_line(tmp_path, content, complaint):
    path = tmp_path / "map.pgm"
    path.write_bytes(content)
    with pytest.raises(AnytimeError, match=complaint) as caught:
        read_pgm(path)
    assert len(str(caught.value).splitlines()) == 1


@files
@given(image=hnp.arrays(np.uint8, hnp.array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_an_image_that_is_written_is_read_back_plain_or_binary(tmp_path, image):
    write_pgm(image, tmp_path / "a.pgm")
    assert np.array_equal(read_pgm(tmp_path / "a.pgm"), image)
    rows, columns = image.shape
    pixels = " ".join(str(value) for value in image.ravel())
    (tmp_path / "b.pgm").write_text(f"P2 # plain\n{columns}\t{rows}\n# eight bits\n255\n{pixels}\n")
    assert np.array_equal(read_pgm(tmp_path / "b.pgm"), image)


def test_shades_are_scaled_to_the_brightest(tmp_path):
    (tmp_path / "a.pgm").write_bytes(b"P5 # two shades\n2 1\n# and a line more\n1\n\x00\x01")
    assert read_pgm(tmp_path / "a.pgm").tolist() == [[0, 255]]


GOOD = b"P5\n# map_saver\n3 2\n255\n\x00\xcd\xfe\x00\x00\xfe"


@files
@given(at=st.integers(0, len(GOOD) - 1), byte=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_image_is_read_or_refused_but_never_worse(tmp_path, at, byte, cut):
    path = tmp_path / "damaged.pgm"
    path.write_bytes(GOOD[:at] if cut else GOOD[:at] + bytes([byte]) + GOOD[at + 1 :])
    complaint = ""
    try:
        assert read_pgm(path).dtype == np.uint8
    except AnytimeError as error:
        complaint = str(error)
    assert len(complaint.splitlines()) <= 1


@files
@given(text=st.text(max_size=200))
def test_any_text_is_a_map_or_refused(tmp_path, text):
    path = tmp_path / "map.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(AnytimeError) as caught:
        read_map(path)
    assert len(str(caught.value).splitlines()) == 1


def test_the_public_maps_are_read():
    folder = map_folder()
    paths = sorted(folder.rglob("*.yaml")) if folder else []
    if not paths:
        pytest.skip("no public ROS maps: set ANYTIME_MAPS to their folder")
    for path in paths:
        grid = read_map(path)
        assert grid.resolution == 0.05
        assert 0.03 < grid.free_share < 0.95
