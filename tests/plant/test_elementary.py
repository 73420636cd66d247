"""Functions of our own against numpy's."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from emir_plant.elementary import LARGEST, cosine, exponential, sine

NEAR = np.concatenate([np.linspace(-20.0, 20.0, 20001), np.geomspace(1e-300, 1.0, 300)])
FAR = np.linspace(-1e5, 1e5, 10001)  # rad
UNIT = 2.0**-53  # relative, of rounding
Function = Callable[[float], float]


@pytest.mark.parametrize(("own", "other"), [(sine, np.sin), (cosine, np.cos)])
def test_sine_and_cosine_are_as_exact_as_the_numbers(own: Function, other: np.ufunc) -> None:
    near, far = (np.array([own(float(x)) for x in places]) for places in (NEAR, FAR))
    # relative, and where a zero is not a number of its own what rounding of the angle makes
    assert np.all(np.abs(near - other(NEAR)) <= 4.0 * UNIT * np.abs(other(NEAR)) + UNIT**1.5)
    assert np.abs(far - other(FAR)).max() <= np.spacing(1e5)


def test_the_exponential_is_as_exact_as_the_numbers() -> None:
    places = np.concatenate([NEAR, np.linspace(-LARGEST, LARGEST, 10001)])
    found = np.array([exponential(float(x)) for x in places])
    assert np.abs(found / np.exp(places) - 1.0).max() <= 4.0 * UNIT


@pytest.mark.parametrize("number", [-1e308, -math.inf])
def test_the_exponential_of_far_below_is_as_good_as_nothing(number: float) -> None:
    assert 0.0 <= exponential(number) < 1e-300


@pytest.mark.parametrize("number", [1e308, math.inf])
def test_the_exponential_of_far_above_stays_finite(number: float) -> None:
    assert 1e300 < exponential(number) < math.inf


@pytest.mark.parametrize("function", [sine, cosine, exponential])
def test_what_is_no_number_stays_none(function: Function) -> None:
    assert math.isnan(function(math.nan))
