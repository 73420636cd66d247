"""When a balance speaks that is quiet nearly all of the time: what acts seldom, but loudly.

A level is taken over the quieter windows and does not know of it.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.signals import Array

LOUD = 10.0  # times the noise; slight errors of parameters make less in the few worst windows
APART = 1.0  # s, without a loud window between two moments
TOLD = 4  # of a balance's moments, the loudest


@dataclass(frozen=True)
class Moments:
    """The loudest moments of one balance. size: the largest residual. times: s, in their order.

    more: how many there are besides.
    """

    size: float
    times: tuple[float, ...]
    more: int


def moments(residual: Array, noise: float, time: Array) -> Moments | None:
    """Return when a balance speaks loudly; None: never.

    residual and time, s, of its windows: (w,). noise: its level without what is missing; where that
    is 0 or NaN it has nothing to say.
    """
    if not noise > 0.0:
        return None
    size = np.abs(residual)
    loud = np.flatnonzero(size > LOUD * noise)
    if not loud.size:
        return None
    groups = np.split(loud, np.flatnonzero(np.diff(time[loud]) > APART) + 1)
    peaks = [int(group[np.argmax(size[group])]) for group in groups]
    told = sorted(sorted(peaks, key=lambda k: -size[k])[:TOLD])
    times = tuple(float(time[k]) for k in told)
    return Moments(float(size.max()), times, len(peaks) - len(told))
