"""Packages of others: the example in docs/ is installed and used, broken ones are passed over."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "example_package"


def run(folder: Path, *arguments: str, site: Path) -> subprocess.CompletedProcess[str]:
    """A command in a fresh Python that finds what is installed at `site`."""
    path = os.pathsep.join([str(site), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with the example installed in it by pip."""
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("site")
    source = tmp_path_factory.mktemp("source") / "package"
    shutil.copytree(EXAMPLE, source)
    plain = ("--no-deps", "--no-build-isolation", "--no-index", "--quiet")
    where = ("--target", str(folder), str(source))
    made = subprocess.run(
        [sys.executable, "-m", "pip", "install", *plain, *where], capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr
    return folder


def test_the_example_adds_its_command(site, tmp_path):
    ran = run(tmp_path, "-m", "anytime", "tour", "--seed", "3", site=site)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.rstrip().endswith(" m")


def test_the_module_of_the_example_is_found_by_its_name(site, tmp_path):
    asked = ("shorten", "--runs", "3", "--seconds", "0.02", "--library", "kept")
    ran = run(tmp_path, "-m", "anytime", "profile", *asked, site=site)
    assert ran.returncode == 0, ran.stderr
    assert "shorten" in ran.stdout
    assert (tmp_path / "kept" / "shorten.profile").exists()


def test_the_tests_of_the_example_pass(site, tmp_path):
    file = EXAMPLE / "tests" / "test_shortening.py"
    asked = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(file))
    ran = run(tmp_path, *asked, site=site)
    assert ran.returncode == 0, ran.stdout
    assert "8 passed" in ran.stdout


def broken(folder: Path, name: str, content: str) -> Path:
    """A package whose module and command are in one file with this content."""
    (folder / f"{name}.py").write_text(content)
    info = folder / f"{name}-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        f"[anytime.modules]\n{name} = {name}:module\n[anytime.commands]\n{name} = {name}\n"
    )
    return folder


@pytest.mark.parametrize(
    "content",
    [
        "def declare(commands): raise RuntimeError('two\\nlines')",
        "this is no Python",
        "def declare(commands): commands.add_parser('profile')",
    ],
)
def test_a_broken_package_is_reported_in_one_line_and_passed_over(tmp_path, content):
    folder = broken(tmp_path, "quack", content)
    ran = run(tmp_path, "-m", "anytime", "library", "--library", str(ROOT / "none"), site=folder)
    told = ran.stderr.strip().splitlines()
    assert ran.returncode == 2
    assert len(told) == 2
    assert "commands of 'quack' of quack are left out" in told[0]
    assert "no such folder" in told[1]
    ran = run(tmp_path, "-m", "anytime", "profile", "quack", site=folder)
    assert ran.returncode == 2
    assert "Traceback" not in ran.stderr
    assert "'quack' of quack cannot be loaded" in ran.stderr
