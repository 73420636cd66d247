"""What swings with time whatever the machine does: a hunting pump, a null that wanders.

No static function of a signal predicts it. One of which every value swings by itself does:

    residual = a(s) + b(s) cos(2 pi f t) + c(s) sin(2 pi f t)

with a, b and c constant over each of a few bins of a signal s, or over all. f is the frequency
that predicts best what parts of the recording left out show (as a periodogram's largest line, but
judged on what it has not seen).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_analysis.diagnosis.shape import FOLDS, PREDICTED_SHARE, SAME_SHARE, Shape
from emir_analysis.signals import Array

BINS = 5  # of a signal: each has three unknowns
STEPS = 10  # frequencies in the width of a line, one over the recording's length
AT_ONCE = 100  # frequencies: all of a long recording would need memory by its length's square
HIGHEST = 1.5  # Hz; the balances' windows of half a second show little of what swings faster
DOUBT = 1.0  # windows of no residual that each bin is taken to have seen besides
TAKEN = 0.7  # least part of what no static function predicts that a swing has to ...
STATIC = 0.9  # and the most that one may predict: beyond, whatever moves over its range swings


@dataclass(frozen=True)
class Swing:
    """A residual as a function of one signal that swings with time.

    predictor: name of the signal, or nothing where it is the same at all values. period: s.
    share: part of the residual's variance so predicted in parts of the recording left out.
    table: rows (mean of the signal, steady part, amplitude), in the signal's and the residual's
    units.
    """

    predictor: str
    unit: str
    period: float
    share: float
    table: tuple[tuple[float, float, float], ...]


def swing(
    residual: Array, time: Array, predictors: dict[str, tuple[str, Array]], shape: Shape
) -> Swing | None:
    """Return how a residual swings with time, if that is what it does. shape: the best static one.

    Arguments else as for `best_swing`.
    """
    found = best_swing(residual, time, predictors)
    left = 1.0 - max(shape.share, 0.0)
    told = found.share >= PREDICTED_SHARE and 1.0 - found.share <= (1.0 - TAKEN) * left
    return found if told and shape.share < STATIC else None


def best_swing(residual: Array, time: Array, predictors: dict[str, tuple[str, Array]]) -> Swing:
    """Return the function of one signal, swinging with time, that predicts a residual best.

    residual, time, s, and the predictors' values: (w,). predictors: name -> (unit, values). Of
    two that predict alike the first is taken, and before all one that knows no signal.
    """
    length = float(time[-1] - time[0])
    frequencies = np.arange(1.0, HIGHEST * length, 1.0 / STEPS) / length
    signals = {"": ("1", np.zeros_like(time))} | predictors
    found: dict[str, list[Array]] = {name: [] for name in signals}
    for some in np.array_split(frequencies, frequencies.size // AT_ONCE + 1):
        basis = _basis(some, time)
        for name, (_, values) in signals.items():
            found[name].append(_shares(residual, basis, _bins(values)))
    shares = {name: np.concatenate(parts) for name, parts in found.items()}
    most = max(float(share.max()) for share in shares.values())
    name = next(name for name, share in shares.items() if share.max() > most - SAME_SHARE)
    at = int(np.argmax(shares[name]))
    unit, values = signals[name]
    bins = _bins(values)
    sizes = _fitted(residual, _basis(frequencies[[at]], time), bins)[:, 0]
    table = tuple(
        (float(values[bins == k].mean()), float(a), float(np.hypot(b, c)))
        for k, (a, b, c) in enumerate(sizes)
        if np.any(bins == k)
    )
    return Swing(name, unit, 1.0 / float(frequencies[at]), float(shares[name][at]), table)


def by_swing(swing: Swing, residual: Array, time: Array, values: Array) -> Array:
    """Return a residual as its swing has it, (w,). values: of the predictor, (w,)."""
    basis, bins = _basis(np.array([1.0 / swing.period]), time), _bins(values)
    return np.asarray(np.einsum("awf,wfa->w", basis, _fitted(residual, basis, bins)[bins]))


def _bins(values: Array) -> NDArray[np.intp]:
    inner = np.linspace(values.min(), values.max(), BINS + 1)[1:-1]
    return np.digitize(values, inner)


def _basis(frequencies: Array, time: Array) -> Array:
    """Return 1, cosine and sine, (3, w, f)."""
    phase = 2.0 * np.pi * time[:, None] * frequencies
    return np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])


def _fitted(residual: Array, basis: Array, bins: NDArray[np.intp]) -> Array:
    """Return the sizes, (BINS, f, 3), of basis functions, (3, w, f), in each bin."""
    inside = np.eye(BINS)[bins].T
    gram = np.einsum("awf,bwf->wfab", basis, basis)
    moment = residual[:, None, None] * np.moveaxis(basis, 0, -1)
    normal = np.tensordot(inside, gram, 1) + DOUBT * np.eye(3)
    right = np.tensordot(inside, moment, 1)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])


def _shares(residual: Array, basis: Array, bins: NDArray[np.intp]) -> Array:
    """Return 1 - unexplained/total variance, (f,), each part predicted from the others."""
    part = np.arange(residual.size) * FOLDS // residual.size
    missed = np.zeros(basis.shape[2])
    for k in range(FOLDS):
        seen, unseen = part != k, part == k
        sizes = _fitted(residual[seen], basis[:, seen], bins[seen])
        predicted = np.einsum("awf,wfa->wf", basis[:, unseen], sizes[bins[unseen]])
        missed += np.sum((residual[unseen, None] - predicted) ** 2, axis=0)
    return np.asarray(1.0 - missed / np.sum(residual**2))
