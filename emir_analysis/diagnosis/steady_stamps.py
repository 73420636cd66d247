"""Stamps that scatter about a steady period, where the readings were steady and came late.

What is stamped when it arrives is late by another time each. A reading then lies nearer to the
line through its neighbours at steady times than at their stamps; where a sensor was really read
unsteadily, at its stamps. All sensors together tell which of both it is.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import skew

from emir_analysis.diagnosis.recording_checks import stamps
from emir_analysis.signals import Array, Signal

SCATTER = 2e-4  # s, from which on it matters
SMOOTHER = 0.1  # by how much, relative, of all sensors together
ONE_SIDED = 0.5  # skewness of the delays: what only ever adds to them
EARLIEST = 0.01  # share of the readings that come about as early as any can
MOST_LATE = 0.5  # of the period, standard deviation: more, and there is no steady one
FIRST = 512  # readings by which the period is first told
NEAR = 0.05  # relative, to which the median gap tells it
FINELY = 0.1  # turns in the time that is looked at, from one frequency of a search to the next


def steadied(sensors: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return the signals that scatter with steady stamps, if they are the smoother for it.

    Empty where they are not, or none scatters.
    """
    scattered = {n: s for n, s in sensors.items() if stamps(s).scatter > SCATTER}
    steady, smoother = {}, 0.0
    for name, signal in scattered.items():
        time = _steady(signal.time)
        if time is None:
            return {}
        steady[name] = replace(signal, time=time)
        if np.ptp(signal.value) > 0.0:
            smoother += np.log(_roughness(signal) / _roughness(steady[name]))
    return steady if smoother > SMOOTHER else {}


def steadied_told(name: str, sensors: Mapping[str, Signal], steady: Iterable[str]) -> list[str]:
    """Return what was done to a recording of that name, in a line if it was anything."""
    scatter = {n: 1e3 * stamps(sensors[n]).scatter for n in steady}
    if not scatter:
        return []
    line = (
        f"{name}: stamps of {', '.join(scatter)} scatter by {max(scatter.values()):.1f} ms about a"
        " period that their readings keep; taken at the times of that"
    )
    return [line]


def _steady(given: Array) -> Array | None:
    """Return the steady times, (n,) s, of readings that were given stamps, (n,) s.

    The earliest ones where stamps are late on one side: none comes before its reading. None where
    there is no steady period.
    """
    frequency = _frequency(given)
    phase = np.angle(np.exp(2j * np.pi * frequency * given).mean()) / (2.0 * np.pi)
    places = np.arange(given.size)
    count = np.rint(given * frequency - phase) - places
    # one that is late by more than half a period has come before the next all the same
    count = np.minimum.accumulate(count[::-1])[::-1] + places
    period = np.polyfit(count, given, 1)[0]
    late = given - period * count
    if np.std(late) > MOST_LATE * period:
        return None
    begin = np.quantile(late, EARLIEST) if skew(late) > ONE_SIDED else late.mean()
    return np.asarray(period * count + begin)


def _frequency(given: Array) -> float:
    """Return the frequency, Hz, at which most stamps come at the same phase."""
    frequency = 1.0 / float(np.median(np.diff(given)))
    span, count = NEAR * frequency, FIRST
    while True:
        seen = given[:count] - given[0]
        each = frequency + np.arange(-span, span, FINELY / seen[-1])
        together = [abs(np.exp(2j * np.pi * f * seen).mean()) for f in each]
        frequency = float(each[int(np.argmax(together))])
        if count >= given.size:
            return frequency
        span, count = 1.0 / float(seen[-1]), 2 * count


def _roughness(signal: Signal) -> float:
    """Return the RMS, in its unit, by which readings lie off the line through both neighbours.

    In proportion to what noise alone leaves of them.
    """
    time, value = signal.time, signal.value
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = value[1:-1] - (1.0 - share) * value[:-2] - share * value[2:]
    return float(np.sqrt(np.mean(off**2 / (1.0 + share**2 + (1.0 - share) ** 2))))
