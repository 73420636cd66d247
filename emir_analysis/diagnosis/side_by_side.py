"""Independent fits side by side: most of one runs on a single core."""

from collections.abc import Callable, Iterable
from typing import TypeVar

from emir_plant.jit import on_all_cores

Item = TypeVar("Item")
Result = TypeVar("Result")


def side_by_side(work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return work(item) of each item, in their order, as many at a time as there are cores.

    Raises what `work` raises. The same numbers come out as one by one.
    """
    todo = list(items)
    done: dict[int, Result] = {}

    def run(k: int) -> None:
        done[k] = work(todo[k])

    on_all_cores(run, len(todo))
    return [done[k] for k in range(len(todo))]
