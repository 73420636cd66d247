"""Where most of a residual lies: in which stretch of time, and beyond which level of a signal.

What sets in beyond a level that was passed once (a pump that is short of oil, a transducer at its
end) no other part of the recording foretells, and no function of a signal that is judged on parts
left out.
"""

from dataclasses import dataclass

import numpy as np

from emir_analysis.signals import Array

LOCATED = 0.9  # share of the squares above the noise, whose time and level are told
FEW = 0.25  # of the windows: what lies beyond a level has to lie in no more
TIGHT = 2.0  # times as many windows as the largest ones that make up as much, at most


@dataclass(frozen=True)
class Where:
    """The shortest stretch of time with most of a residual, s, and the level beyond which it lies.

    Of several recordings the time is counted on from one to the next.

    side: "above" or "below" the level of the signal, in its unit; all None without one.
    """

    begin: float
    end: float
    signal: str | None = None
    unit: str | None = None
    side: str | None = None
    level: float | None = None


def where(
    residual: Array, noise: float, time: Array, signals: dict[str, tuple[str, Array]]
) -> Where:
    """Return where most of a residual lies.

    residual, time, s, and the signals' values: (w,). noise: level of the residual without what is
    missing. signals: name -> (unit, values).
    """
    loud = np.maximum(residual**2 - noise**2, 0.0)
    begin, end = _stretch(loud, time)
    beyond = [
        (_count(loud[order]), name, side, order)
        for name, (_, values) in signals.items()
        for side, order in (("above", np.argsort(-values)), ("below", np.argsort(values)))
    ]
    count, name, side, order = min(beyond, key=lambda b: b[0])
    if count > min(FEW * loud.size, TIGHT * _count(np.sort(loud)[::-1])):
        return Where(begin, end)
    unit, values = signals[name]
    return Where(begin, end, name, unit, side, float(values[order[count - 1]]))


def _count(loud: Array) -> int:
    """Return how many of the first values, (w,), make up most of all."""
    return int(np.searchsorted(np.cumsum(loud), LOCATED * np.sum(loud))) + 1


def _stretch(loud: Array, time: Array) -> tuple[float, float]:
    """Return begin and end, s, of the shortest stretch with most of the values, (w,)."""
    total = np.concatenate([[0.0], np.cumsum(loud)])
    ends = np.searchsorted(total, total[:-1] + LOCATED * total[-1])
    inside = ends <= loud.size
    starts = np.arange(loud.size)[inside]
    best = int(np.argmin(ends[inside] - starts))
    return float(time[starts[best]]), float(time[ends[inside][best] - 1])
