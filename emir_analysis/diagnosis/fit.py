"""Weighted nonlinear least squares with all finite differences simulated in parallel."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from emir_analysis.signals import Array

STRAIGHT_STEP = 1e-6  # as DIFFERENCE_STEP, so short that slopes are straight
DIFFERENCE_STEP = 1e-3  # of the finite differences, in units of the tolerance or the trial value
TOLERANCE_SPREAD = 1.0 / math.sqrt(3.0)  # standard deviation of a parameter inside its tolerance
HELD = 0.1  # residual, in units of the noise, of a parameter one off where its fit begins
LEAST_STEP = 1e-5  # relative, of the change: not met because steps that lead nowhere were cut
DESCENTS = 20  # steps of a descent at most
DAMPINGS = np.geomspace(1.0, 1e-8, 9)  # of its steps, in units of the largest curvature
REACH = 10.0  # standard deviations of a principal axis, over which a descent takes slopes ...
LONGEST = 0.3  # and the most, in units of the tolerance or the trial value
FAR = 2.0  # times the cost: a step that leads there says nothing about slopes
OUT_OF_BOUNDS = 1e12  # times the noise: a run that is further off is out of all bounds
TOLD_CURVATURE = 1.0 + 1e-6  # times the curvature of what holds a parameter: more, and data tell
KEPT = 0.3  # of what slopes promise a step has to take away for them to be kept for the next
FOLLOWED = 0.6  # the same of those that a trust region is led by: in bent valleys less leads astray
EVALUATIONS = 60  # of the model in one fit, beside those for the slopes


@dataclass(frozen=True)
class Problem:
    """Residuals to be made small.

    model: (m, k) vectors -> (m, n) residuals in units of the noise. start, low, high: (k,).
    stated: (k,) true for parameters that a maker states: they are held to their stated value as
    weakly as their tolerance says, so that what the data cannot tell stays where it is.
    coarse: a cheaper model with the same slopes, from which the Jacobian is taken. step: of its
    finite differences, one or (k,). curvature: (k, k) of a fit to a part of the data, if there was
    one: a descent takes its first slopes along its principal axes.
    """

    model: Callable[[Array], Array]
    start: Array
    low: Array
    high: Array
    stated: NDArray[np.bool_]
    coarse: Callable[[Array], Array] | None = None
    step: float | Array = DIFFERENCE_STEP
    curvature: Array | None = None


@dataclass(frozen=True)
class Solution:
    """x: (k,). covariance: (k, k) from the curvature at the optimum. misfit: RMS residual.

    The variance of what the residuals do not depend on is infinite. curvature: (k, k), half the
    second derivatives of the squared residuals.
    """

    x: Array
    covariance: Array
    misfit: float
    curvature: Array

    def drawn(self, count: int) -> Array:
        """Return vectors, (count, k), drawn from the normal distribution; what is untold stays.

        The same ones every time.
        """
        told = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        random = np.random.default_rng(0)
        return random.multivariate_normal(self.x, told, count, method="eigh")


def fit(
    problem: Problem, accuracy: float, *, robust: bool = False, evaluations: int = EVALUATIONS
) -> Solution:
    """Minimise the squared residuals of a problem inside its bounds.

    accuracy: relative, of the cost. robust: residuals far above the noise count by their
    size, not by its square. evaluations: of the model at most, beside those for slopes.
    A start that cannot be simulated is returned with an infinite misfit.
    """
    low, high = problem.low, problem.high
    margin = 1e-6 * np.minimum(high - low, 1.0)
    start = np.clip(problem.start, low + margin, high - margin)
    held = _Held(problem, start)
    course = _Course(held, robust=robust)
    if not np.all(np.isfinite(course.residuals(start))):
        return _impossible(start)
    x, spent = start, 0
    while True:
        x = np.clip(x, low + margin, high - margin)
        result = _trust_region(course, x, (low, high), accuracy, evaluations - spent)
        x, spent = x + result.x, spent + result.nfev
        if spent >= evaluations or course.ends():
            break
    slopes = np.asarray(result.jac)  # of a robust fit as its residuals count
    return Solution(
        np.clip(x, low, high),
        held.covariance(slopes, result.fun),
        math.sqrt(2.0 * result.cost / result.fun.size),
        slopes.T @ slopes,
    )


def _trust_region(
    course: "_Course", x: Array, bounds: tuple[Array, Array], accuracy: float, evaluations: int
) -> OptimizeResult:
    """Lead a course on from x, (k,), as far as its slopes lead.

    As a change from x, since the trust region is at first as large as what it is given, or one for
    zero: where a fit begins is no measure of how far a first step may lead.
    """

    def residuals(change: Array) -> Array:
        return course.residuals(x + change)

    def slopes(change: Array) -> Array:
        return course.slopes(x + change)

    low, high = bounds
    return least_squares(
        residuals,
        np.zeros_like(x),
        jac=slopes,
        bounds=(low - x, high - x),
        loss="soft_l1" if course.robust else "linear",
        xtol=LEAST_STEP,
        ftol=accuracy,
        max_nfev=evaluations,
    )


def covariance(problem: Problem, steps: Array, blocks: NDArray[np.int_]) -> Array:
    """Return the covariance, (k, k), of parameters that were fitted, from slopes at the start.

    steps: (k,), so short that they are straight: where two parameters do the same, such as a hose
    and the volume it is connected to, slopes that bend by different amounts would seem to part
    them. blocks: (n,) numbers of the blocks that residuals belong to; those of one need not be
    independent of each other.
    """
    held = _Held(replace(problem, coarse=None, step=steps), problem.start)
    residuals, slopes = held.slopes(problem.start)
    independent = held.covariance(slopes, residuals)
    own = np.sqrt(np.diag(independent))
    wider = np.maximum(held.spread_of_blocks(slopes, residuals, blocks) / own, 1.0)
    return np.asarray(independent * np.outer(wider, wider))


def descended(problem: Problem, accuracy: float) -> Solution:
    """Minimise the squared residuals as `fit` does, where they are rough.

    A step along one parameter alone makes them far larger than several together that make up for
    each other, and what sticks does so at other instants: slopes say nothing over it. They are
    taken along the principal axes of what is known so far, over some standard deviations of each.
    No trust region can be learned from the last step: Levenberg and Marquardt's steps with
    several dampings are simulated together, on all cores, and the best point is taken, as long as
    it takes away more of the cost than the accuracy. Each corrects the slopes (Broyden 1965),
    which are taken anew where one takes away much less than they promise.
    """
    x = np.clip(problem.start, problem.low, problem.high)
    held = _Held(replace(problem, coarse=None), x)
    residuals, slopes, taken = held.first_slopes(x)
    cost = float(np.mean(np.square(residuals)))
    if not math.isfinite(cost):
        return _impossible(x)
    sound = taken
    for _ in range(DESCENTS):
        neighbours = np.empty((0, x.size))
        if not sound:
            curvature = slopes.T @ slopes
            neighbours, slopes, _ = held.slopes_along(x, residuals, slopes, curvature)
            taken = True
        tried = np.vstack([neighbours, held.steps(x, residuals, slopes)])
        left = held.residuals(tried)
        costs = mean_squares(left)
        best = int(np.argmin(costs))
        foreseen = residuals + slopes @ (tried[best] - x)
        promised = cost - float(np.mean(np.square(foreseen)))
        gained, least = cost - costs[best], accuracy * cost
        if gained > 0.0:
            slopes = _corrected(slopes, tried[best] - x, left[best] - foreseen)
            x, residuals, cost = tried[best], left[best], float(costs[best])
        if taken and gained < least:
            break
        sound, taken = gained > max(least, KEPT * promised), False
    return Solution(x, held.covariance(slopes, residuals), math.sqrt(cost), slopes.T @ slopes)


def mean_squares(residuals: Array) -> Array:
    """Return the mean square of each row, (m,), of (m, n); infinite where it is not all numbers."""
    return np.asarray(np.nan_to_num(np.mean(np.square(residuals), axis=1), nan=np.inf))


def _impossible(start: Array) -> Solution:
    """Return a start, (k,), that cannot be simulated, of which nothing is told."""
    untold = np.full((start.size, start.size), np.inf)
    return Solution(start, untold, math.inf, np.zeros_like(untold))


def steps_inside(x: Array, step: float | Array, high: Array) -> Array:
    """Return the steps of finite differences, (k,): back where one ahead leaves the bounds."""
    return np.where(x + step > high, -step, step)


def _corrected(slopes: Array, step: Array, unforeseen: Array) -> Array:
    """Return slopes, (n, k), changed the least that explains what they missed, (n,), in a step."""
    along = slopes.T @ (slopes @ step)
    change = np.outer(unforeseen, along / (step @ along))
    return np.asarray(slopes + np.where(_told(slopes), change, 0.0))


def _bounded(model: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return a model that cannot be simulated where it leaves all bounds: squares overflow."""

    def bounded(points: Array) -> Array:
        values = model(points)
        return np.where(np.abs(values) < OUT_OF_BOUNDS, values, np.nan)

    return bounded


class _Held:
    """A problem's residuals, and behind them how far each parameter is from where it is held.

    What neither data nor maker tell is held where the fit begins: with a singular Jacobian the
    trust region's step would be filled up with it, by an amount that rounding decides.
    """

    def __init__(self, problem: Problem, start: Array) -> None:
        coarse = problem.coarse and _bounded(problem.coarse)
        self._problem = replace(problem, model=_bounded(problem.model), coarse=coarse)
        self._weight = np.where(problem.stated, 1.0 / TOLERANCE_SPREAD, HELD)
        self._expected = np.where(problem.stated, 0.0, start)

    def residuals(self, points: Array) -> Array:
        """Return the residuals, (m, n + k), of points, (m, k)."""
        return np.hstack([self._problem.model(points), self._weight * (points - self._expected)])

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """Return the residuals, (n + k,), at x, (k,), and their slopes, (n + k, k)."""
        problem = self._problem
        steps = steps_inside(x, problem.step, problem.high)
        values = (problem.coarse or problem.model)(np.vstack([x, x + np.diag(steps)]))
        slopes = (values[1:] - values[0]) / steps[:, None]
        # a neighbour that cannot be simulated says nothing about the slope
        slopes = np.nan_to_num(slopes.T, posinf=0.0, neginf=0.0)
        residuals = np.append(values[0], self._weight * (x - self._expected))
        return residuals, np.vstack([slopes, np.diag(self._weight)])

    def first_slopes(self, x: Array) -> tuple[Array, Array, bool]:
        """Return the residuals, (n + k,), at x, (k,), and their slopes, (n + k, k).

        And whether they were taken along the principal axes of a fit before.
        """
        curvature = self._problem.curvature
        if curvature is not None:
            residuals = self.residuals(x[None])[0]
            held = np.zeros((residuals.size, x.size))
            held[-x.size :] = np.diag(self._weight)
            _, slopes, complete = self.slopes_along(x, residuals, held, curvature)
            if complete:
                return residuals, slopes, True
        return *self.slopes(x), False

    def slopes_along(
        self, x: Array, residuals: Array, former: Array, curvature: Array
    ) -> tuple[Array, Array, bool]:
        """Return slopes, (n + k, k), at x along the principal axes of a curvature, (k, k).

        residuals: (n + k,), at x. Where a step leads far off, the former slopes, (n + k, k), stay.
        And the best of the points, (1, k), that were simulated, and whether all steps stayed near.
        """
        problem = self._problem
        squares, axes = np.linalg.eigh(curvature)
        reach = REACH / np.sqrt(np.maximum(squares, HELD**2))
        longest = LONGEST / np.max(np.abs(axes), axis=0)
        steps = (np.minimum(reach, longest) * axes).T
        outside = np.any((x + steps < problem.low) | (x + steps > problem.high), axis=1)
        points = np.clip(x + np.where(outside[:, None], -steps, steps), problem.low, problem.high)
        values = self.residuals(points)
        costs = mean_squares(values)
        near = costs <= FAR * np.mean(np.square(residuals))
        moved = points[near] - x
        unforeseen = values[near] - residuals - moved @ former.T
        change = np.linalg.lstsq(moved, unforeseen, rcond=1e-9)[0].T
        told = np.diag(curvature) > TOLD_CURVATURE * self._weight**2
        slopes = former + np.where(told, change, 0.0)
        return points[[int(np.argmin(costs))]], slopes, bool(np.all(near))

    def steps(self, x: Array, residuals: Array, slopes: Array) -> Array:
        """Return where steps with several dampings lead, (m, k)."""
        left, sizes, right = np.linalg.svd(slopes, full_matrices=False)
        damped = sizes / (sizes**2 + DAMPINGS[:, None] * sizes[0] ** 2)
        ends = x - (damped * (left.T @ residuals)) @ right
        return np.asarray(np.clip(ends, self._problem.low, self._problem.high))

    def covariance(self, slopes: Array, residuals: Array) -> Array:
        """Return the covariance, (k, k), from slopes, (n + k, k), and residuals, (n + k,)."""
        inverse = np.linalg.pinv(slopes.T @ slopes)
        # misfit beyond the noise widens the spread: the noise is not all that the model leaves
        covariance = inverse * max(1.0, float(np.mean(np.square(residuals))))
        untold = np.flatnonzero(~(_told(slopes) | self._problem.stated))
        covariance[untold, untold] = np.inf
        return np.asarray(covariance, dtype=np.float64)

    def spread_of_blocks(self, slopes: Array, residuals: Array, blocks: NDArray[np.int_]) -> Array:
        """Return standard deviations, (k,), by how differently blocks of residuals pull.

        Of what a model lacks, residuals next to each other know the same: the curvature takes each
        for new (Liang and Zeger 1986). slopes: (n + k, k). residuals: (n + k,). blocks: (n,).
        """
        inverse = np.linalg.pinv(slopes.T @ slopes)
        count = int(blocks.max()) + 1
        pulls = np.zeros((count, slopes.shape[1]))
        np.add.at(pulls, blocks, slopes[: blocks.size] * residuals[: blocks.size, None])
        scatter = pulls.T @ pulls * count / max(count - 1, 1) + np.diag(self._weight**2)
        return np.asarray(np.sqrt(np.diag(inverse @ scatter @ inverse)))


class _Course:
    """The way of a fit: residuals, and slopes that are corrected from step to step (Broyden 1965).

    Slopes cost as many runs as there are parameters. They are taken anew where a step takes away
    much less than they promise, and once more where a fit would end by corrected ones.
    """

    def __init__(self, held: _Held, *, robust: bool) -> None:
        self._held, self.robust = held, robust
        self._last = self._at = (np.empty(0), np.empty(0))  # points, residuals there
        self._known = np.empty(0)
        self._taken = self._sound = False  # known at `_at`, not corrected; and so before the step
        self._begins = True

    def residuals(self, x: Array) -> Array:
        """Return a copy of the residuals, (n + k,), at x, (k,): robust fits write into it."""
        for point, values in (self._last, self._at):
            if np.array_equal(point, x):
                return values.copy()
        values = np.asarray(self._held.residuals(x[None])[0])
        self._last = (x.copy(), values)
        return values.copy()

    def slopes(self, x: Array) -> Array:
        """Return the slopes, (n + k, k), at x, (k,): where a fit begins or a step has led to."""
        after = self.residuals(x)
        if self._begins:
            self._begins, self._sound = False, True
            self._take(x)
        else:
            self._sound = self._taken
            self._follow(x, after)
        self._at = (x.copy(), after)
        return self._known.copy()

    def ends(self) -> bool:
        """Tell whether a fit that would go no further was led by slopes that were not corrected.

        If not, it is to be begun again, with slopes taken anew.
        """
        self._begins = not self._sound
        return self._sound

    def _follow(self, x: Array, after: Array) -> None:
        """Correct the slopes by what a step has led to, residuals (n + k,), or take them anew."""
        before, step = self._at[1], x - self._at[0]
        foreseen = before + self._known @ step
        gained = self._cost(before) - self._cost(after)
        if gained > FOLLOWED * (self._cost(before) - self._cost(foreseen)):
            self._known, self._taken = _corrected(self._known, step, after - foreseen), False
        else:
            self._take(x)

    def _take(self, x: Array) -> None:
        if not (self._taken and np.array_equal(x, self._at[0])):
            self._known, self._taken = self._held.slopes(x)[1], True

    def _cost(self, residuals: Array) -> float:
        squares = np.square(residuals)
        return float(np.sum(2.0 * (np.sqrt(1.0 + squares) - 1.0) if self.robust else squares))


def _told(slopes: Array) -> NDArray[np.bool_]:
    """Tell on which parameters the data depend, (k,), by the slopes of `_Held`, (n + k, k)."""
    return np.asarray(np.any(slopes[: -len(slopes.T)], axis=0))
