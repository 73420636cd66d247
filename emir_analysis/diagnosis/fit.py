"""Weighted nonlinear least squares with all finite differences simulated in parallel."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from emir_analysis.signals import Array

STEP = 1e-3  # of the finite differences, in units of the tolerance or the trial value
TOLERANCE_SPREAD = 1.0 / math.sqrt(3.0)  # standard deviation of a parameter inside its tolerance
HELD = 0.1  # residual, in units of the noise, of a parameter one off where its fit begins
LEAST_STEP = 1e-5  # relative, of the change: not met because steps that lead nowhere were cut
EVALUATIONS = 20  # of the model in one fit, beside those for the Jacobian


@dataclass(frozen=True)
class Problem:
    """Residuals to be made small.

    model: (m, k) vectors -> (m, n) residuals in units of the noise. start, low, high: (k,).
    stated: (k,) true for parameters that a maker states: they are held to their stated value as
    weakly as their tolerance says, so that what the data cannot tell stays where it is.
    coarse: a cheaper model with the same slopes, from which the Jacobian is taken. step: of its
    finite differences.
    """

    model: Callable[[Array], Array]
    start: Array
    low: Array
    high: Array
    stated: NDArray[np.bool_]
    coarse: Callable[[Array], Array] | None = None
    step: float = STEP


@dataclass(frozen=True)
class Solution:
    """x: (k,). covariance: (k, k) from the curvature at the optimum. misfit: RMS residual.

    The variance of what the residuals do not depend on is infinite.
    """

    x: Array
    covariance: Array
    misfit: float

    def drawn(self, count: int) -> Array:
        """Return vectors, (count, k), drawn from the normal distribution; what is untold stays.

        The same ones every time.
        """
        told = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        random = np.random.default_rng(0)
        return random.multivariate_normal(self.x, told, count, method="eigh")


def fit(problem: Problem, accuracy: float, *, robust: bool = False) -> Solution:
    """Minimise the squared residuals of a problem inside its bounds.

    accuracy: relative, of the cost. robust: residuals far above the noise count by their
    size, not by its square.
    """
    low, high = problem.low, problem.high
    margin = 1e-6 * np.minimum(high - low, 1.0)
    start = np.clip(problem.start, low + margin, high - margin)
    # What neither data nor maker tell is held where it begins: with a singular Jacobian the
    # trust region's step would be filled up with it, by an amount that rounding decides.
    weight = np.where(problem.stated, 1.0 / TOLERANCE_SPREAD, HELD)
    expected = np.where(problem.stated, 0.0, start)

    def residuals(change: Array) -> Array:
        x = start + change
        return np.concatenate([problem.model(x[None])[0], weight * (x - expected)])

    def jacobian(change: Array) -> Array:
        x = start + change
        steps = np.where(x + problem.step > high, -problem.step, problem.step)
        values = (problem.coarse or problem.model)(np.vstack([x, x + np.diag(steps)]))
        slopes = (values[1:] - values[0]) / steps[:, None]
        # a neighbour that cannot be simulated says nothing about the slope
        return np.vstack([np.nan_to_num(slopes.T, posinf=0.0, neginf=0.0), np.diag(weight)])

    # As a change from the start, since the trust region is at first as large as what it is given,
    # or one for zero: where a fit begins is no measure of how far a first step may lead.
    result = least_squares(
        residuals,
        np.zeros_like(start),
        jac=jacobian,
        bounds=(low - start, high - start),
        loss="soft_l1" if robust else "linear",
        xtol=LEAST_STEP,
        ftol=accuracy,
        max_nfev=EVALUATIONS,
    )
    curvature = np.asarray(result.jac)
    inverse = np.linalg.pinv(curvature.T @ curvature)
    # misfit beyond the noise widens the spread: the noise is not all that the model leaves
    excess = max(1.0, float(np.mean(np.square(result.fun))))
    covariance = inverse * excess
    untold = np.flatnonzero(~np.any(curvature[: -start.size], axis=0) & ~problem.stated)
    covariance[untold, untold] = np.inf
    return Solution(
        np.clip(start + result.x, low, high),
        covariance,
        math.sqrt(2.0 * result.cost / result.fun.size),
    )
