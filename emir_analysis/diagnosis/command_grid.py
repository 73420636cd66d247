"""A command that was sampled with the sensors, put back to when it was given.

In a table all signals of a row have one time. A command that is given every 32 ms stands in rows
of 10 ms up to 10 ms late, each time by another amount, and a boom that is hardly damped adds that
up. But the commands were given on a grid of the period that the data sheet states, and each change
lies between two rows: together they tell where that grid lies.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from emir_analysis.errors import InputError
from emir_analysis.signals import Array, Signal

FEWEST = 20  # changes that have to agree; by chance half of them would rule out any grid
PHASES = 1000  # that are tried
OFTENER = 0.75  # of the period, at most: rows that come often enough to sample commands
MOST_ROWS = 0.9  # of a command's stamps that are a sensor's
NARROW = 0.5  # of a row: how well the changes have to tell the phase
STRAIGHT = 1e-9  # of the command's range: second differences of a straight line by rounding


def as_given(name: str, command: Signal, sensors: Sequence[Signal], period: float) -> Signal:
    """Return a command with its changes when they were given, if it was sampled with a sensor.

    period: s, between two commands, 0 where it is not stated. As it is where it has stamps of its
    own, and where its changes agree with no grid of that period. Raises InputError for one that
    was interpolated between commands.
    """
    rows = np.diff(command.time)
    if period == 0.0 or np.median(rows) > OFTENER * period or not _in_rows(command, sensors):
        return command
    changed = np.flatnonzero(np.diff(command.value)) + 1
    phase = _phase(command.time[changed - 1], command.time[changed], period)
    if phase is not None:
        kept = np.append(0, changed)
        earlier = (command.time[changed] - phase) % period
        time = np.append(command.time[0], command.time[changed] - earlier)
        return replace(command, time=time, value=command.value[kept])
    if _is_interpolated(command, period):
        raise InputError(
            f"{name}: valve_command runs in straight lines from one command to the next, every"
            f" {period:g} s: it was interpolated; record it as it was given, held in between"
        )
    return command


def _in_rows(command: Signal, sensors: Sequence[Signal]) -> bool:
    """Tell whether the command has the stamps of a sensor."""
    return any(np.mean(np.isin(command.time, sensor.time)) > MOST_ROWS for sensor in sensors)


def _phase(earliest: Array, latest: Array, period: float) -> float | None:
    """Return the phase of a grid with a point in each interval, (n,) s, if the intervals tell it.

    An interval's end belongs to it, its begin does not.
    """
    if earliest.size < FEWEST:
        return None
    phases = period * np.arange(PHASES) / PHASES
    agrees = np.ones(PHASES, dtype=bool)
    for early, late in zip(earliest, latest, strict=True):
        agrees &= (late - phases) % period < late - early
    return _middle(agrees, period, NARROW * float(np.median(latest - earliest)))


def _middle(agrees: NDArray[np.bool_], period: float, widest: float) -> float | None:
    """Return the middle of the phases that agree, s, where they lie together and are few."""
    found = np.flatnonzero(agrees)
    if found.size == 0:
        return None
    turned = (found - found[0] + PHASES // 2) % PHASES  # around the circle, from opposite
    if period * np.ptp(turned) / PHASES > widest:
        return None
    return float(period * (np.mean(turned) - PHASES // 2 + found[0]) / PHASES % period)


def _is_interpolated(command: Signal, period: float) -> bool:
    """Tell whether a command bends on a grid of a period alone, and is straight in between."""
    slope = np.diff(command.value) / np.diff(command.time)
    bends = np.abs(np.diff(slope)) * np.median(np.diff(command.time))
    bent = np.flatnonzero(bends > STRAIGHT * np.ptp(command.value)) + 1
    if bent.size < FEWEST:
        return False
    first = np.append(True, np.diff(bent) > 1)
    begins, ends = bent[first], bent[np.append(first[1:], True)]
    inside = ends - begins <= 1  # a bend between two rows shows in both, or hardly in one of them
    alone = begins == ends
    earliest, latest = command.time[begins - alone], command.time[ends + alone]
    return bool(np.all(inside)) and _phase(earliest, latest, period) is not None
