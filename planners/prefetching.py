"""Memory that will be needed soon, asked for before it is.

A search that goes straight through a large map comes with every row to lines of memory that no
cache holds, and would wait for each a tenth of a microsecond: half of its time.
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

_READ, _CLOSEST, _DATA = (ir.Constant(ir.IntType(32), number) for number in (0, 3, 1))


def prefetch(array, index):
    """Ask the processor to load an element of a flat array, which may be anywhere in memory.

    Outside of machine code it does nothing, as there the processor is never waited for.
    """


@overload(prefetch)
def _prefetch(array, index):
    return lambda array, index: _instruction(array, index)  # pyright: ignore[reportCallIssue]


@intrinsic
def _instruction(typingctx, array, index):
    def codegen(context, builder, signature, args):
        data = context.make_array(array)(context, builder, args[0]).data
        place = builder.bitcast(builder.gep(data, [args[1]]), ir.IntType(8).as_pointer())
        kinds = [place.type, *[ir.IntType(32)] * 3]
        function = builder.module.declare_intrinsic(
            "llvm.prefetch", [place.type], ir.FunctionType(ir.VoidType(), kinds)
        )
        builder.call(function, [place, _READ, _CLOSEST, _DATA])
        return context.get_dummy_value()

    return types.void(array, index), codegen
