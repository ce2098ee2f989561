"""The layout: what imports what, what the wheel holds, and what hides it."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("anytime", "compiler", "monitor", "planners", "sensing", "experiments")
CONTENTS = ("anytime", "compiler", "monitor", "planners", "planners.query", "sensing")


def python(code: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run code in a fresh interpreter, in a folder, with our packages behind that folder."""
    return subprocess.run(
        [sys.executable, *arguments, "-c", code],
        cwd=folder,
        env={"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


def test_the_generic_side_imports_numpy_and_small_packages_alone(tmp_path):
    heavy = ("scipy", "numba", "cv2", "matplotlib", "pymunk", "tqdm", "yaml")
    code = (
        "import sys; from anytime import *; from compiler import *\n"
        f"print([name for name in {heavy!r} if name in sys.modules])\n"
        "print([n for n in ('monitor', 'sensing', 'planners', 'experiments') if n in sys.modules])"
    )
    ran = python(code, tmp_path)
    assert ran.stdout.split("\n")[:2] == ["[]", "[]"], ran.stdout + ran.stderr


@pytest.mark.parametrize("name", ["monitor", "compiler", "planners", "sensing", "experiments"])
def test_a_users_file_that_hides_a_package_ends_with_one_line(tmp_path, name):
    (tmp_path / f"{name}.py").write_text("value = 1\n")
    ran = python("import anytime", tmp_path)
    assert ran.returncode == 2
    assert ran.stdout == ""
    assert len(ran.stderr.splitlines()) == 1
    assert f"{name}.py hides our package {name!r}; rename it" in ran.stderr


def test_other_files_of_the_user_hide_nothing(tmp_path):
    (tmp_path / "monitors.py").write_text("value = 1\n")
    (tmp_path / "see.py").write_text("value = 1\n")
    ran = python("import anytime, compiler; print(anytime.run.__name__)", tmp_path)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "run\n", "")


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_imported_without_what_it_holds(tmp_path, package):
    code = f"import sys, {package}; print([n for n in ('numpy', 'numba') if n in sys.modules])"
    ran = python(code, tmp_path)
    assert ran.stdout == "[]\n", ran.stdout + ran.stderr


@pytest.mark.parametrize("name", CONTENTS)
def test_the_public_names_are_those_of_the_contents(name):
    package = importlib.import_module(name)
    contents = ast.parse((ROOT / name.replace(".", "/") / "__init__.pyi").read_text())
    (listed,) = (ast.literal_eval(part.value) for part in contents.body if is_all(part))
    assert sorted(listed) == sorted(set(package.__all__))
    assert all((getattr(package, public).__doc__ or "").strip() for public in listed)


@pytest.mark.parametrize("name", CONTENTS)
def test_no_public_name_is_that_of_a_file_beside_it(name):
    """Importing the file would put it in the name's place."""
    beside = {path.stem for path in (ROOT / name.replace(".", "/")).iterdir()}
    assert beside.isdisjoint(importlib.import_module(name).__all__)


def is_all(part: ast.stmt) -> bool:
    return isinstance(part, ast.Assign) and ast.unparse(part.targets[0]) == "__all__"


def test_imports_point_down():
    pytest.importorskip("importlinter")
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]
    if not command[0].exists():
        pytest.skip("lint-imports is not beside this Python")
    ran = subprocess.run(
        [*map(str, command)], cwd=ROOT, capture_output=True, text=True, timeout=100, check=False
    )
    assert ran.returncode == 0, ran.stdout
    assert "0 broken" in ran.stdout


def test_nothing_asks_for_the_time_of_day():
    """It jumps: by a day when a robot finds the network. `perf_counter` and `monotonic` do not."""
    told = re.compile(r"\b(time\.time(_ns)?|(datetime|date)\.(now|utcnow|today))\b")
    asked = [
        f"{file.relative_to(ROOT)}: {found[0]}"
        for package in PACKAGES
        for file in (ROOT / package).rglob("*.py")
        if (found := told.search(file.read_text(encoding="utf-8")))
    ]
    assert asked == []


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The names in the wheel, built by its own backend."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    ran = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    (built,) = folder.glob("*.whl")
    return set(zipfile.ZipFile(built).namelist())


def test_the_wheel_holds_every_source_file_and_says_that_it_is_typed(wheel):
    for package in PACKAGES:
        assert f"{package}/py.typed" in wheel
        sources = {str(path.relative_to(ROOT)) for path in (ROOT / package).rglob("*.py*")}
        sources = {name for name in sources if "__pycache__" not in name}
        assert sources <= wheel


def test_the_wheel_holds_the_shipped_data_and_the_page(wheel):
    folders = (ROOT / "experiments" / "data", ROOT / "monitor" / "page")
    shipped = [p for folder in folders for p in folder.rglob("*") if p.is_file()]
    names = {str(p.relative_to(ROOT)) for p in shipped if "__pycache__" not in p.parts}
    assert len(names) > 5
    assert names <= wheel


def test_the_wheel_holds_nothing_else(wheel):
    tops = {name.split("/")[0] for name in wheel if ".dist-info/" not in name}
    assert tops == set(PACKAGES)
    unwanted = (".nbc", ".nbi", ".pyc", ".jsonl", ".tmp")
    assert not [name for name in wheel if name.endswith(unwanted) or "/tests/" in name]


def test_no_file_bears_the_name_of_the_standard_library_or_of_a_drawer():
    drawers = {"utils", "helpers", "common", "misc", "tools"}
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            assert path.stem not in drawers, path
            assert path.stem not in sys.stdlib_module_names or path.stem.startswith("__"), path
