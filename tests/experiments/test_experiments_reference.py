"""All public names with what their docstrings say.

`docs/reference.md` is made of the sources by this file; run it to make the page anew.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference.md"
PACKAGES = ("anytime", "compiler", "monitor", "sensing", "planners", "planners.query")
HEAD = """# Reference

Every public name of the packages, with the beginning of its docstring; `help(name)` says the rest:
shapes, units, and the errors that are raised. Names are fetched when they are first asked for, so
an import costs little. The page is made of the sources by
`python tests/experiments/test_experiments_reference.py`.
"""

Definition = ast.FunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign


def imported(package: Path) -> Iterator[tuple[str, Path]]:
    """The public names of a package, each with the file that defines it."""
    stub = ast.parse((package / "__init__.pyi").read_text(encoding="utf-8"))
    for line in stub.body:
        if isinstance(line, ast.ImportFrom) and line.level:
            file = package.joinpath(*(line.module or "").split(".")).with_suffix(".py")
            yield from ((each.name, file) for each in line.names)


def defined(name: str, file: Path) -> tuple[Definition, str]:
    """The definition of a name in a file, and its docstring: that of a constant stands below it."""
    body = ast.parse(file.read_text(encoding="utf-8")).body
    for node, below in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return node, ast.get_docstring(node) or ""
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if any(isinstance(each, ast.Name) and each.id == name for each in targets):
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                return node, str(below.value.value)
            return node, ""
    raise LookupError(f"{file} has no {name}")


def called(function: ast.FunctionDef, *, bound: bool = False) -> str:
    """A call as the reader would write it, defaults as dots."""
    if any("property" in ast.unparse(each) for each in function.decorator_list):
        return function.name
    given = function.args
    needed = len(given.posonlyargs + given.args) - len(given.defaults)
    words = [
        each.arg + "=…" * (place >= needed)
        for place, each in enumerate(given.posonlyargs + given.args)
    ]
    static = any(ast.unparse(each) == "staticmethod" for each in function.decorator_list)
    words = words[1:] if bound and not static else words
    if given.vararg:
        words.append(f"*{given.vararg.arg}")
    elif given.kwonlyargs:
        words.append("*")
    for each, default in zip(given.kwonlyargs, given.kw_defaults, strict=True):
        words.append(each.arg + "=…" * (default is not None))
    words += [f"**{given.kwarg.arg}"] if given.kwarg else []
    return f"{function.name}({', '.join(words)})"


def row(name: str, docstring: str) -> str:
    """A name with the first paragraph of its docstring."""
    told = " ".join(docstring.split("\n\n")[0].split()).replace("A*", r"A\*")
    return f"`{name}`: {told}" if told else f"`{name}`"


def page() -> str:
    lines = [HEAD]
    for package in PACKAGES:
        lines += [f"## {package}", ""]
        for name, file in sorted(imported(ROOT.joinpath(*package.split(".")))):
            node, told = defined(name, file)
            shown = called(node) if isinstance(node, ast.FunctionDef) else name
            lines.append(f"- {row(shown, told)}")
            for each in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
                    told = ast.get_docstring(each) or ""
                    lines.append(f"  - {row(called(each, bound=True), told)}")
        lines.append("")
    return "\n".join(lines)


def test_the_page_is_what_the_sources_say():
    assert PAGE.read_text(encoding="utf-8") == page(), "run this file to make the page anew"


def test_every_public_name_says_what_it_is():
    names = [line for line in page().splitlines() if line.startswith("- ")]
    assert [name for name in names if ": " not in name] == []


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
