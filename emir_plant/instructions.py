"""Instructions of the processor that numba has no name for."""

from typing import Any

import numba
from llvmlite import ir
from numba.extending import intrinsic


@intrinsic
def square_root(_context: Any, _argument: Any) -> Any:
    """Return the square root, nan of a negative number."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        root = builder.module.declare_intrinsic("llvm.sqrt", [ir.DoubleType()])
        return builder.call(root, arguments)

    return numba.float64(numba.float64), generate


@intrinsic
def power_of_two(_context: Any, _argument: Any) -> Any:
    """Return 2 to a whole number within -1022 to 1023: the bits of its exponent."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        whole = builder.fptosi(arguments[0], ir.IntType(64))
        exponent = builder.shl(
            builder.add(whole, ir.Constant(whole.type, 1023)), ir.Constant(whole.type, 52)
        )
        return builder.bitcast(exponent, ir.DoubleType())

    return numba.float64(numba.float64), generate
