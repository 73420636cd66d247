"""What tests of the machine share."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from emir_plant.plant import Plant

Solver = Callable[[Plant, np.ndarray, np.ndarray, str], np.ndarray]


@pytest.fixture
def stiff_solver() -> Solver:
    """Return an independent integration: (plant, start, commands each 1 ms, method) -> states."""

    def solve(plant: Plant, start: np.ndarray, commands: np.ndarray, method: str) -> np.ndarray:
        state, states = start, [start]
        edges = np.flatnonzero(np.diff(commands, prepend=np.nan, append=np.nan))
        for begin, end in itertools.pairwise(edges):  # the command jumps there
            times = np.arange(begin, end + 1) * 1e-3
            solved = solve_ivp(
                lambda _t, x, y=commands[begin]: plant.derivative(x, y),
                (times[0], times[-1]),
                state,
                method=method,
                t_eval=times,
                rtol=1e-8,
                atol=1e-9,
                max_step=5e-3,
            )
            states.extend(solved.y.T[1:])
            state = solved.y[:, -1]
        return np.array(states)

    return solve
