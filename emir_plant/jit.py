"""Compilation of the numerical core, and a cache of it that cannot go stale.

numba's own cache watches only the file a function stands in. The core is spread over several
files (one effect, one file), so the cache folder carries a digest of all of them.
"""

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba.extending import intrinsic

Function = TypeVar("Function", bound=Callable[..., Any])


def _cache_folder() -> Path:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    user_cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    root = Path(os.environ.get("NUMBA_CACHE_DIR", user_cache / "emir"))
    return root / digest.hexdigest()[:16]


numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]


def compiled(function: Function) -> Function:
    """Compile `function` with numba: IEEE arithmetic, cached on disk."""
    return cast("Function", numba.njit(cache=True, error_model="numpy", forceinline=True)(function))


def compiled_in_place(function: Function) -> Function:
    """As `compiled`, for a function that creates no arrays but works on those it is given.

    Who holds an array is not counted then. Counting takes a third of a step of joint 1, since the
    compiler cannot see through so large a function that every count is taken back. Called from
    Python it leaves the interpreter's lock to others, so that threads run it side by side.
    """
    decorate = numba.njit(  # type: ignore[call-overload]  # numba's stubs leave out its last option
        cache=True, error_model="numpy", forceinline=True, nogil=True, _nrt=False
    )
    return cast("Function", decorate(function))


def on_all_cores(work: Callable[[int], None], number: int) -> None:
    """Call work(0) ... work(number - 1), as many at a time as numba is set to have threads.

    By threads of Python and not by numba's own loop: that has the compiler go through everything
    in it three times more, which was a third of a first start. Raises what `work` raises.
    """
    threads = min(number, numba.get_num_threads())
    if threads <= 1:
        for i in range(number):
            work(i)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, range(number)))  # the list, so that it raises


@intrinsic
def _sqrt(_context: Any, _argument: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        root = builder.module.declare_intrinsic("llvm.sqrt", [ir.DoubleType()])
        return builder.call(root, arguments)

    return numba.float64(numba.float64), generate


@compiled
def square_root(number: float) -> float:
    """Return the square root, nan of a negative number.

    One instruction; `math.sqrt` asks the C library whenever the number may be negative.
    """
    root: float = _sqrt(number)  # type: ignore[call-arg]  # numba gives the context
    return root
