"""The shape of an unexplained residual: the signal that predicts it best, and a table of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_analysis.signals import Array

BINS = 15
FEWEST = 3  # windows in a bin that count as a mean
SAME_SHARE = 0.02  # difference of two shares below which the simpler function is taken
FOLDS = 3  # of the recording; each is predicted from the others
PREDICTED_SHARE = 0.5  # share of the variance from which on a signal is said to predict a residual


@dataclass(frozen=True)
class Shape:
    """A residual as a static function of one signal.

    predictor: name of the signal, or nothing where it is a constant. by_direction: one function
    for each sign of the velocity. share: part of the residual's variance so predicted in parts of
    the recording left out. table: rows (signal, mean residual while lowering, while lifting); NaN
    where never visited.
    """

    predictor: str
    unit: str
    by_direction: bool
    share: float
    table: tuple[tuple[float, float, float], ...]


def best_shape(residual: Array, velocity: Array, predictors: dict[str, tuple[str, Array]]) -> Shape:
    """Return the static function of one signal that predicts a residual best.

    residual, velocity and the predictors' values: (w,). predictors: name -> (unit, values).
    Of functions that predict alike the simpler one, without the direction, is taken, and before
    all a constant.
    """
    found: list[Shape] = []
    signals = {"": ("1", np.zeros_like(residual))} | predictors
    for by_direction in (False, True):
        up = (velocity > 0.0) & by_direction
        for name, (unit, values) in (predictors if by_direction else signals).items():
            bins = _bins(values)
            share = _predicted_share(residual, bins, up)
            table = _table(residual, values, bins, velocity > 0.0)
            found.append(Shape(name, unit, by_direction, share, table))
    most = max(shape.share for shape in found)
    return next(shape for shape in found if shape.share > most - SAME_SHARE)


def _bins(values: Array) -> NDArray[np.intp]:
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    return np.clip(np.digitize(values, edges) - 1, 0, BINS - 1)


def _predicted_share(residual: Array, bins: NDArray[np.intp], up: NDArray[np.bool_]) -> float:
    """Return 1 - unexplained/total variance; each part is predicted from the others' means."""
    cell = bins + BINS * up
    part = np.arange(residual.size) * FOLDS // residual.size
    predicted = np.zeros_like(residual)
    for k in range(FOLDS):
        seen, unseen = part != k, part == k
        count = np.bincount(cell[seen], minlength=2 * BINS)
        total = np.bincount(cell[seen], residual[seen], minlength=2 * BINS)
        mean = np.where(count >= FEWEST, total / np.maximum(count, 1), 0.0)
        predicted[unseen] = mean[cell[unseen]]
    return float(1.0 - np.sum((residual - predicted) ** 2) / np.sum(residual**2))


def _table(
    residual: Array, values: Array, bins: NDArray[np.intp], up: NDArray[np.bool_]
) -> tuple[tuple[float, float, float], ...]:
    def mean(chosen: NDArray[np.bool_]) -> float:
        return float(residual[chosen].mean()) if chosen.sum() >= FEWEST else float("nan")

    return tuple(
        (float(values[bins == k].mean()), mean((bins == k) & ~up), mean((bins == k) & up))
        for k in range(BINS)
        if np.any(bins == k)
    )
