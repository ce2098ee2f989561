"""Kernels that call those of another file know which version of it they were compiled with."""

import hashlib
import importlib
import re
from pathlib import Path

import pytest

import planners.query

FOLDER = Path(planners.query.__file__).parent
CALLER = re.compile(r"^CALLED = ", re.MULTILINE)
CALLEE = re.compile(r"^from planners\.query\.(header|choosing|varying) import", re.MULTILINE)
CALLERS = [path.stem for path in sorted(FOLDER.glob("*.py")) if CALLER.search(path.read_text())]


def called(name: str) -> set[str]:
    """The kernel files that a kernel file calls, and those that they call."""
    direct = set(CALLEE.findall((FOLDER / f"{name}.py").read_text()))
    return direct.union(*(called(other) for other in direct)) if direct else direct


def test_the_files_of_kernels_are_such_files():
    assert CALLERS == ["choosing", "genetics", "varying"]


@pytest.mark.parametrize("name", CALLERS)
def test_callers_state_the_digest_of_the_files_that_are_there(name):
    texts = b"".join((FOLDER / f"{each}.py").read_bytes() for each in sorted(called(name)))
    digest = hashlib.sha256(texts).hexdigest()[:12]
    stated = importlib.import_module(f"planners.query.{name}").CALLED
    assert stated == digest, f'set CALLED = "{digest}" in planners/query/{name}.py'
