"""The swing of an oscillator, against the exponential of its matrix."""

import numpy as np
import pytest
from scipy.linalg import expm

from emir_plant.oscillator import swung, write_swing


@pytest.mark.parametrize("damping", [0.0, 8.0, 399.99999, 400.0, 400.00001, 3000.0])
@pytest.mark.parametrize("time", [1e-3, 5e-3, 0.1])
def test_a_swing_is_the_exponential_of_the_oscillators_matrix(damping: float, time: float) -> None:
    stiffness = 200.0**2  # damped critically by 400
    swing = np.empty((2, 2))
    write_swing(stiffness, damping, time, swing)
    exact = expm(time * np.array([[0.0, 1.0], [-stiffness, -damping]]))
    scale = np.array([[1.0, 1.0 / 200.0], [200.0, 1.0]])
    assert swing / scale == pytest.approx(exact / scale, abs=1e-9)
    assert swung(0.3, 20.0, swing) == pytest.approx(exact @ [0.3, 20.0], abs=1e-6)
