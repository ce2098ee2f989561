"""Programs with one thing changed: a comparison, an operator, a constant, a bound.

What tests are worth shows in how many of them they notice.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import CodeType
from typing import Any

_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
}
_NAMES = {"min": "max", "minimum": "maximum", "argmin": "argmax", "any": "all", "floor": "ceil"}
_NAMES |= {other: name for name, other in _NAMES.items()}

Change = tuple[str, Callable[[], None], Callable[[], None]]
"""What is changed, in words; do it; undo it."""


@dataclass(frozen=True)
class Mutant:
    """A module with one change. text: of the line that is changed."""

    line: int
    text: str
    change: str
    code: CodeType


def mutants(source: str, path: str) -> Iterator[Mutant]:
    """Every program that differs from this one in one place; what is said in words or types stays.

    source: of a module. path: of its file.
    """
    tree, lines = ast.parse(source), source.splitlines()
    for node in _places(tree):
        for told, change, undo in _changes(node):
            change()
            text = lines[node.lineno - 1].strip()
            yield Mutant(node.lineno, text, told, compile(tree, path, "exec"))
            undo()


def _places(node: ast.AST) -> Iterator[Any]:
    """The nodes that compute: none in annotations, errors, texts, decorators, assertions."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
        return
    if isinstance(node, ast.Assert) or (isinstance(node, ast.keyword) and node.arg == "strict"):
        return  # zip(…, strict=True) asserts that all are of one length
    if isinstance(node, ast.Compare | ast.BinOp | ast.AugAssign | ast.BoolOp | ast.UnaryOp):
        yield node
    if isinstance(node, ast.Constant | ast.Name | ast.Attribute):
        yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _places(child)


def _changes(node: Any) -> Iterator[Change]:
    if isinstance(node, ast.Compare):
        for index, operator in enumerate(node.ops):
            yield _swap(node.ops, index, operator, _COMPARISONS[type(operator)]())
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in _OPERATORS:
        yield _put(node, "op", _OPERATORS[type(node.op)]())
    elif isinstance(node, ast.BoolOp):
        yield _put(node, "op", ast.Or() if isinstance(node.op, ast.And) else ast.And())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        plus = ast.UAdd()
        if isinstance(node.op, ast.USub):
            yield _put(node, "op", plus)
        else:
            yield _put(node, "operand", ast.UnaryOp(ast.Not(), node.operand))
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield _put(node, "value", not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield _put(node, "value", node.value + 1)
    elif isinstance(node, ast.Name) and node.id in _NAMES and isinstance(node.ctx, ast.Load):
        yield _put(node, "id", _NAMES[node.id])
    elif isinstance(node, ast.Attribute) and node.attr in _NAMES:
        yield _put(node, "attr", _NAMES[node.attr])


def _put(node: Any, name: str, new: Any) -> Change:
    old = getattr(node, name)
    if isinstance(new, ast.AST):
        ast.fix_missing_locations(ast.copy_location(new, node))
    return (
        f"{_word(old)} → {_word(new)}",
        lambda: setattr(node, name, new),
        lambda: setattr(node, name, old),
    )


def _swap(holder: list[Any], index: int, old: Any, new: Any) -> Change:
    return (
        f"{_word(old)} → {_word(new)}",
        lambda: holder.__setitem__(index, new),
        lambda: holder.__setitem__(index, old),
    )


def _word(thing: Any) -> str:
    return type(thing).__name__ if isinstance(thing, ast.AST) else str(thing)
