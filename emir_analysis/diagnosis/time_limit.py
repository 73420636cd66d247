"""The time that a search may take, watched where machines are simulated.

Some recordings, mostly of what sticks, take many times as long as others: then what was found until
then is worth more than no answer.
"""

import math
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

Result = TypeVar("Result")


class OutOfTimeError(Exception):
    """The time is over. `TimeLimit.within` catches it."""


class TimeLimit:
    """A time, s, after which what is done within it ends. seconds: inf for no limit."""

    def __init__(self, seconds: float = math.inf) -> None:
        self.seconds = seconds
        self.is_over = False
        self._end = monotonic() + seconds
        self._is_watched = False

    def check(self) -> None:
        """Raise OutOfTimeError where the time is over for what is done within it."""
        if self._is_watched and monotonic() > self._end:
            raise OutOfTimeError

    def within(self, work: Callable[[], Result], otherwise: Callable[[], Result]) -> Result:
        """Return what some work returns, or, where the time is over before, something else."""
        if self.is_over:
            return otherwise()
        self._is_watched = True
        try:
            return work()
        except OutOfTimeError:
            self.is_over = True
        finally:
            self._is_watched = False
        return otherwise()
