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
