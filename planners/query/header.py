"""The header of a query's memory, as Python and native code both see it.

Native code gets a single number, the header's address, and finds everything else there; the plain
form calls the same kernels with the same number. So there is one implementation of what a choice
does, and the two forms cannot differ in it.

Vocabulary. A *source* is a name in the model's text. A *stream* is one source under one path
(`rng.at("plan", 3)`), so an unscoped source is a single stream. The k-th call to a stream is an
*address*; each address ever used has a *cell*, its place in every genome. NaN in a genome means
that it has no value for this cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.extending import intrinsic

HEADER = np.dtype(
    [
        # The run in progress.
        ("genome", "i8"),  # address of float64 [cells]: the values to take, and those taken
        ("log", "i8"),  # address of int32 [longest]: cells in the order of the calls
        ("length", "i8"),  # choices made so far
        ("countdown", "i8"),  # choices until the next one is mutated; 0: never
        ("gap", "i8"),  # mutations are gap choices apart on average
        ("overflow", "i8"),  # why this run asked for more than the tables hold, or 0
        ("random", "u8"),  # state of splitmix64
        # Tables: which address has which cell.
        ("counts", "i8"),  # int32 [streams]: calls so far in this run
        ("cells", "i8"),  # int32 [streams, width]: cell of (stream, index), or -1
        ("streams", "i8"),  # int64 [streams, 3]: parent path, name, index (-1: a stream)
        ("slots", "i8"),  # int32 [4 * streams]: hash table of `streams`, -1 = empty
        ("scales", "i8"),  # float64 [streams]: the last spread that a source was asked with
        ("homes", "i8"),  # int32 [cells, 3]: stream, index and kind of a cell
        ("fixed", "i8"),  # float64 [cells]: what the choice is constrained to, or NaN
        ("known_streams", "i8"),
        ("known_cells", "i8"),
        ("most_streams", "i8"),
        ("most_cells", "i8"),
        ("width", "i8"),
        ("longest", "i8"),
        ("grow", "i8"),  # why runs overflowed: the tables must grow before the next generation
        ("constrained", "i8"),  # whether any choice is
        # Populations: two of them, the parents' and the children's, in turn.
        ("genomes", "i8"),  # float64 [2, size + 1, most_cells]; the last row: spare
        ("logs", "i8"),  # int32 [2, size + 1, longest]
        ("lengths", "i8"),  # int32 [2, size + 1]
        ("values", "i8"),  # float64 [2, size + 1]: of the model; inf for invalid
        ("elites", "i8"),  # int32 [size]: rows of the parents that are kept, best first, by island
        ("steps", "i8"),  # float64 [islands + 1]: step of each island's cloud
        ("begins", "i8"),  # int32 [islands + 1]: whether the island begins anew
        ("side", "i8"),  # which of the two holds the parents
        ("size", "i8"),  # individuals in all
        ("main", "i8"),  # of these, the first ones are the population, the rest the scouts
        ("islands", "i8"),  # of the population, each of main // islands
        ("kept", "i8"),  # elites of an island
        ("scouts_kept", "i8"),
        ("clouded", "i8"),  # continuous choices of the best that the run in progress was moved from
        ("scouts_age", "i8"),  # generations since the scouts began anew
        ("generation", "i8"),
        ("evaluations", "i8"),
        ("best", "i8"),  # row of the best parent
        ("best_island", "i8"),
        ("calm", "f8"),  # 0 after a change of the world was seen, growing to 1
        # Operators (operators.py).
        ("crossover", "f8"),
        ("line", "f8"),
        ("difference", "f8"),
        ("cloud", "f8"),
        ("pair", "f8"),
        ("structure", "f8"),
        ("immigrants", "f8"),
        ("mutations", "f8"),
        ("smallest_step", "f8"),
        ("largest_step", "f8"),
        ("steps_range", "f8"),  # log(smallest_step / largest_step)
        ("exclusion", "f8"),
        ("restart", "i8"),
        ("adaptive", "i8"),
        ("dormant", "i8"),
    ]
)
"""The header of a query, as numpy and native code both see it."""

HEADER_TYPE = from_dtype(HEADER)


@intrinsic
def header_at(typingctx: Any, address: Any) -> Any:
    """The header that lies at an address."""
    signature = HEADER_TYPE(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return signature, codegen


@intrinsic
def pointer(typingctx: Any, address: Any) -> Any:
    """An address as a pointer, for `carray`."""
    signature = types.voidptr(types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return signature, codegen


def _accessors(element: Any, width: Any) -> tuple[Any, Any]:
    """A load and a store of one element at (address, place)."""

    @intrinsic
    def load(typingctx: Any, address: Any, place: Any) -> Any:
        signature = element(types.int64, types.int64)

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            base = builder.inttoptr(args[0], width.as_pointer())
            return builder.load(builder.gep(base, [args[1]]))

        return signature, codegen

    @intrinsic
    def store(typingctx: Any, address: Any, place: Any, value: Any) -> Any:
        signature = types.void(types.int64, types.int64, element)

        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            base = builder.inttoptr(args[0], width.as_pointer())
            builder.store(args[2], builder.gep(base, [args[1]]))
            return context.get_dummy_value()

        return signature, codegen

    return load, store


load_real, store_real = _accessors(types.float64, ir.DoubleType())
load_int, store_int = _accessors(types.int32, ir.IntType(32))


@intrinsic
def copy_reals(typingctx: Any, target: Any, source: Any, count: Any) -> Any:
    """Copy float64 numbers from one address to another; they do not overlap."""
    signature = types.void(types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        to, of = (builder.inttoptr(place, ir.DoubleType().as_pointer()) for place in args[:2])
        cgutils.raw_memcpy(builder, to, of, args[2], 8, align=8)
        return context.get_dummy_value()

    return signature, codegen
