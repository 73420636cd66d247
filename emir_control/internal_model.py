"""The linear model inside a predictive controller, and what it predicts."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import ParameterError

Array = NDArray[np.float64]

LONG = 1000  # samples: half a minute, in which all but integrators have come to rest


@dataclass(frozen=True, eq=False)
class InternalModel:
    """x(i+1) = A x(i) + B u(i), y = C x, sampled with a period, s.

    A: (n, n). B: (n,). C: (n,). observer: (n,), the gain by which the measured output corrects
    x(i) before it is used, or None for a model that runs on its own (an independent model).
    Raises ParameterError for other shapes or numbers that are not finite.
    """

    A: Array
    B: Array
    C: Array
    period: float
    observer: Array | None = None

    def __post_init__(self) -> None:
        n = np.shape(self.A)[0] if np.ndim(self.A) else 0
        shapes = {"A": (n, n), "B": (n,), "C": (n,), "observer": (n,)}
        for name, shape in shapes.items():
            values = getattr(self, name)
            if values is None and name == "observer":
                continue
            if np.shape(values) != shape or n == 0:
                raise ParameterError(f"model: {name} is {np.shape(values)}, expected {shape}")
            if not np.isfinite(values).all():
                raise ParameterError(f"model: {name} holds a number that is not finite")
        if not 0.0 < self.period < np.inf:
            raise ParameterError(f"model: period = {self.period!r} s: has to be positive")

    @property
    def order(self) -> int:
        """Return n."""
        return len(self.A)

    def next(self, state: Array, command: float) -> Array:
        """Return x(i+1), shape (n,)."""
        return self.A @ state + self.B * command

    def free_response(self, steps: int) -> Array:
        """Return C A^h, shape (n,): the output h steps ahead of a state left alone."""
        return np.asarray(self.C @ np.linalg.matrix_power(self.A, steps))

    def held_response(self, steps: int) -> float:
        """Return the output h steps ahead, from x = 0, under a constant command of 1."""
        return float(self.basis_response(steps, 1)[0])

    def basis_response(self, steps: int, count: int) -> Array:
        """Return the outputs h steps ahead, from x = 0, under 1, k, k^2 ...; shape (count,)."""
        states = np.zeros((self.order, count))
        for k in range(steps):
            states = self.A @ states + np.outer(self.B, float(k) ** np.arange(count))
        return np.asarray(self.C @ states)

    def frequency_response(self, frequencies: Array) -> NDArray[np.complex128]:
        """Return C (z I - A)^-1 B, (k,), at frequencies, (k,) Hz; without the observer."""
        points = np.exp(2j * np.pi * frequencies * self.period)
        eye = np.eye(self.order)
        return np.array([self.C @ np.linalg.solve(z * eye - self.A, self.B) for z in points])

    @cached_property
    def steady_state(self) -> Array:
        """The state, shape (n,), after a constant command of 1 over LONG samples from x = 0."""
        state = np.zeros(self.order)
        for _ in range(LONG):
            state = self.next(state, 1.0)
        return state
