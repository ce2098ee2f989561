"""Every row of the table of failures has a test, and every test that it names exists."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reliability.md"


def rows():
    """(row numbers, names of tests) of each line of the table."""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 6 and cells[1][:1].isdigit():
            yield cells[1], re.findall(r"`(test_\w+)`", cells[4])


@functools.cache
def written():
    """The names of all tests."""
    names = set()
    for file in (ROOT / "tests").rglob("test_*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                names.add(node.name)
    return names


@pytest.mark.parametrize(("row", "named"), rows())
def test_a_row_of_the_table_has_tests_that_exist(row, named):
    assert named, f"row {row} has no test"
    assert set(named) <= written()


def without():
    """The numbers of the rows that do not apply, each with its reason."""
    table = PAGE.read_text(encoding="utf-8").partition("| why it does not apply |")[2]
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 4 and cells[1].isdigit() and cells[2]:
            yield int(cells[1])


def test_every_failure_has_tests_or_a_reason_why_it_does_not_apply():
    tested = [int(number) for row, _ in rows() for number in row.split(",")]
    assert sorted([*tested, *without()]) == list(range(1, 73))
