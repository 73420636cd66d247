"""What kind of machine number k of a seed is, and which effects have their turn in it."""

from typing import Any, TypeVar

import numpy as np

KINDS = ("one", "none", "one", "two", "one", "foreign")  # in turn

Kind = TypeVar("Kind", bound=type[Any])  # a class of what may be hidden, with its `name`


def kind_of(number: int, foreign: tuple[Kind, ...]) -> str:
    """Return the kind of machine `number`."""
    kind = KINDS[number % len(KINDS)]
    return "none" if kind == "foreign" and not foreign else kind


def hidden_in(  # noqa: PLR0913, PLR0917 (which machine, from what is drawn)
    seed: int,
    number: int,
    catalogue: tuple[Kind, ...],
    foreign: tuple[Kind, ...],
    only: tuple[str, ...] = (),
    tried: int = 0,
) -> tuple[Kind, ...]:
    """Draw what is hidden in machine `number`; every effect has its turn before the next round.

    only: names from which to draw, all when empty. tried: how often before it was drawn in vain.
    """
    kind = kind_of(number, foreign)
    if kind == "none":
        return ()
    of_kind = foreign if kind == "foreign" else catalogue
    pool = tuple(e for e in of_kind if e.name in only) or of_kind
    if kind == "two" or tried:
        random = np.random.default_rng((seed, number, tried))
        count = min(2 if kind == "two" else 1, len(pool))
        drawn = random.choice(len(pool), count, replace=False)
        return tuple(pool[k] for k in drawn)
    turn = sum(KINDS[k % len(KINDS)] == kind for k in range(number))
    turn_of_all, place = divmod(turn, len(pool))
    order = np.random.default_rng((seed, KINDS.index(kind), turn_of_all))
    return (pool[order.permutation(len(pool))[place]],)
