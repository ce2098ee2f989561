"""Kernels that call those of another file know which version of it they were compiled with."""

import hashlib
import re
from pathlib import Path

import pytest

import planners

FOLDER = Path(planners.__file__).parent
CALLEES = {
    "search",
    "frontier",
    "windows",
    "blocks",
    "region_search",
    "refining",
    "improving",
    "norms",
    "prefetching",
    "tracing",
}
CALLEES |= {"query.header", "query.choosing", "query.varying"}
IMPORT = re.compile(r"^from planners\.([a-z_.]+) import", re.MULTILINE)
STATED = re.compile(r'^CALLED = "(\w*)"', re.MULTILINE)


def text(name: str) -> str:
    return FOLDER.joinpath(*name.split(".")).with_suffix(".py").read_text()


def called(name: str) -> set[str]:
    """The files whose kernels and constants a file's kernels use, and those that they use."""
    direct = CALLEES.intersection(IMPORT.findall(text(name)))
    return direct.union(*(called(other) for other in direct))


def with_kernels() -> list[str]:
    paths = (path.relative_to(FOLDER).with_suffix("") for path in FOLDER.rglob("*.py"))
    names = sorted(".".join(path.parts) for path in paths)
    return [name for name in names if "@njit(cache=True" in text(name)]


CALLERS = [name for name in with_kernels() if called(name)]


def test_there_are_such_files():
    assert {"ara", "improving", "region_search", "tracing", "windows", "query.genetics"} <= set(
        CALLERS
    )


@pytest.mark.parametrize("name", CALLERS)
def test_a_file_states_the_digest_of_the_files_that_its_kernels_use(name):
    digest = hashlib.sha256("".join(map(text, sorted(called(name)))).encode()).hexdigest()[:12]
    stated = STATED.findall(text(name))
    assert stated == [digest], f'set CALLED = "{digest}" in planners/{name}.py'
