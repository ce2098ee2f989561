"""The pages say what is so: their Python runs and prints what they show, their links lead on."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), *sorted(ROOT.glob("*.md"))]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
SCRIPT = "import anytime, compiler\nfrom my_lab"  # of the README; it has a test of its own


def shape(text: str) -> list[list[str]]:
    """The words of each line without its figures, which another machine may round otherwise."""
    plain = re.sub(r"[-+]?\d*\.?\d+( [mµ]?s\b)?|[▁▂▃▄▅▆▇█]+", "#", text)
    return [line.split() for line in plain.strip().splitlines()]


def alike(drawn: str, shown: str) -> bool:
    """Whether two pictures differ by rounding at most: by two of their points anywhere."""
    number = r"-?\d+\.?\d*"
    places = [[float(each) for each in re.findall(number, svg)] for svg in (drawn, shown)]
    same = re.sub(number, "#", drawn) == re.sub(number, "#", shown)
    return same and all(abs(a - b) <= 2 for a, b in zip(*places, strict=True))


def has_what_it_needs(block: str) -> bool:
    """Whether the package is installed that a block needs by its first line, `# needs NAME`."""
    needed = re.match(r"# needs (\w+)\n", block)
    return needed is None or importlib.util.find_spec(needed[1]) is not None


def anchors(page: Path) -> set[str]:
    """The headings of a page as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", text.lower()).replace(" ", "-") for text in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_runs_from_top_to_bottom_and_prints_what_it_shows(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    namespace = ModuleType(f"page_{page.stem}")  # dataclasses look their module up
    monkeypatch.setitem(sys.modules, namespace.__name__, namespace)
    text, printed = page.read_text(encoding="utf-8"), ""
    for fence in FENCE.finditer(text):
        language, block = fence.groups()
        if language == "python" and not block.startswith(SCRIPT) and has_what_it_needs(block):
            above = text[: fence.start(2)].count("\n")
            exec(compile("\n" * above + block, str(page), "exec"), namespace.__dict__)
            printed = capsys.readouterr().out
        elif language == "text":
            assert shape(printed) == shape(block), printed
        elif language == "toml" and block.startswith("# "):
            (tmp_path / block.splitlines()[0].removeprefix("# ")).write_text(block)
    for drawn in tmp_path.glob("gallery-*.svg"):
        assert alike(drawn.read_text(), (page.parent / "figures" / drawn.name).read_text()), drawn


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_of_a_page_lead_somewhere(page):
    for file, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        if ":" in file:
            continue
        target = page.parent / file if file else page
        assert target.exists(), f"{page.name} links to {file}"
        assert not anchor or anchor in anchors(target), f"{page.name} links to {file}#{anchor}"
