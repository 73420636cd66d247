"""A curve through evenly spaced points, for what is measured and has no formula."""

from typing import Any, NamedTuple

from emir_plant.jit import compiled

POINTS = 33  # 15 mm apart over 0.5 m of stroke
ZERO = (0.0,) * POINTS


class Place(NamedTuple):
    """Where on a curve: behind which of its points, and by what share of the way to the next.

    A share below 0 or above 1 is beyond the first or the last point.
    """

    point: int
    share: float


@compiled
def place(signal: float, first: float, last: float, points: int = POINTS) -> Place:
    """Return where a signal is on a curve that goes straight on beyond its ends."""
    position = (signal - first) / (last - first) * (points - 1)
    point = int(min(max(position, 0.0), points - 2.0))
    return Place(point, position - point)


@compiled
def place_within(signal: float, first: float, last: float, points: int = POINTS) -> Place:
    """Return where a signal is on a curve that stays beyond its ends as it is there."""
    return place(min(max(signal, first), last), first, last, points)


@compiled
def value(points: Any, at: Place) -> float:
    """Return the cubic between two of the points, (p,), with the slopes of chords.

    At a point that of its neighbours' chord (Catmull and Rom 1974), at the ends of the last one.
    """
    k, t = at.point, at.share
    here, there = points[k], points[k + 1]
    straight: float = here + t * (there - here)
    if t < 0.0 or t > 1.0:
        return straight
    before = points[k - 1] if k > 0 else 2.0 * here - there
    behind = points[k + 2] if k < len(points) - 2 else 2.0 * there - here
    start, end = 0.5 * (there - before), 0.5 * (behind - here)
    bent = (1.0 - t) * (start - there + here) - t * (end - there + here)
    result: float = straight + t * (1.0 - t) * bent
    return result
