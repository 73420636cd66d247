"""When a balance speaks that is quiet else: at the moments that were put in, and at no other."""

import numpy as np
import pytest

from emir_analysis.diagnosis.balances import level
from emir_analysis.diagnosis.moments import moments
from emir_analysis.signals import Array

TIME = np.arange(0.5, 90.0, 0.25)  # s, as the balances' windows
NOISE = 2.0


def _residual(sizes: dict[float, float]) -> Array:
    """Return noise with a jerk of a second at each time, s, of that size."""
    residual = NOISE * np.random.default_rng(3).standard_normal(TIME.size)
    for time, size in sizes.items():
        residual += size * np.exp(-(((TIME - time) / 0.4) ** 2))
    return residual


def test_jerks_are_told_that_the_level_does_not_know_of() -> None:
    jerks = {21.75: 90.0, 40.5: -140.0, 55.5: 60.0}
    residual = _residual(jerks)
    assert level(residual[:, np.newaxis])[0] < 1.5 * NOISE
    found = moments(residual, NOISE, TIME)
    assert found is not None
    assert found.times == pytest.approx(list(jerks), abs=0.3)
    assert found.size == pytest.approx(140.0, abs=5.0 * NOISE)
    assert found.more == 0


def test_of_many_the_loudest_are_told_in_their_order() -> None:
    jerks = {5.0 + 10.0 * k: 50.0 + 20.0 * ((3 * k) % 8) for k in range(8)}
    found = moments(_residual(jerks), NOISE, TIME)
    assert found is not None
    loudest = sorted(sorted(jerks, key=lambda time: -jerks[time])[:4])
    assert found.times == pytest.approx(loudest, abs=0.3)
    assert found.more == 4


def test_noise_alone_has_no_moments() -> None:
    assert moments(_residual({}), NOISE, TIME) is None
