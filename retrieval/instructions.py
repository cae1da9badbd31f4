"""Two instructions that numba has no word for: an unaligned read, and a prefetch."""

from collections.abc import Callable
from typing import Any, cast

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

_FOR_READING, _KEEP, _DATA = 0, 3, 1


def _instruction(declare: Callable[[Any, Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """The cast gives type checkers what kernels call; numba passes a typing context before it."""
    return cast(Callable[[Any, Any], Any], intrinsic(declare))


@_instruction
def load_uint64(_typing: Any, array: Any, at: Any) -> Any:
    """Read the 8 bytes from `at` on of a uint8 array as a number, lowest first, unchecked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.gep(_data(context, builder, signature, arguments), [arguments[1]])
        number = builder.load(builder.bitcast(place, ir.IntType(64).as_pointer()))
        number.align = 1
        return number

    return types.uint64(array, types.int64), generate


@_instruction
def prefetch(_typing: Any, array: Any, at: Any) -> Any:
    """Have the cache line of `at` fetched while other work goes on; harmless outside the array."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = _data(context, builder, signature, arguments)
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [data.type, number, number, number])
        instruction = builder.module.declare_intrinsic("llvm.prefetch", [data.type], kind)
        how = [number(value) for value in (_FOR_READING, _KEEP, _DATA)]
        builder.call(instruction, [builder.gep(data, [arguments[1]]), *how])
        return context.get_dummy_value()

    return types.void(array, types.int64), generate


def _data(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    of_kind = make_array(signature.args[0])  # type: ignore[no-untyped-call]
    return of_kind(context, builder, arguments[0]).data
