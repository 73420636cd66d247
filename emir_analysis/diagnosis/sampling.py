"""Sensors read at other instants than those of the common grid, and what a run shows through them.

What was measured is taken along straight lines between a sensor's readings. A simulated run is
read at the same instants and taken along the same lines: else a swing of the boom between two
readings would stand as an error of the model.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emir_analysis.signals import Array

FINE = 4e-3  # s: between two rows this near, no swing of a boom bends
ON_GRID = 1e-4  # s from the grid's instants: no signal moves by its noise in that
ALMOST = 1e-6  # of a period
NEARLY_ALL = 0.99  # of the grid's instants


@dataclass(frozen=True)
class Sampling:
    """When each signal of a run was read: (r,) s from the recording's start, None on the grid."""

    read_at: tuple[Array | None, ...] = ()

    @property
    def on_grid(self) -> bool:
        """Every sensor was read where the grid's rows stand, or often enough between them."""
        return all(times is None for times in self.read_at)

    def rows_between(self, every: int, step: float) -> int:
        """Return into how many rows a run parts a sample of `every` steps, s, to be read.

        One where all sensors were read on the grid.
        """
        if self.on_grid:
            return 1
        return next(n for n in range(1, every + 1) if every % n == 0 and every * step / n <= FINE)

    def further(self, time: float, period: float) -> int:
        """Return how many periods, s, a run goes beyond a time, s: to the readings behind it."""
        following = [times[np.searchsorted(times, time) :][:1] for times in self._off_grid()]
        longest = max((float(t[0]) - time for t in following if t.size), default=0.0)
        return math.ceil(longest / period - ALMOST)

    def read(self, run: Array, row: float, time: Array) -> Array:
        """Return what the sensors show of a run, (m, c), on the grid's times, (n,) s.

        row: s, between the run's rows.
        """
        fine = row * np.arange(len(run))
        shown: Array = run[np.rint(time / row).astype(int)]
        for k, times in enumerate(self.read_at):
            if times is not None:
                lasting = times[times <= fine[-1] + row]  # before its start a run is at rest
                shown[:, k] = np.interp(time, lasting, np.interp(lasting, fine, run[:, k]))
        return shown

    def _off_grid(self) -> list[Array]:
        return [times for times in self.read_at if times is not None]


def steps(period: float, step: float) -> int:
    """Return how many steps, s or nearly that, make a period, s.

    An even number where no number of whole ones does: a coarse run takes two at once.
    """
    whole = max(1, round(period / step))
    is_whole = abs(period - whole * step) < ALMOST * period
    return whole if is_whole else 2 * max(1, round(period / (2.0 * step)))


def grid_period(times: Array, begin: float, step: float) -> float:
    """Return the period, s, of a grid from a begin, s, for readings at times, (n,) s.

    Whole steps, s, as far as readings stand there. Else their own, if they keep one: along lines
    between readings of 80 Hz a fifth of the noise is lost on whole milliseconds.
    """
    usual, span = float(np.median(np.diff(times))), float(times[-1] - times[0])
    whole = step * max(1, round(usual / step))
    own = span / max(1, round(span / usual))
    keeps = {each: _is_near(times, np.arange(begin, times[-1], each)) for each in (whole, own)}
    return own if keeps[own] and not keeps[whole] else whole


def sampling(read_at: Sequence[Array], time: Array) -> Sampling:
    """Return how signals were sampled that were read at times, each (r,) s, for a grid, (n,) s."""
    return Sampling(tuple(None if _is_near(times, time) else times for times in read_at))


def _is_near(times: Array, time: Array) -> bool:
    """Tell whether readings stand on the grid, or so near to each other that it is all the same."""
    if float(np.median(np.diff(times))) <= FINE:
        return True
    nearest = np.clip(np.searchsorted(times, time), 1, times.size - 1)
    apart = np.minimum(np.abs(times[nearest] - time), np.abs(times[nearest - 1] - time))
    return float(np.quantile(apart, NEARLY_ALL)) <= ON_GRID
