"""What becomes of a damped oscillator that is left alone, whatever the time."""

import math

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled_in_place

Array = NDArray[np.float64]

SAME = 1e-6  # rad or time constants, by which its two rates are the same


@compiled_in_place
def write_swing(stiffness: float, damping: float, time: float, swing: Array) -> None:
    """Write the matrix, (2, 2), that takes its place and velocity to those after a time, s.

    stiffness: 1/s^2 and damping: 1/s, of a mass of 1.
    """
    falling = 0.5 * damping
    surplus = stiffness - falling * falling
    omega = math.sqrt(abs(surplus))
    if omega * time < SAME:  # damped critically
        even, odd = 1.0, time
    elif surplus > 0.0:
        even, odd = math.cos(omega * time), math.sin(omega * time) / omega
    else:
        even, odd = math.cosh(omega * time), math.sinh(omega * time) / omega
    left = math.exp(-falling * time)
    swing[0, 0], swing[0, 1] = left * (even + falling * odd), left * odd
    swing[1, 0], swing[1, 1] = -left * stiffness * odd, left * (even - falling * odd)


@compiled_in_place
def swung(place: float, velocity: float, swing: Array) -> tuple[float, float]:
    """Return place and velocity after the time of a swing, (2, 2), from those before."""
    return (
        swing[0, 0] * place + swing[0, 1] * velocity,
        swing[1, 0] * place + swing[1, 1] * velocity,
    )
