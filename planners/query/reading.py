"""A model's text, read: its sources, the functions it calls, and what has no native form."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NoReturn

import numpy as np

from planners.query import arithmetic
from planners.query.choosing import KINDS
from planners.query.errors import ModelError, NativeError

PATH = "at"
"""The method of `rng` that goes down a path."""

_BUILTINS = {"abs", "bool", "enumerate", "float", "len", "range", "zip"}
_REBUILT = {"int", "max", "min", "round"}
_SILENT = {"print", "breakpoint"}
"""Calls that the native form leaves out."""

_CHANGES = ("append", "clear", "extend", "fill", "insert", "pop", "remove", "reverse", "sort")
_SUMS = ("cumprod", "cumsum", "dot", "mean", "prod", "std", "sum", "trace", "var")
"""Methods of arrays that add or multiply in another order natively."""

_INSTEAD = {
    "hypot": "math.sqrt(x * x + y * y)",
    "dist": "math.sqrt of the squares",
    "pow": "x * x, or math.exp(y * math.log(x))",
    "sum": "a loop that adds",
}


@dataclass(frozen=True)
class Function:
    """One function of a model, read: its text without prints, and what its names stand for."""

    tree: ast.FunctionDef
    original: Callable[..., Any]
    file: str
    constants: dict[str, Any]
    calls: dict[str, Callable[..., Any]]
    modules: dict[str, ModuleType]


@dataclass(frozen=True)
class Text:
    """A model read for its native form: its functions, the model's own last, and its sources."""

    functions: tuple[Function, ...]
    sources: dict[str, str]  # name -> kind, in the order of the text
    paths: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The sources, then the paths; their places are their numbers."""
        return (*self.sources, *(path for path in self.paths if path not in self.sources))


def read(function: Callable[..., Any]) -> Text:
    """Read a model and the functions that it calls.

    Raises ModelError if a source is asked for two distributions, NativeError with the line and the
    way out for what has no native form.
    """
    functions: dict[int, Function] = {}
    sources: dict[str, str] = {}
    paths: list[str] = []
    _read(function, functions, sources, paths, ())
    return Text(tuple(functions.values()), sources, tuple(dict.fromkeys(paths)))


def plain_function(found: Any) -> Callable[..., Any] | None:
    """The Python function behind a name, or None: a function, a model, or what numba compiles."""
    found = getattr(found, "function", getattr(found, "py_func", found))
    return found if inspect.isfunction(found) else None


def _read(
    function: Callable[..., Any],
    functions: dict[int, Function],
    sources: dict[str, str],
    paths: list[str],
    callers: tuple[int, ...],
) -> None:
    if id(function) in functions:
        return
    if id(function) in callers:
        raise NativeError(
            f"{function.__name__} calls itself, which has no native form; use a loop, or "
            "Query(…, native=False)"
        )
    tree, file = _parsed(function)
    known = _names(function)
    checker = _Checker(function.__name__, file, known, sources, paths)
    if not callers:
        checker.choosing.add(function.__code__.co_varnames[0])
    tree = checker.visit(tree)
    for called in checker.calls.values():
        _read(called, functions, sources, paths, (*callers, id(function)))
    functions[id(function)] = Function(
        tree, function, file, checker.constants, checker.calls, checker.modules
    )


def _parsed(function: Callable[..., Any]) -> tuple[ast.FunctionDef, str]:
    if hasattr(function, "__wrapped__"):
        raise NativeError(
            f"{function.__name__} is decorated, and what its decorator does would be left out "
            "natively; call what it does by name, or use Query(…, native=False)"
        )
    try:
        lines, first = inspect.getsourcelines(function)
        file = inspect.getsourcefile(function) or "?"
    except (OSError, TypeError):
        raise NativeError(
            f"the text of {function.__name__} cannot be read; put it into a file, or use "
            "Query(…, native=False)"
        ) from None
    try:
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
    except SyntaxError:
        tree = None
    if not isinstance(tree, ast.FunctionDef):
        raise NativeError(f"{file}:{first}: a model is a function written with def")
    ast.increment_lineno(tree, first - 1)
    tree.decorator_list = []
    tree.returns = None
    for argument in [*tree.args.args, *tree.args.kwonlyargs]:
        argument.annotation = None
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:] or [ast.Pass()]
    return ast.fix_missing_locations(tree), file


def _names(function: Callable[..., Any]) -> dict[str, Any]:
    code = function.__code__
    closure = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
    cells: dict[str, Any] = {}
    for name, cell in closure.items():
        try:
            cells[name] = cell.cell_contents
        except ValueError:  # defined after the model
            continue
    return {**vars(builtins), **function.__globals__, **cells}


class _Checker(ast.NodeTransformer):
    """Collects what a function's names stand for, leaves out its prints, refuses the rest."""

    def __init__(
        self,
        name: str,
        file: str,
        known: dict[str, Any],
        sources: dict[str, str],
        paths: list[str],
    ) -> None:
        self.name, self.file, self.known = name, file, known
        self.sources, self.paths = sources, paths
        self.constants: dict[str, Any] = {}
        self.calls: dict[str, Callable[..., Any]] = {}
        self.modules: dict[str, ModuleType] = {}
        self.local: set[str] = set()
        self.choosing = {"rng"}  # names by which choices are made

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if self.local:
            self._refuse(node, "a function within the function", "define it outside")
        self.local = {
            *(a.arg for a in [*node.args.args, *node.args.kwonlyargs]),
            *(n.id for n in ast.walk(node) if isinstance(n, ast.Name) and _stored(n)),
        }
        for part in ast.walk(node):
            if isinstance(part, ast.Attribute) and part.attr in (*KINDS, PATH):
                self.choosing |= self._asked(part)
        return self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        call = node.value
        called = call.func if isinstance(call, ast.Call) else None
        silent = isinstance(called, ast.Name) and called.id in _SILENT - self.local
        if silent and any(map(self._does_something, ast.walk(call))):
            what = "a choice or a change within what is left out natively"
            self._refuse(node, what, "make it before")
        if silent or isinstance(call, ast.Constant):
            return ast.copy_location(ast.Pass(), node)
        return self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        return self._operation(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        return self._operation(node)

    def _operation(self, node: ast.BinOp | ast.AugAssign) -> ast.AST:
        if isinstance(node.op, ast.Pow):
            self._refuse(node, "** rounds differently natively", f"write {_INSTEAD['pow']}")
        if isinstance(node.op, ast.MatMult):
            self._refuse(node, "@ adds in another order natively", "write a loop that adds")
        if isinstance(node.op, ast.LShift | ast.RShift):
            self._refuse(node, "a shift beyond 63 bits differs natively", "multiply or divide")
        return self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        if isinstance(node.op, ast.Invert):
            self._refuse(node, "~ of a bool differs natively", "write not x, or -1 - x")
        return self.generic_visit(node)

    def visit_Set(self, node: ast.Set) -> ast.AST:
        self._refuse(node, "the order of a set differs natively", "write a tuple")

    def visit_SetComp(self, node: ast.SetComp) -> ast.AST:
        self._refuse(node, "the order of a set differs natively", "write a list")

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if node.value is None:
            return ast.copy_location(ast.Pass(), node)
        assigned = ast.Assign([node.target], node.value)
        return self.generic_visit(ast.copy_location(assigned, node))

    def visit_Call(self, node: ast.Call) -> ast.AST:
        called: Any = node.func
        method = called.attr if isinstance(called, ast.Attribute) else ""
        if method in (*KINDS, PATH) and not self._is_module(called.value):
            self._choice(node, method)
        elif method in _SUMS and not self._is_module(called.value):
            self._refuse(node, f".{method}() rounds differently natively", "write a loop that adds")
        elif method == "argsort" and not self._is_module(called.value):
            self._refuse(node, ".argsort() orders what is equal differently", "write a loop")
        return self.generic_visit(node)

    def _asked(self, method: ast.expr) -> set[str]:
        """The name that a method like rng.at("leg", i).gaussian is asked of."""
        while isinstance(method, ast.Attribute | ast.Call):
            method = method.value if isinstance(method, ast.Attribute) else method.func
        return (
            {method.id} if isinstance(method, ast.Name) and not self._is_module(method) else set()
        )

    def _does_something(self, part: ast.AST) -> bool:
        if isinstance(part, ast.Name):
            return part.id in self.choosing
        changes = isinstance(part, ast.Attribute) and part.attr in _CHANGES
        return changes or isinstance(part, ast.NamedExpr)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if node.attr == "flat" and not self._is_module(node.value):
            self._refuse(
                node, "what is changed by .flat is not noticed natively", "index the array"
            )
        if not self._is_module(node.value) or not isinstance(node.value, ast.Name):
            return self.generic_visit(node)
        module, name = self.known[node.value.id], node.attr
        if module is math:
            native: Any = arithmetic.MODULE
        elif module is np:
            native = arithmetic.ARRAYS
        else:
            found = getattr(module, name, None)
            called = plain_function(found)
            flat = f"{node.value.id}__{name}"
            if called is not None:
                self.calls[flat] = called
            else:
                self.constants[flat] = self._constant(node, f"{node.value.id}.{name}", found)
            return ast.copy_location(ast.Name(flat, node.ctx), node)
        if not hasattr(native, name):
            way = _INSTEAD.get(name)
            self._refuse(
                node,
                f"{node.value.id}.{name} has no native form with the same bits",
                f"write {way}" if way else "compute it otherwise",
            )
        self.modules[node.value.id] = native
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id in self.local or node.id in self.calls or node.id in self.constants:
            return node
        if node.id not in self.known:
            self._refuse(node, f"the name {node.id!r} is not defined here", "define it before")
        found = self.known[node.id]
        if found is getattr(builtins, node.id, None):
            if node.id in _REBUILT:
                self.constants[node.id] = getattr(arithmetic, f"{node.id}_")
            elif node.id not in _BUILTINS and not _is_error(found):
                way = _INSTEAD.get(node.id)
                self._refuse(
                    node,
                    f"{node.id} has no native form with the same result",
                    f"write {way}" if way else "do without it",
                )
            return node
        called = plain_function(found)
        if called is not None:
            of_math = getattr(found, "__module__", None)
            if of_math != "math":
                self.calls[node.id] = called
                return node
        if inspect.isbuiltin(found) and getattr(math, found.__name__, None) is found:
            native = getattr(arithmetic.MODULE, found.__name__, None)
            if native is None:
                way = _INSTEAD.get(found.__name__, "something else")
                self._refuse(node, f"{node.id} rounds differently natively", f"write {way}")
            self.constants[node.id] = native
            return node
        if not isinstance(found, ModuleType):
            self.constants[node.id] = self._constant(node, node.id, found)
        return node

    def _constant(self, node: ast.AST, name: str, found: Any) -> Any:
        plain = isinstance(found, bool | int | float | str | np.ndarray) or _is_error(found)
        if not plain and isinstance(found, tuple):
            plain = all(isinstance(one, bool | int | float | str) for one in found)
        if not plain:
            self._refuse(
                node,
                f"{name} is a {type(found).__name__}",
                "the native form takes numbers, strings, tuples and arrays from outside: put it "
                "into the world",
            )
        return found

    def _choice(self, node: ast.Call, kind: str) -> None:
        first = node.args[0] if node.args else None
        for keyword in node.keywords:
            if keyword.arg in ("source", "name"):
                first = keyword.value
        value: Any = first.value if isinstance(first, ast.Constant) else None
        if isinstance(first, ast.Name) and first.id not in self.local:
            value = self.known.get(first.id)
        if not isinstance(value, str):
            self._refuse(
                node,
                f"the name in rng.{kind}(…) is computed",
                'write it out, and number it by a path: rng.at("plan", i).' + f'{kind}("walk", …)',
            )
        refuse_slash(value, f"{self.file}:{node.lineno}: ")
        if kind == PATH:
            self.paths.append(value)
            return
        before = self.sources.setdefault(value, kind)
        if before != kind:
            raise two_kinds(value, before, kind, f"{self.file}:{node.lineno}: ")

    def _is_module(self, node: ast.AST) -> bool:
        return (
            isinstance(node, ast.Name)
            and node.id not in self.local
            and isinstance(self.known.get(node.id), ModuleType)
        )

    def _refuse(self, node: ast.AST, what: str, way: str) -> NoReturn:
        line = getattr(node, "lineno", "?")
        raise NativeError(
            f"{self.file}:{line}: {self.name}: {what}; {way}, or use Query(…, native=False)"
        )


def refuse_slash(name: str, where: str = "") -> None:
    """Raise ModelError for a name that addresses could not tell from a path."""
    if "/" in name:
        raise ModelError(f"{where}the name {name!r} holds a /, which parts the names of a path")


def two_kinds(source: str, before: str, now: str, where: str = "") -> ModelError:
    return ModelError(
        f"{where}source {source!r} is asked for {before} and for {now}; give each distribution a "
        "source of its own"
    )


def _stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _is_error(found: Any) -> bool:
    return isinstance(found, type) and issubclass(found, BaseException)
