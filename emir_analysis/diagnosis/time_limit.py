"""The time that a search may take, watched where machines are simulated.

Some recordings, mostly of what sticks, take many times as long as others: then what was found until
then is worth more than no answer.
"""

import math
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

Result = TypeVar("Result")

AFTERWARDS = 0.25  # of the time: what follows work that was ended may take so much more


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
        try:
            return self._watched(work)
        except OutOfTimeError:
            self.is_over = True
        return otherwise()

    def afterwards(self, work: Callable[[], Result], otherwise: Callable[[], Result]) -> Result:
        """Return the same of what follows; where the time was over, in a share of it of its own."""
        if not self.is_over:
            return work()
        self._end = monotonic() + AFTERWARDS * self.seconds
        try:
            return self._watched(work)
        except OutOfTimeError:
            return otherwise()

    def _watched(self, work: Callable[[], Result]) -> Result:
        self._is_watched = True
        try:
            return work()
        finally:
            self._is_watched = False
