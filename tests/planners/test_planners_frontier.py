"""Kernels that call those of another file know which version of it they were compiled with."""

import hashlib
import importlib
from pathlib import Path

import pytest

import planners

FOLDER = Path(planners.__file__).parent
CALLERS = [
    path.stem
    for path in sorted(FOLDER.glob("*.py"))
    if "njit" in (text := path.read_text()) and "from planners.frontier import" in text
]


def test_there_are_such_files():
    assert {"ara", "blocks", "improving", "windows"} <= set(CALLERS)


@pytest.mark.parametrize("name", CALLERS)
def test_callers_state_the_digest_of_the_frontier_that_is_there(name):
    digest = hashlib.sha256((FOLDER / "frontier.py").read_bytes()).hexdigest()[:12]
    stated = importlib.import_module(f"planners.{name}").FRONTIER
    assert stated == digest, f'set FRONTIER = "{digest}" in planners/{name}.py'
