"""Model predictive control about the same plan and with the same estimate as the LQG control.

In place of the feedback gain stands a quadratic program over the next periods, with the same
weights and the LQG's cost to go at the end: u within what the drive can give at the pressures of
this instant, and the TCP's dynamic deflection within the plan's largest one, softly. Where
neither limit is near, its command is that of the LQG. Solved by OSQP (extra `mpc`).
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control.lqg import Lqg, LqgState, Now
from emir_control.regulator import Regulator

Array = NDArray[np.float64]

EXCESS_WEIGHT = 3e-4  # m: excess of deflection that counts as one
BEND_UNIT = 1e-3  # m, of the rows of deflection
SETTINGS = {  # nothing that depends on time or on the last solution
    "verbose": False, "adaptive_rho": 0, "warm_starting": False, "polishing": False,
    "eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 4000, "check_termination": 10,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class MpcParameters:
    """What the MPC has beside the LQG."""

    horizon: int = quantity("1", 2, 200, "control periods looked ahead", default=20)

    def __post_init__(self) -> None:
        check_ranges(self)
        if find_spec("osqp") is None:
            raise ParameterError("the MPC needs OSQP: pip install 'emir_ros[mpc]'")


@dataclass(frozen=True)
class Mpc(Lqg):
    """The control law; see `Lqg`."""

    prediction: MpcParameters = field(default_factory=MpcParameters)

    def _feedback(self, state: LqgState, estimate: Array, now: Now) -> float:
        """Return u off the plan, m/s; the LQG's where the program has no solution."""
        law, count = state.regulator, self.prediction.horizon
        flow = float(estimate[law.flow])
        times = now.time + now.dt * np.arange(count + 1)
        planned = np.array([state.plan.velocity(float(t), now.dt) for t in times[:-1]])
        ends = (self.drive.velocity(end, now.oil) for end in (-1.0, 1.0))
        low, high = (end - planned + flow for end in ends)
        bend = np.array([state.plan.bend(float(t)) for t in times[1:]])
        most = float(abs(state.plan.deflection).max())
        problem = _problem(law, count, self.parameters.regulator.velocity_weight)
        command = problem.solve(self._off(state, estimate), (low, high), bend, most)
        if not math.isfinite(command):
            return super()._feedback(state, estimate, now)
        return command - flow


class Problem:
    """The program of a regulator: unknowns u in velocity weights, and the excess."""

    def __init__(self, law: Regulator, count: int, unit: float) -> None:
        import osqp  # noqa: PLC0415 (an extra)

        n = len(law.extended)
        free, forced = np.zeros((count, n, n)), np.zeros((count, n, count))
        power, columns = np.eye(n), np.zeros((n, count))
        for k in range(count):
            power = law.extended @ power
            columns = law.extended @ columns
            columns[:, k] += unit * law.driven
            free[k], forced[k] = power, columns
        weights = [law.stage] * (count - 1) + [law.cost]
        row = np.append(law.deflection, np.zeros(n - law.modes)) / BEND_UNIT
        self._free = row @ free
        self._linear = 2.0 * sum(f.T @ q @ e for f, q, e in zip(forced, weights, free, strict=True))
        square = 2.0 * sum(f.T @ q @ f for f, q in zip(forced, weights, strict=True))
        hessian = np.zeros((count + 1, count + 1))
        hessian[:-1, :-1] = square + 2.0 * np.eye(count)
        hessian[-1, -1] = 2.0 * (BEND_UNIT / EXCESS_WEIGHT) ** 2
        bends, one = row @ forced, np.ones((count, 1))
        rows = np.block([[np.eye(count + 1)], [bends, -one], [-bends, -one]])
        self._unit, self._count = unit, count
        self._solver: Any = osqp.OSQP()
        bounds = np.full(len(rows), np.inf)
        quadratic, constraints = map(scipy.sparse.csc_matrix, (np.triu(hessian), rows))
        self._solver.setup(quadratic, np.zeros(count + 1), constraints, -bounds, bounds, **SETTINGS)

    def solve(self, off: Array, ends: tuple[Array, Array], bend: Array, most: float) -> float:
        """Return the first u + d, m/s, or NaN. bend, most: m, as planned and at most."""
        left = self._free @ off + bend / BEND_UNIT
        limit = most / BEND_UNIT
        low = np.concatenate([ends[0] / self._unit, [0.0], np.full(2 * self._count, -np.inf)])
        high = np.concatenate([ends[1] / self._unit, [np.inf], limit - left, limit + left])
        self._solver.update(q=np.append(self._linear @ off, 0.0), l=low, u=high)
        found = self._solver.solve(raise_error=False)
        solved = found.info.status_val == 1 and np.isfinite(found.x[0])
        return float(found.x[0]) * self._unit if solved else math.nan


@lru_cache(maxsize=8)
def _problem(law: Regulator, count: int, unit: float) -> Problem:
    return Problem(law, count, unit)
