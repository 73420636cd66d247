"""A curve through evenly spaced points, for what is measured and has no formula."""

from typing import Any, NamedTuple

from emir_plant.jit import compiled

POINTS = 33  # 15 mm apart over 0.5 m of stroke
ZERO = (0.0,) * POINTS


class Place(NamedTuple):
    """Where on a curve: behind which of its points, and by what share of the way to the next."""

    point: int
    share: float


@compiled
def place(signal: float, first: float, last: float) -> Place:
    """Return where a signal is on a curve from its first to its last point, at an end beyond."""
    position = (signal - first) / (last - first) * (POINTS - 1)
    position = min(max(position, 0.0), POINTS - 1.0)
    point = min(int(position), POINTS - 2)
    return Place(point, position - point)


@compiled
def value(points: Any, at: Place) -> float:
    """Return the cubic between two of the points, (POINTS,), with the slopes of chords.

    At a point that of its neighbours' chord (Catmull and Rom 1974), at the ends of the last one.
    """
    k, t = at.point, at.share
    here, there = points[k], points[k + 1]
    before = points[k - 1] if k > 0 else 2.0 * here - there
    behind = points[k + 2] if k < POINTS - 2 else 2.0 * there - here
    start, end = 0.5 * (there - before), 0.5 * (behind - here)
    bend = t * (1.0 - t) * ((1.0 - t) * (start - there + here) - t * (end - there + here))
    result: float = here + t * (there - here) + bend
    return result
