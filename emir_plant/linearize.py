"""Linear models of the machine about an operating point."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_plant import core
from emir_plant.core import Array, Truth
from emir_plant.plant import Plant

ROUNDING = 1e-6  # rad/s, below which the imaginary part of a pole is numerical noise


@dataclass(frozen=True)
class LinearModel:
    """dx = A x + B u, y = C x, deviations from the operating point.

    A: (n, n). B: (n, 1), input y2 as it arrives at the valve. C: (len(Truth), n), rows in the
    order of `Truth`. states: (n,) their indices in the plant's state; left out are time and the
    memory of effects that nothing drives or nothing feels.
    """

    A: Array
    B: Array
    C: Array
    states: NDArray[np.intp]

    def modes(self) -> tuple[Array, Array]:
        """Return frequency, Hz, and damping, of critical, of the oscillations, slowest first."""
        poles = np.linalg.eigvals(self.A).astype(np.complex128)
        poles = poles[poles.imag > ROUNDING]
        poles = poles[np.argsort(abs(poles))]
        frequency = np.hypot(poles.real, poles.imag)
        return frequency / (2.0 * np.pi), -poles.real / frequency


def linearize(plant: Plant, state: Array, command: float = 0.0) -> LinearModel:
    """Return the linear model about a state and command, by central differences."""

    def outputs(x: Array) -> Array:
        return np.array(plant.outputs(x))

    steps = 1e-6 * np.maximum(np.abs(state), 1e-3)
    A = np.empty((state.size, state.size))
    C = np.empty((len(Truth._fields), state.size))
    for k, step in enumerate(steps):
        ahead, behind = state.copy(), state.copy()
        ahead[k] += step
        behind[k] -= step
        width = ahead[k] - behind[k]
        A[:, k] = (plant.derivative(ahead, command) - plant.derivative(behind, command)) / width
        C[:, k] = (outputs(ahead) - outputs(behind)) / width
    d = 1e-6
    B = (plant.derivative(state, command + d) - plant.derivative(state, command - d)) / (2.0 * d)
    return _without_idle_memory(LinearModel(A, B.reshape(-1, 1), C, np.arange(state.size)))


def _without_idle_memory(full: LinearModel) -> LinearModel:
    """Return the model without the memory that nothing drives or nothing feels."""
    others = full.A - np.diag(np.diag(full.A))
    driven = others.any(axis=1) | full.B.any(axis=1)
    felt = others.any(axis=0) | full.C.any(axis=0)
    memory = (full.states >= core.TIME) & (full.states < core.MODES)
    kept = np.flatnonzero(~memory | (driven & felt))
    return LinearModel(full.A[np.ix_(kept, kept)], full.B[kept], full.C[:, kept], kept)
