"""The C and C++ of the page on exporting compiles with the header that its Python writes."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
STRICT = ["-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow"]


def blocks(language):
    return [block for found, block in FENCE.findall(PAGE) if found == language]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the page's Python has been run and its C++ lies in files of the names it gives."""
    place = tmp_path_factory.mktemp("export")
    namespace = ModuleType("page_export")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.setitem(sys.modules, namespace.__name__, namespace)
        for block in blocks("python"):
            exec(block, namespace.__dict__)
    for block in blocks("cpp"):
        name = re.match(r"// (\w+\.cpp)\n", block)
        assert name, "a C++ block begins with the name of its file"
        (place / name[1]).write_text(block)
    return place


def compiler(*arguments, folder):
    ran = subprocess.run(arguments, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_the_control_loop_compiles_and_runs(folder):
    compiler("g++", "-std=c++17", *STRICT, "control_loop.cpp", "-o", "loop", folder=folder)
    ran = subprocess.run([folder / "loop"], capture_output=True, text=True, check=True)
    turns = ran.stdout.splitlines()
    assert len(turns) == 3
    assert all(turn.startswith("4 m, expected quality 0.") for turn in turns)


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")
def test_the_node_of_a_behaviour_tree_compiles(folder):
    lab = ROOT / "tests" / "lab"
    arguments = ["-std=c++17", *STRICT, "-I", str(lab), "-fsyntax-only", "divide_time.cpp"]
    compiler("g++", *arguments, folder=folder)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")
def test_the_header_declares_what_the_page_shows(folder):
    (shown,) = blocks("c")
    header = (folder / "fetch.h").read_text()
    struct, function = shown.strip().split("\n\n")
    assert struct in header
    assert function.removesuffix(";") in header
    (folder / "plain.c").write_text('#include "fetch.h"\n')
    compiler("gcc", "-std=c99", *STRICT, "-fsyntax-only", "plain.c", folder=folder)


def test_the_tree_gives_each_node_the_ports_that_it_has():
    (tree,) = blocks("xml")
    (node,) = [block for block in blocks("cpp") if "DivideTime" in block]
    ports = set(re.findall(r'Port<\w+>\("(\w+)"\)', node))
    (given,) = re.findall(r"<DivideTime (.*?)/>", tree)
    assert set(re.findall(r"(\w+)=", given)) == ports
