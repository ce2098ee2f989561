"""A log of OMPL's benchmarks: in its rigid order, and read by its own tool."""

import importlib.util
import sqlite3
import subprocess
import sys
from types import SimpleNamespace

import pytest

import anytime
from anytime import AnytimeError, Machine, ProfileLibrary, WorkClock
from anytime.ompl_log import write_ompl_log

MACHINE = Machine("test bench").with_rate("find", 0.1).with_rate("see", 0.1)


@anytime.module(cost=lambda length: length)
def find(start):
    for length in 4.0, 2.0, 3.0:
        anytime.charge(1)
        if start > 0:
            yield length * start


@anytime.module(quality=lambda value: value)
def see(image):
    anytime.charge(1)
    yield image
    yield 1.0


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("ompl") / "ours.log"
    library = ProfileLibrary()
    for module, name in ((find, "start"), (see, "image")):
        problems = [SimpleNamespace(name=f"p{i}", **{name: i / 4}) for i in range(3)]
        clock = lambda: WorkClock(MACHINE)  # noqa: E731
        library = library.updated(anytime.measure(module, problems, seconds=1.0, clock=clock))
    write_ompl_log(library, path)
    return path


def test_it_says_what_it_holds_in_the_order_of_ompl(log):
    lines = log.read_text().splitlines()
    assert lines[0].startswith("anytime version ")
    assert lines[1:4] == ["Experiment anytime", "0 experiment properties", "Running on test-bench"]
    at = lines.index("find")
    columns = ["time REAL", "solved BOOLEAN", "quality REAL", "work REAL", "solution_cost REAL"]
    assert lines[at + 1 : at + 9] == [
        "0 common properties",
        "5 properties for each run",
        *columns,
        "3 runs",
    ]
    assert lines[at + 9 : at + 12] == [
        "0.3; 0; nan; 3; nan; ",
        "0.3; 1; 0.666666667; 3; 0.75; ",
        "0.3; 1; 0.666666667; 3; 1.5; ",
    ]
    assert lines[-1] == "."


def test_progress_is_the_profile_and_of_one_moment_the_last_result_stands(log):
    lines = log.read_text().splitlines()
    rows = lines[lines.index("see") + 1 :]
    at = rows.index("2 progress properties for each run")
    assert rows[at + 4] == "0.1,1,;"
    costs = lines[lines.index("3 progress properties for each run") + 5 :]
    assert costs[1] == "0.1,0.5,1,;0.2,1,0.5,;0.3,0.666666667,0.5,;"


def test_an_empty_library_is_refused(tmp_path):
    with pytest.raises(AnytimeError, match="the library is empty"):
        write_ompl_log(ProfileLibrary(), tmp_path / "ours.log")


@pytest.mark.skipif(not importlib.util.find_spec("ompl"), reason="ompl is not installed")
def test_the_tool_of_ompl_reads_it(log, tmp_path):
    database = tmp_path / "ours.db"
    tool = [sys.executable, "-m", "ompl.ompl_benchmark_statistics", str(log), "-d", str(database)]
    subprocess.run(tool, check=True, capture_output=True)
    with sqlite3.connect(database) as opened:
        assert opened.execute("SELECT count(*) FROM runs").fetchone() == (6,)
        assert opened.execute("SELECT sum(solved) FROM runs").fetchone() == (5,)
        best = "SELECT min(best_cost) FROM progress"
        assert opened.execute(best).fetchone() == (0.5,)
        planners = opened.execute("SELECT name FROM plannerConfigs ORDER BY name").fetchall()
    assert planners == [("find",), ("see",)]
