"""Eight numbers side by side, as a value of numba's, for the inner loops of kernels that LLVM does not vectorize well.

A processor that has shorter vectors handles them in parts.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model

LANES = 8
_VECTOR = ir.VectorType(ir.FloatType(), LANES)


class _Lanes(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Lanes")


_lanes = _Lanes()


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, numba_type: _Lanes):
        super().__init__(manager, numba_type, _VECTOR)


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(cgutils.pointer_add(builder, data, builder.mul(index, index.type(4))), _VECTOR.as_pointer())


def _typed(function: Callable[..., Any]) -> Any:
    return intrinsic(function)


@_typed
def load(_: Any, array: Any, index: Any) -> Any:
    """Returns eight neighbours, from `index` on, of a contiguous float32 array; no bounds are checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_pointer(context, builder, signature.args[0], *arguments), align=4)

    return _lanes(array, types.intp), generate


@_typed
def store(_: Any, array: Any, index: Any, values: Any) -> Any:
    """Writes eight neighbours, from `index` on, of a contiguous float32 array; no bounds are checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _pointer(context, builder, signature.args[0], *arguments[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, values), generate


@_typed
def add_scaled(_: Any, number: Any, values: Any, total: Any) -> Any:
    """Returns `total` plus `number` times `values`, rounded once if the processor can."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number, values, total = arguments
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
        lanes = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        spread = builder.shuffle_vector(one, one, lanes)
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        fmuladd = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f32")
        return builder.call(fmuladd, [spread, values, total])

    return _lanes(types.float32, values, total), generate
