"""The native form of a model: its own text compiled, with each choice resolved beforehand.

The type of `rng` carries the names of the sources, so that `rng.gaussian("walk", 0, 1)` becomes a
direct call with the stream's number in it, and a compiled model is kept from process to process.
"""

# pyright: reportCallIssue=false
# (intrinsics are called without a context)

from __future__ import annotations

import ast
import hashlib
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core.errors import NumbaError, TypingError
from numba.extending import intrinsic, models, overload, overload_method, register_model

from anytime.machine_code import njit
from planners.query import arithmetic, choosing, header
from planners.query.errors import NativeError
from planners.query.reading import Function, Text


class RngType(types.Type):
    """`rng` in a native model: the address of a query's header."""

    def __init__(self, names: tuple[str, ...], mark: str) -> None:
        self.names = names
        self.mark = mark
        super().__init__(name=f"Rng({', '.join(names)}; {mark})")


class PathType(types.Type):
    """What `rng.at(name, index)` gives: the address, and the number of the path."""

    def __init__(self, rng: RngType) -> None:
        self.names = rng.names
        self.rng = rng
        super().__init__(name=f"Path of {rng.name}")


@register_model(RngType)
class _RngModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, ir.IntType(64))


@register_model(PathType)
class _PathModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("address", types.int64), ("path", types.int64)])


@intrinsic
def _address(typingctx: Any, rng: Any) -> Any:
    """The address of the header that `rng` or a path stands for."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return args[0] if isinstance(rng, RngType) else builder.extract_value(args[0], 0)

    return types.int64(rng), codegen


@intrinsic
def _path(typingctx: Any, rng: Any) -> Any:
    """The number of the path that `rng` is at; -1 at the root."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        if isinstance(rng, RngType):
            return context.get_constant(types.int64, -1)
        return builder.extract_value(args[0], 1)

    return types.int64(rng), codegen


@intrinsic
def _below(typingctx: Any, rng: Any, path: Any) -> Any:
    """`rng` at another path."""
    root = rng if isinstance(rng, RngType) else rng.rng

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        address = args[0] if isinstance(rng, RngType) else builder.extract_value(args[0], 0)
        made = builder.insert_value(
            ir.Constant(context.get_value_type(signature.return_type), ir.Undefined), address, 0
        )
        return builder.insert_value(made, args[1], 1)

    return PathType(root)(rng, types.int64), codegen


def _stream(rng: Any, number: int) -> Any:
    """The stream of a source here: known beforehand at the root, looked up below a path."""


@overload(_stream, prefer_literal=True, inline="always")
def _stream_here(rng, number):
    if isinstance(rng, RngType):
        return lambda rng, number: number
    return lambda rng, number: choosing.stream_of(_address(rng), _path(rng), number, -1)


_INLINED = {"forceinline": True}


def _number(rng, source):
    """The number of a source or path name, which must be known when the model is made native."""
    if not isinstance(source, types.StringLiteral):
        raise TypingError("the name of a source is computed; write it out")
    return rng.names.index(source.literal_value)


@overload_method(RngType, "at", prefer_literal=True)
@overload_method(PathType, "at", prefer_literal=True)
def _at(rng, name, place=0):
    number = _number(rng, name)
    place = getattr(place, "value", place)  # of one that was left out
    if not isinstance(place, int | types.Integer | types.IntegerLiteral | types.Boolean):
        raise TypingError(f"at(name, place) takes an integer place, not {place}")

    def at(rng, name, place=0):
        if place < 0:
            raise ValueError("rng.at(name, place) was asked with a place < 0")
        return _below(rng, choosing.stream_of(_address(rng), _path(rng), number, np.int64(place)))

    return at


@overload_method(RngType, "flip", prefer_literal=True, jit_options=_INLINED)
@overload_method(PathType, "flip", prefer_literal=True, jit_options=_INLINED)
def _flip(rng, source, p=0.5):
    number = _number(rng, source)
    return lambda rng, source, p=0.5: choosing.flip(
        _address(rng), _stream(rng, number), np.float64(p)
    )


@overload_method(RngType, "randint", prefer_literal=True, jit_options=_INLINED)
@overload_method(PathType, "randint", prefer_literal=True, jit_options=_INLINED)
def _randint(rng, source, n):
    number = _number(rng, source)
    if not isinstance(n, types.Integer | types.IntegerLiteral):
        raise TypingError(f"randint(source, n) takes an integer n, not {n}")
    return lambda rng, source, n: choosing.randint(_address(rng), _stream(rng, number), np.int64(n))


@overload_method(RngType, "gaussian", prefer_literal=True, jit_options=_INLINED)
@overload_method(PathType, "gaussian", prefer_literal=True, jit_options=_INLINED)
def _gaussian(rng, source, mean=0.0, sigma=1.0):
    number = _number(rng, source)
    return lambda rng, source, mean=0.0, sigma=1.0: choosing.gaussian(
        _address(rng), _stream(rng, number), np.float64(mean), np.float64(sigma)
    )


@overload_method(RngType, "uniform", prefer_literal=True)
@overload_method(PathType, "uniform", prefer_literal=True)
def _uniform(rng, source, low=0.0, high=1.0):
    number = _number(rng, source)
    return lambda rng, source, low=0.0, high=1.0: choosing.uniform(
        _address(rng), _stream(rng, number), np.float64(low), np.float64(high)
    )


@overload_method(RngType, "categorical", prefer_literal=True)
@overload_method(PathType, "categorical", prefer_literal=True)
def _categorical(rng, source, weights):
    number = _number(rng, source)

    def categorical(rng, source, weights):
        shares = np.empty(len(weights))
        for i in range(len(weights)):
            shares[i] = weights[i]
        return choosing.categorical(_address(rng), _stream(rng, number), shares)

    return categorical


@overload_method(RngType, "exponential", prefer_literal=True)
@overload_method(PathType, "exponential", prefer_literal=True)
def _exponential(rng, source, scale=1.0):
    number = _number(rng, source)
    return lambda rng, source, scale=1.0: choosing.exponential(
        _address(rng), _stream(rng, number), np.float64(scale)
    )


@overload_method(RngType, "lognormal", prefer_literal=True)
@overload_method(PathType, "lognormal", prefer_literal=True)
def _lognormal(rng, source, mean=0.0, sigma=1.0):
    number = _number(rng, source)
    return lambda rng, source, mean=0.0, sigma=1.0: choosing.lognormal(
        _address(rng), _stream(rng, number), np.float64(mean), np.float64(sigma)
    )


@dataclass(frozen=True, eq=False)
class Native:
    """A compiled model. `address` is of `float64 (int64 header, world *)`; the rest keeps it alive.

    cached: whether the code came from an earlier process.
    """

    address: int
    cached: bool
    dispatcher: Any


def make(text: Text, world: np.dtype, takes_world: bool) -> Native:
    """Compile a model that was read, for worlds of one layout.

    Raises NativeError with the line and the way out for what the compiler refuses.
    """
    mark = _mark(text)
    rng = RngType(text.names, mark)
    built: dict[int, Any] = {}
    places = _places(text)
    for function in text.functions:
        made = _built(function, built)
        last = function is text.functions[-1]
        inlined = places[id(function.original)] == 1
        try:
            built[id(function.original)] = _compiled(made, inlined, cache=last)
        except RuntimeError:  # nowhere to keep the code: the model is no file's
            built[id(function.original)] = _compiled(made, inlined)
    dispatcher = built[id(text.functions[-1].original)]
    try:
        dispatcher.compile(types.float64(rng, *[_read_only(world)] * takes_world))
    except (NumbaError, AttributeError, AssertionError) as error:  # numba's own, of what is fixed
        raise NativeError(_explained(text, error)) from error
    compiled = next(iter(dispatcher.overloads.values()))
    address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    return Native(address, bool(dispatcher.stats.cache_hits), dispatcher)


class _Fixed(types.NestedArray):
    """An array of the world, and what is taken from it: the compiler refuses to change it."""

    def __init__(self, dtype: Any, shape: tuple[int, ...]) -> None:
        super().__init__(dtype, shape)
        self.name = f"fixed {self.name}"
        self.mutable = False


register_model(_Fixed)(models.NestedArrayModel)


def _read_only(world: np.dtype) -> types.Record:
    record: Any = from_dtype(world)
    fields = []
    for name, field in record.fields.items():
        kind = field.type
        if isinstance(kind, types.NestedArray):
            kind = _Fixed(kind.dtype, kind.shape)
        fields.append((name, {"type": kind, "offset": field.offset, "alignment": field.alignment}))
    return types.Record(fields, record.size, record.aligned)


def _compiled(made: Callable[..., Any], inlined: bool, *, cache: bool = False) -> Any:
    # Without the check an index beyond an array of the world reads whatever stands there.
    return njit(made, cache=cache, forceinline=inlined, boundscheck=True)


def _places(text: Text) -> Counter[int]:
    """From how many places each function is called. What is called from one is compiled into it."""
    return Counter(
        id(function.calls[node.func.id])
        for function in text.functions
        for node in ast.walk(function.tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in function.calls
    )


def _built(function: Function, built: dict[int, Any]) -> FunctionType:
    """The function as the native form has it: without prints, its names bound beforehand."""
    original = function.original
    tree = function.tree
    tree.args.defaults = []
    tree.args.kw_defaults = [None] * len(tree.args.kwonlyargs)
    module = compile(ast.Module([tree], []), function.file, "exec")
    code = next(c for c in module.co_consts if isinstance(c, CodeType) and c.co_name == tree.name)
    names: dict[str, Any] = {
        **function.constants,
        **function.modules,
        **{name: built[id(called)] for name, called in function.calls.items()},
    }
    made = FunctionType(code, names, tree.name, original.__defaults__)
    made.__kwdefaults__ = original.__kwdefaults__
    made.__module__, made.__qualname__ = original.__module__, original.__qualname__
    return made


def _mark(text: Text) -> str:
    """A digest of everything that the native code depends on, so that no stale code is loaded."""
    digest = hashlib.blake2b(_engine().encode(), digest_size=8)
    for function in text.functions:
        digest.update(ast.dump(function.tree).encode())
        digest.update(
            repr((function.original.__defaults__, function.original.__kwdefaults__)).encode()
        )
        for name, value in sorted(function.constants.items()):
            digest.update(name.encode() + _bytes(value))
    return digest.hexdigest()


def _bytes(constant: Any) -> bytes:
    if isinstance(constant, np.ndarray):
        return f"{constant.dtype.str} {constant.shape} ".encode() + constant.tobytes()
    # of a function the name: its text is the engine's, which is in the digest
    return str(getattr(constant, "__name__", None) or repr(constant)).encode()


def _engine() -> str:
    """A digest of the kernels that are compiled into every model."""
    digest = hashlib.blake2b(digest_size=8)
    for module in (arithmetic, choosing, header):
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(Path(__file__).read_bytes())
    return digest.hexdigest()


def _explained(text: Text, error: Exception) -> str:
    """One line of a compiler's message: where, what, and the way out."""
    message = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    files = {function.file for function in text.functions}
    places = [
        (file, line)
        for file, line in re.findall(r'File "([^"]+)", line (\d+)', message)
        if any(known.endswith(file) for known in files)
    ]
    name = text.functions[-1].original.__name__
    where = f"{places[-1][0]}:{places[-1][1]}: {name}" if places else name
    raised = re.findall(r"(?:Typing|Value)Error: (.+)", message)  # by our own overloads, first
    if not isinstance(error, NumbaError) or "Cannot modify readonly" in message:
        raised = [
            "an array that is the same for every run, as those of the world are, is changed or "
            "replaced; begin with a copy"
        ]
    telling = [*raised, *(line.strip() for line in message.splitlines() if _telling(line))]
    return (
        f"{where}: {telling[0] if telling else 'no native form'}; write it otherwise, or use "
        "Query(…, native=False)"
    )


def _telling(line: str) -> bool:
    dull = ("File ", "During", "Failed in", "- ", "raised from", "[", "<source", "^", "There are")
    stripped = line.strip()
    return bool(stripped) and not stripped.startswith(dull) and " " in stripped
