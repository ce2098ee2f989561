"""MovingAI files: what is written is read back, what is malformed is refused in one line."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from anytime.errors import AnytimeError
from sensing import (
    GridMap,
    Scenario,
    connected,
    map_folder,
    read_map,
    read_scenarios,
    write_movingai,
    write_scenarios,
)

files = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
GOOD = b"type octile\nheight 2\nwidth 3\nmap\n..@\nGST\n"


def scenario_text(*lines: str, version: str = "version 1") -> str:
    return "\n".join([version, *lines]) + "\n"


@files
@given(free=hnp.arrays(bool, hnp.array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=20)))
def test_a_map_that_is_written_is_read_back(tmp_path, free):
    grid = GridMap(free, name="map")
    write_movingai(grid, tmp_path / "map.map")
    assert read_map(tmp_path / "map.map") == grid


def test_every_glyph_means_what_the_benchmark_says(tmp_path):
    path = tmp_path / "glyphs.map"
    path.write_bytes(b"type octile\nheight 1\nwidth 7\nmap\n.GS@OTW\n")
    assert read_map(path).free.tolist() == [[True] * 3 + [False] * 4]


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_line_ends_do_not_matter(tmp_path, end):
    path = tmp_path / "a.map"
    path.write_bytes(GOOD.replace(b"\n", end))
    assert read_map(path).free.tolist() == [[True, True, False], [True, True, False]]
    path.write_bytes(GOOD.replace(b"\n", end).rstrip())
    assert read_map(path).shape == (2, 3)


MALFORMED = {
    "empty": (b"", "1: '';"),
    "another type": (b"type tile\n", "1: 'type tile'"),
    "byte order mark": (b"\xef\xbb\xbf" + GOOD, "1: .*byte order mark"),
    "binary": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "1: .*ASCII"),
    "zeros": (bytes(1000), "1: "),
    "no width": (b"type octile\nheight 2\nheight 3\nmap\n", "3: .*'width N'"),
    "no map": (GOOD.replace(b"map\n", b"mop\n"), "4: 'mop'"),
    "negative": (GOOD.replace(b"height 2", b"height -2"), "2: height is '-2'"),
    "zero": (GOOD.replace(b"height 2", b"height 0"), "2: height is '0'"),
    "fraction": (GOOD.replace(b"height 2", b"height 2.5"), "2: height is '2.5'"),
    "many digits": (GOOD.replace(b"height 2", b"height " + b"9" * 200), "2: height is"),
    "huge": (GOOD.replace(b"2", b"100000").replace(b"3", b"100000"), "3: .*at most"),
    "too few rows": (GOOD[:-4], "4: .*only 4 bytes"),
    "fewer rows, longer": (b"type octile\nheight 2\nwidth 3\nmap\n.......\n", "5: the row has 7"),
    "too many rows": (GOOD + b"...\n", "7: the map has 3 rows; the header says height 2"),
    "far too many rows": (GOOD + b"...\n" * 3000, "4: .*bytes follow"),
    "short row": (b"type octile\nheight 2\nwidth 3\nmap\n..\n....\n", "5: the row has 2 cells"),
    "long row": (b"type octile\nheight 2\nwidth 3\nmap\n...\n....\n", "6: the row has 4 cells"),
    "unknown glyph": (GOOD.replace(b"GST", b"G?T"), r"6: column 2 holds '\?'"),
}


@pytest.mark.parametrize("kind", MALFORMED)
def test_a_malformed_map_is_refused_with_file_and_line(tmp_path, kind):
    content, complaint = MALFORMED[kind]
    path = tmp_path / "bad.map"
    path.write_bytes(content)
    with pytest.raises(AnytimeError, match="^" + re.escape(str(path)) + ":" + complaint) as caught:
        read_map(path)
    assert len(str(caught.value).splitlines()) == 1


@files
@given(at=st.integers(0, len(GOOD) - 1), byte=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_map_is_read_or_refused_but_never_worse(tmp_path, at, byte, cut):
    path = tmp_path / "damaged.map"
    path.write_bytes(GOOD[:at] if cut else GOOD[:at] + bytes([byte]) + GOOD[at + 1 :])
    complaint = ""
    try:
        grid = read_map(path)
    except AnytimeError as error:
        complaint = str(error)
    else:
        assert grid.free.size == grid.shape[0] * grid.shape[1]
    assert len(complaint.splitlines()) <= 1


def test_a_missing_map_is_named(tmp_path):
    with pytest.raises(AnytimeError, match="no such file"):
        read_map(tmp_path / "absent.map")
    (tmp_path / "folder.map").mkdir()
    with pytest.raises(AnytimeError, match="no plain file"):
        read_map(tmp_path / "folder.map")


scenarios = st.builds(
    lambda bucket, name, width, height, cells, length: Scenario(
        bucket,
        name,
        width,
        height,
        (cells[0] % height, cells[1] % width),
        (cells[2] % height, cells[3] % width),
        length,
    ),
    st.integers(0, 1000),
    st.from_regex(r"[a-z]{1,8}(/[a-z ]{1,8}[a-z])?\.map", fullmatch=True),
    st.integers(1, 600),
    st.integers(1, 600),
    st.tuples(*[st.integers(0, 10**6)] * 4),
    st.floats(0, 1e6),
)


@files
@given(queries=st.lists(scenarios, max_size=5))
def test_scenarios_that_are_written_are_read_back(tmp_path, queries):
    write_scenarios(queries, tmp_path / "a.scen")
    assert read_scenarios(tmp_path / "a.scen") == tuple(queries)


@pytest.mark.parametrize(
    ("line", "version"),
    [
        ("61\tmaps/bgmaps/AR.map\t5\t4\t2\t3\t4\t1\t2.83", "version 1"),
        ("61 maps/bgmaps/AR.map 5 4 2 3 4 1 2.83", "version 1.0"),
        ("61\tmaps/bgmaps/AR.map\t5\t4\t2\t3\t4\t1\t2.83\r", "version 1\r"),
    ],
)
def test_x_is_the_column_and_either_version_is_read(tmp_path, line, version):
    path = tmp_path / "a.scen"
    path.write_text(scenario_text(line, version=version), newline="\n")
    assert read_scenarios(path) == (Scenario(61, "maps/bgmaps/AR.map", 5, 4, (3, 2), (1, 4), 2.83),)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("", "1: .*version 1"),
        ("version 2\n", "1: .*'version 2'"),
        ("\ufeffversion 1\n", "1: .*byte order mark"),
        (scenario_text("0\ta.map\t5\t4\t2\t3\t4\t1"), "2: 8 columns"),
        (scenario_text("0\ta.map\t5\t4\t2\t-3\t4\t1\t2"), "2: start y is '-3'"),
        (scenario_text("0\ta.map\t5\t4\t5\t3\t4\t1\t2"), "2: start x 5, y 3 lies off"),
        (scenario_text("", "0\ta.map\t5\t4\t2\t3\t4\t4\t2"), "3: goal x 4, y 4 lies off"),
        (scenario_text("0\ta.map\t5\t4\t2\t3\t4\t1\tnan"), "2: the optimum is 'nan'"),
        (scenario_text("0\ta.map\t5\t4\t2\t3\t4\t1\tx"), "2: the optimum is 'x'"),
    ],
)
def test_a_malformed_scenario_is_refused_with_file_and_line(tmp_path, content, complaint):
    path = tmp_path / "bad.scen"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(AnytimeError, match="^" + re.escape(str(path)) + ":" + complaint):
        read_scenarios(path)


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "bad.scen"
    path.write_bytes(b"version 1\n\xff\xfa\n")
    with pytest.raises(AnytimeError, match=r":2: .*no text"):
        read_scenarios(path)


def test_a_scenario_for_another_map_is_refused_not_scaled(tmp_path):
    path = tmp_path / "a.scen"
    path.write_text(scenario_text("0\ta.map\t512\t512\t2\t3\t4\t1\t2.83"))
    with pytest.raises(AnytimeError, match=r"512 wide.*256 wide"):
        read_scenarios(path, GridMap(np.ones((256, 256), bool)))
    with pytest.raises(AnytimeError, match="start x 2, y 3 is blocked"):
        read_scenarios(path, GridMap(np.zeros((512, 512), bool)))


def test_the_public_maps_and_their_queries_are_read():
    folder = map_folder()
    if folder is None:
        pytest.skip("no public maps: set ANYTIME_MAPS to their folder")
    maps = sorted(folder.rglob("*.map"))
    if not maps:
        pytest.skip(f"no .map file below {folder}")
    for path in maps:
        grid = read_map(path)
        queries = read_scenarios(f"{path}.scen", grid)
        assert queries
        for query in queries[:: max(len(queries) // 3, 1)]:
            assert connected(grid.free, query.start, query.goal)
