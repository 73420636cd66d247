"""Compilation of the numerical core, and a cache of it that cannot go stale.

numba's own cache watches only the file a function stands in. The core is spread over several
files (one effect, one file), so the cache folder carries a digest of all of them.
"""

import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import cache, update_wrapper
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


class OnFirstUse:
    """What numba makes, made when it is first called or first compiled into something else.

    numba takes half a second and 60 MB to load, which who wants a machine's parameters alone, such
    as a controller's node, does without.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make, self._made, self._lock = make, None, Lock()

    def __call__(self, *arguments: Any) -> Any:
        """Return what the made function returns."""
        made = self._made or self._now_made()
        return made(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """Its type, for which numba asks while it compiles who calls it."""
        return _typing_context().resolve_value_type(self._made or self._now_made())

    def _now_made(self) -> Any:
        with self._lock:  # or threads would compile it once each
            if self._made is None:
                self._made = self._make()
            return self._made


def _typing_context() -> Any:
    from numba.core.registry import cpu_target  # noqa: PLC0415 (see OnFirstUse)

    return cpu_target.typing_context


def _cache_folder() -> Path:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    user_cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    root = Path(os.environ.get("NUMBA_CACHE_DIR", user_cache / "emir"))
    return root / digest.hexdigest()[:16]


@cache
def _numba() -> Any:
    import numba  # noqa: PLC0415 (see OnFirstUse)

    numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]
    import_module("emir_plant.instructions")  # numba knows what is there before it compiles
    return numba


def _if_there_is_room(save: Callable[..., None]) -> Callable[..., None]:
    """Return what saves compiled code where the disk takes it: on a full one it runs all the same.

    numba lets the failure through, and whoever calls the function first would get it.
    """

    def save_or_not(*what: Any) -> None:
        with suppress(OSError):
            save(*what)

    return save_or_not


def _compiled(function: Function, **options: bool) -> Function:
    def make() -> Any:
        decorate = _numba().njit(cache=True, error_model="numpy", forceinline=True, **options)
        made = decorate(function)
        cache = made._cache  # noqa: SLF001 (numba has no option for it)
        cache.save_overload = _if_there_is_room(cache.save_overload)
        return made

    return cast("Function", update_wrapper(OnFirstUse(make), function))


def compiled(function: Function) -> Function:
    """Compile `function` with numba: IEEE arithmetic, cached on disk."""
    return _compiled(function)


def compiled_in_place(function: Function) -> Function:
    """As `compiled`, for a function that creates no arrays but works on those it is given.

    Who holds an array is not counted then. Counting takes a third of a step of joint 1, since the
    compiler cannot see through so large a function that every count is taken back. Called from
    Python it leaves the interpreter's lock to others, so that threads run it side by side.
    """
    return _compiled(function, nogil=True, _nrt=False)


def on_all_cores(work: Callable[[int], None], number: int) -> None:
    """Call work(0) ... work(number - 1), as many at a time as numba is set to have threads.

    By threads of Python and not by numba's own loop: that has the compiler go through everything
    in it three times more, which was a third of a first start. Raises what `work` raises.
    """
    threads = min(number, _numba().get_num_threads())
    if threads <= 1:
        for i in range(number):
            work(i)
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, range(number)))  # the list, so that it raises


_square_root = OnFirstUse(lambda: import_module("emir_plant.instructions").square_root)
_power_of_two = OnFirstUse(lambda: import_module("emir_plant.instructions").power_of_two)


@compiled
def square_root(number: float) -> float:
    """Return the square root, nan of a negative number.

    One instruction; `math.sqrt` asks the C library whenever the number may be negative.
    """
    root: float = _square_root(number)
    return root


@compiled
def power_of_two(exponent: float) -> float:
    """Return 2 to a whole number within -1022 to 1023; `2.0**exponent` asks the C library."""
    power: float = _power_of_two(exponent)
    return power
