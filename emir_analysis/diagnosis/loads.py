"""A load over time: which swing and which stretch of time explain what is missing.

What the loads of single windows change, in whatever is looked at (the force balance or the free
run), adds up to what any load changes. So with the inner products of these changes, found once,
loads of all frequencies, begins and durations are compared by least squares.
"""

import math
from typing import NamedTuple

import numpy as np

from emir_analysis.signals import Array
from emir_plant.effects.external_load import ExternalLoad

LOAD = "external_load"  # in the registry
FASTEST = 0.5  # Hz: faster swings average out over the windows of the force balance
FREQUENCIES = 4  # that are tried in a bandwidth of 1 / duration
FEWEST = 8  # windows over which a load has to swing
SHORTEST = 4  # windows over which a load has to last
RISES = (2.0, 4.0, 8.0, 16.0, 32.0)  # s, over which a load that stays may come
FOR_EVER = 1e5  # s
INSTANTS = 200  # of a mean over time
WEAK = 1e-9  # relative to what the strongest window's load changes: less is as good as nothing


class Load(NamedTuple):
    """M + F exp(-d s) cos(2 pi f s + phase), s = t - begin: N, N, Hz, rad, s, s, s, 1/s."""

    force: float
    mean: float
    frequency: float
    phase: float
    begin: float
    rise: float
    duration: float
    decay: float = 0.0


def constant(force: float, begin: float, duration: float) -> Load:
    """Return a load of a force, N, that sets in, s, and ends at once after a duration, s."""
    return Load(force, 0.0, 0.0, 0.0, begin, 0.0, duration)


class Response(NamedTuple):
    """What loads of 1 N change and how much of it is missing.

    begin: (w,) s, of windows of equal length. gram: (w, w) 1/N^2, inner products of what a load
    in each window changes. right: (w,) 1/N, of what it changes with what is missing.
    """

    begin: Array
    gram: Array
    right: Array


def of_force(time: Array, force: Array) -> Response:
    """Return the response of a force, (w,) N, missing at equally spaced times, (w,) s.

    A constant force is none that depends on time.
    """
    centred = np.eye(force.size) - 1.0 / force.size
    return Response(time - 0.5 * (time[1] - time[0]), centred, centred @ force)


def of_steps(begin: Array, changed: Array, missing: Array) -> Response:
    """Return the response of a system to loads that stay, begun at times (w,) s.

    changed: (w, n) by a load of 1 N each, missing: (n,) what loads ought to change.
    """
    windows = changed - np.vstack([changed[1:], np.zeros(missing.size)])
    return Response(begin, windows @ windows.T, windows @ missing)


def likely(response: Response) -> list[Load]:
    """Return the best of each kind of load.

    A swing from the start on and one from later on, a gust, a load that stays, one that comes
    slowly and stays.
    """
    return [*swings(response), *steady(response), slow(response)]


def steady(response: Response) -> tuple[Load, Load]:
    """Return the constant load that ends and the one that sets in and stays that explain most."""
    begin, gram, right = response
    corner = np.zeros((begin.size + 1, begin.size + 1))
    corner[1:, 1:] = np.cumsum(np.cumsum(gram, axis=0), axis=1)
    total = np.concatenate([[0.0], np.cumsum(right)])
    first, last = np.triu_indices(total.size, SHORTEST)
    square = corner[last, last] + corner[first, first] - 2.0 * corner[first, last]
    square = np.maximum(square, WEAK * gram.max())
    along = total[last] - total[first]
    found = []
    for stays in (False, True):
        gained = np.where((last == begin.size) == stays, along**2 / square, -1.0)
        best = int(np.argmax(gained))
        i, j = int(first[best]), int(last[best])
        duration = FOR_EVER if stays else float(begin[j] - begin[i])
        force = float(along[best] / square[best])
        found.append(constant(force, float(begin[i]), duration))
    return found[0], found[1]


def slow(response: Response) -> Load:
    """Return the load that comes along a straight line and stays that explains most."""
    begin, gram, right = response
    middle = begin + 0.5 * (begin[1] - begin[0])
    best = (-1.0, constant(0.0, float(begin[0]), FOR_EVER))
    for rise in RISES:
        share = np.clip((middle - begin[:-SHORTEST, None]) / rise, 0.0, 1.0)
        square = np.maximum(np.sum((share @ gram) * share, axis=1), WEAK * gram.max())
        along = share @ right
        gained = along**2 / square
        k = int(np.argmax(gained))
        load = constant(float(along[k] / square[k]), float(begin[k]), FOR_EVER)
        best = max(best, (float(gained[k]), load._replace(rise=rise)))
    return best[1]


def swings(response: Response) -> tuple[Load, Load]:
    """Return the load from the start on and the one setting in later that explain most.

    Each swings about a mean of its own.
    """
    begin, gram, right = response
    window = float(begin[1] - begin[0])
    length = window * begin.size
    after, behind = np.triu(gram), np.triu(gram, 1)
    always, later = [], []
    for f in np.arange(1, int(FASTEST * FREQUENCIES * length)) / (FREQUENCIES * length):
        wave = np.exp(2j * np.pi * f * (begin + 0.5 * window))
        columns = np.stack([wave.real, wave.imag, np.ones(begin.size)])
        # sums from each begin to the end: the normal equations of all begins at once
        along = _to_the_end(columns * right)[:, :-FEWEST]
        normal = np.empty((along.shape[1], len(columns), len(columns)))
        for row, one in enumerate(columns):
            for column, other in enumerate(columns):
                both = one * (after @ other) + other * (behind @ one)
                normal[:, row, column] = _to_the_end(both)[:-FEWEST]
        normal += WEAK * gram.max() * np.eye(len(columns))
        solved = np.linalg.solve(normal, along.T[:, :, None])[:, :, 0]
        gained = np.sum(solved * along.T, axis=1)
        late = 1 + int(np.argmax(gained[1:]))
        always.append((gained[0], _swing(f, solved[0], 0.0)))
        later.append((gained[late], _swing(f, solved[late], float(begin[late]))))
    return max(always)[1], max(later)[1]


def _swing(frequency: float, parts: Array, begin: float) -> Load:
    """Return a swing from the parts of it, (3,) N: as cosine and sine of time, and its mean."""
    a, b, mean = parts
    phase = math.remainder(math.atan2(-b, a) + 2.0 * math.pi * frequency * begin, 2.0 * math.pi)
    return Load(math.hypot(a, b), float(mean), float(frequency), phase, begin, 0.0, FOR_EVER)


def _to_the_end(values: Array) -> Array:
    """Return the sums of rows, (..., w), from each place to the end."""
    return np.cumsum(values[..., ::-1], axis=-1)[..., ::-1]


def mean_while_it_acts(load: ExternalLoad, end: float) -> float:
    """Return a load's mean, N, over what of its time lies in a recording up to its end, s."""
    begin, end = max(load.start, 0.0), min(load.start + load.duration, end)
    since = np.linspace(begin, end, INSTANTS) - load.start
    swing = np.exp(-load.decay * since) * np.cos(2.0 * np.pi * load.frequency * since + load.phase)
    return load.mean + load.force * float(np.mean(swing))
