"""Weighted nonlinear least squares with all finite differences simulated in parallel."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from emir_analysis.signals import Array

STEP = 1e-3  # of the finite differences, in units of the tolerance or the trial value
TOLERANCE_SPREAD = 1.0 / np.sqrt(3.0)  # standard deviation of a parameter inside its tolerance

Model = Callable[[Array], Array]  # (m, k) vectors -> (m, n) residuals in units of the noise


@dataclass(frozen=True)
class Solution:
    """x: (k,). spread: (k,) standard deviations from the curvature at the optimum.

    evaluations: of the model, beside those for the Jacobian.
    """

    x: Array
    spread: Array
    evaluations: int


def fit(
    model: Model,
    start: Array,
    bounds: tuple[Array, Array],
    stated: Array,
    robust: bool = False,
    accuracy: float = 1e-6,
    evaluations: int = 30,
) -> Solution:
    """Minimise the squared residuals of a model inside bounds.

    stated: (k,) true for parameters that a maker states: they are held to their stated value as
    weakly as their tolerance says, so that what the data cannot tell stays where it is.
    robust: residuals far above the noise count by their size, not by its square.
    """
    low, high = bounds
    held = np.flatnonzero(stated)

    def residuals(x: Array) -> Array:
        return np.concatenate([model(x[None])[0], x[held] / TOLERANCE_SPREAD])

    def jacobian(x: Array) -> Array:
        steps = np.where(x + STEP > high, -STEP, STEP)
        values = model(np.vstack([x, x + np.diag(steps)]))
        slopes = (values[1:] - values[0]) / steps[:, None]
        prior = np.eye(x.size)[held] / TOLERANCE_SPREAD
        # a neighbour that cannot be simulated says nothing about the slope
        return np.vstack([np.nan_to_num(slopes.T, posinf=0.0, neginf=0.0), prior])

    margin = 1e-6 * (high - low)
    result = least_squares(
        residuals,
        np.clip(start, low + margin, high - margin),
        jac=jacobian,
        bounds=bounds,
        loss="soft_l1" if robust else "linear",
        xtol=accuracy,
        ftol=accuracy,
        max_nfev=evaluations,
    )
    inverse = np.linalg.pinv(result.jac.T @ result.jac)
    # misfit beyond the noise widens the spread: the noise is not all that the model leaves
    excess = max(1.0, float(np.mean(np.square(result.fun))))
    return Solution(result.x, np.sqrt(np.diag(inverse) * excess), result.nfev)
