"""Least squares of the diagnosis: what the data do not tell stays where it is."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares

from emir_analysis.diagnosis.fit import STRAIGHT_STEP, Problem, Solution, covariance, descended, fit
from emir_analysis.signals import Array

SIZE = 9  # numbers to be fitted
UNTOLD = [4, 7]  # those that the data do not depend on
FAR = 20.0  # bounds of all

Method = Callable[[Problem, float], Solution]
both = pytest.mark.parametrize("method", [fit, descended])


def fitted(
    seed: int, untold: Array, *, stated: bool, method: Method = fit
) -> tuple[Solution, Array, Array]:
    """Fit random, slightly curved residuals; return truth, (k,), and slopes, (n, k), too.

    untold: (2,) where the numbers without effect begin; stated: whether a maker states them.
    """
    random = np.random.default_rng(seed)
    slopes = random.normal(size=(400, SIZE)) * np.logspace(3.0, 1.0, SIZE)
    slopes[:, UNTOLD] = 0.0
    true = random.normal(size=SIZE)
    start = true + 0.01 * random.normal(size=SIZE)
    start[UNTOLD] = untold

    def model(points: Array) -> Array:
        straight = (points - true) @ slopes.T
        return np.asarray(straight + 1e-2 * np.sin(straight / 100.0))

    held = np.zeros(SIZE, dtype=bool)
    held[UNTOLD] = stated
    low, high = np.full(SIZE, -FAR), np.full(SIZE, FAR)
    return method(Problem(model, start, low, high, held), 1e-3), true, slopes


@both
@pytest.mark.parametrize("seed", range(5))
def test_numbers_without_effect_stay_where_they_begin(seed: int, method: Method) -> None:
    """They take no part in a step, however far the trust region reaches."""
    untold = np.array([-3.0, 6.9])
    solution, true, _ = fitted(seed, untold, stated=False, method=method)
    true[UNTOLD] = untold
    assert solution.x == pytest.approx(true, abs=1e-3)
    assert np.all(np.isinf(np.diag(solution.covariance)[UNTOLD]))


def test_what_a_maker_states_goes_back_to_that() -> None:
    """The variance is then that of a tolerance: uniform, one wide to both sides."""
    solution, _, _ = fitted(0, np.array([0.5, -0.7]), stated=True)
    assert solution.x[UNTOLD] == pytest.approx(0.0, abs=1e-6)
    assert np.diag(solution.covariance)[UNTOLD] == pytest.approx(1.0 / 3.0, rel=1e-3)


@both
def test_the_covariance_is_the_textbook_s(method: Method) -> None:
    """(J'J)^-1 for residuals in units of the noise."""
    solution, _, slopes = fitted(0, np.zeros(2), stated=False, method=method)
    told = np.setdiff1d(np.arange(SIZE), UNTOLD)
    expected = np.linalg.inv(slopes[:, told].T @ slopes[:, told])
    assert solution.covariance[np.ix_(told, told)] == pytest.approx(expected, rel=1e-2, abs=1e-9)


@pytest.mark.parametrize("shared", [0.0, 1.0])
def test_a_spread_knows_that_errors_next_to_each_other_are_alike(shared: float) -> None:
    """A level and a slope fitted 300 times scatter as much as the spread told says.

    shared: deviation of what all errors of a block have in common, beside noise of 1.
    """
    count, size = 40, 50
    blocks = np.repeat(np.arange(count), size)
    time = np.linspace(-1.0, 1.0, count * size)
    slopes = np.column_stack([np.ones_like(time), time])
    random = np.random.default_rng(1)
    ends, told = [], []
    for _ in range(300):
        noise = random.normal(size=time.size) + shared * random.normal(size=count)[blocks]
        best = np.linalg.lstsq(slopes, noise, rcond=None)[0]

        def model(points: Array, noise: Array = noise) -> Array:
            return np.asarray(points @ slopes.T - noise)

        problem = Problem(model, best, np.full(2, -FAR), np.full(2, FAR), np.zeros(2, dtype=bool))
        steps = np.full(2, STRAIGHT_STEP)
        ends.append(best)
        told.append(np.sqrt(np.diag(covariance(problem, steps, blocks))))
    assert np.median(told, axis=0) == pytest.approx(np.std(ends, axis=0), rel=0.15)


def test_vectors_drawn_from_a_fit_have_its_spread() -> None:
    """Sample mean and deviation over 20 000, within what chance allows; the untold stay."""
    untold = np.array([-3.0, 6.9])
    solution, _, _ = fitted(0, untold, stated=False)
    drawn, told = solution.drawn(20000), np.setdiff1d(np.arange(SIZE), UNTOLD)
    assert np.abs(drawn[:, UNTOLD] - untold).max() < 1e-6
    scaled = (drawn - solution.x)[:, told] / np.sqrt(np.diag(solution.covariance)[told])
    assert np.all(np.abs(scaled.mean(axis=0)) < 5.0 / np.sqrt(20000))
    assert scaled.std(axis=0) == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize("method", [fit, descended])
def test_a_fit_from_where_nothing_can_be_simulated_says_so(method: Method) -> None:
    """Its misfit is infinite; others are then better."""

    def model(points: Array) -> Array:
        return np.full((len(points), 10), np.nan)

    one = np.ones(1)
    problem = Problem(model, 0.0 * one, -one, one, np.zeros(1, dtype=bool))
    assert method(problem, 1e-3).misfit == np.inf


class Valley:
    """Residuals that a step along one number alone leaves: there they are off at random.

    So do those of a piston that sticks at other instants. rough: by which share of their size.
    At the optimum the squares are fewer than at the truth by about as many as there are numbers
    (chi-square).
    """

    def __init__(self, seed: int, rough: float) -> None:
        count, random = 2000, np.random.default_rng(seed)
        sizes = np.logspace(4.0, 0.5, SIZE)  # what a step of one along each axis does
        axes = np.linalg.qr(random.normal(size=(SIZE, SIZE)))[0]
        true = 0.3 * random.normal(size=SIZE)
        directions = random.normal(size=(count, SIZE)) / np.sqrt(count)
        noise, phase = random.normal(size=count), random.uniform(0.0, 2.0 * np.pi, size=count)
        deviations = np.where(np.arange(SIZE) < SIZE // 2, 1.0, 10.0)  # by the most uncertain
        self.start = true + axes @ np.clip(deviations / sizes * random.normal(size=SIZE), -0.5, 0.5)
        self.curvature = axes * sizes**2 @ axes.T

        def model(points: Array) -> Array:
            z = ((points - true) @ axes * sizes) @ directions.T * np.sqrt(count)
            off = np.where(np.abs(z) > 10.0, rough * z * np.sin(2.0 * z + phase), 0.0)
            return np.asarray((z + off) / np.sqrt(count) + noise)

        self.model, self._least = model, np.sum(noise**2)

    def excess(self, x: Array) -> float:
        """Return the squares at x, (SIZE,), beyond those at the truth."""
        return float(np.sum(self.model(x[None]) ** 2) - self._least)

    def descended(self, curvature: Array | None = None) -> Solution:
        """Return where a descent ends; curvature: (SIZE, SIZE), what it knows beforehand."""
        bound, free = np.full(SIZE, 5.0), np.zeros(SIZE, dtype=bool)
        problem = Problem(self.model, self.start, -bound, bound, free, None, 3e-3, curvature)
        return descended(problem, 1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_descent_follows_a_narrow_valley_with_steep_and_rough_walls(seed: int) -> None:
    valley = Valley(seed, 0.2)
    assert valley.excess(valley.start) > 50.0
    assert valley.excess(valley.descended().x) < 0.0


@pytest.mark.parametrize("seed", range(4))
def test_a_descent_goes_on_from_what_a_fit_to_a_part_of_the_data_knows(seed: int) -> None:
    """Between rougher walls it does not find its way without: the shorter part's axes lead it."""
    valley = Valley(seed, 0.5)
    part = 0.25 * valley.curvature + np.eye(SIZE)  # half as well known, and held
    assert valley.excess(valley.start) > 50.0
    assert valley.excess(valley.descended(part).x) < 0.0


@pytest.mark.parametrize("robust", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_a_fit_ends_where_one_with_exact_slopes_does(seed: int, *, robust: bool) -> None:
    """Its own are corrected from step to step: they must not let it end before. By scipy's own."""
    random = np.random.default_rng(seed)
    slopes = random.normal(size=(300, SIZE)) * np.logspace(2.0, 0.0, SIZE)
    true, noise = random.normal(size=SIZE), random.normal(size=300)
    bend = 30.0  # residuals curve over as much: where a fit begins slopes are others altogether

    def curved(x: Array) -> Array:
        return np.asarray(bend * np.sinh((x - true) @ slopes.T / bend).clip(-1e6, 1e6) + noise)

    def exact(x: Array) -> Array:
        return np.asarray(np.cosh(slopes @ (x - true) / bend)[:, None] * slopes)

    start, bound = true + 0.3 * random.normal(size=SIZE), np.full(SIZE, FAR)
    loss = "soft_l1" if robust else "linear"
    best = least_squares(curved, start, exact, loss=loss, xtol=1e-12, ftol=1e-12)
    problem = Problem(curved, start, -bound, bound, np.zeros(SIZE, dtype=bool))
    found = fit(problem, 1e-3, robust=robust).x
    reached = least_squares(curved, found, exact, loss=loss, max_nfev=1)
    assert reached.cost < 1.003 * best.cost


def test_a_fit_needs_less_than_half_as_many_slopes_as_one_that_takes_them_at_each_step() -> None:
    """Each costs as many runs as there are parameters. By scipy's own fit of the same residuals."""
    valley, asked = Valley(0, 0.0), [0]

    def bent(points: Array) -> Array:
        return np.asarray(points + 0.3 * np.sin(3.0 * points))

    def model(points: Array) -> Array:
        asked[0] += len(points) > 1
        return valley.model(bent(points))

    bound, free = np.full(SIZE, 5.0), np.zeros(SIZE, dtype=bool)
    solution = fit(Problem(model, valley.start, -bound, bound, free), 1e-6)
    plain = least_squares(lambda x: valley.model(bent(x)[None])[0], valley.start, ftol=1e-6)
    assert valley.excess(bent(solution.x)) < valley.excess(bent(plain.x)) + 1.0
    assert 2 * asked[0] < plain.njev


@both
def test_a_run_out_of_all_bounds_is_none(method: Method) -> None:
    """Its square overflows. From there nothing begins, and beside a start it says nothing."""

    def model(points: Array) -> Array:
        wild = np.where(points[:, :1] > 1.0, 1e241, 1.0)
        return np.asarray(wild * (points - 0.2) @ np.eye(2, 40, 1) * 30.0)

    bounds, free = (np.full(2, -FAR), np.full(2, FAR)), np.zeros(2, dtype=bool)
    lost = method(Problem(model, np.array([1.5, 0.0]), *bounds, free), 1e-3)
    assert lost.misfit == np.inf
    found = method(Problem(model, np.array([1.0 - 1e-9, 0.0]), *bounds, free), 1e-3)
    assert np.all(np.isfinite(found.x))
    assert found.x[1] == pytest.approx(0.2, abs=1e-3)
