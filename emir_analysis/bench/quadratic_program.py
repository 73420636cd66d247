"""The joint's predictive control as a quadratic program, for solvers of others.

    minimise   sum over h = 1 ... N of (y(i+h) - w(i+h))^2 + RHO (u(i+h-1) - u(i+h-2))^2
    subject to |u| <= speed limit, |change of u| <= acceleration limit times period

with the internal model of (12), y = C x, and w the set points less model error and origin.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from emir_analysis.control_protocols import Signals
from emir_control.pfc import PREVIEW, PfcParameters, PfcState
from emir_msgs_py.topics import CYLINDER_PREVIEW

Array = NDArray[np.float64]

UNIT = 1e6  # of the objective: mm^2, since the solvers' tolerances are absolute
RHO = 1e-2  # s^2: a change of command by 1 mm/s counts as much as an error of 0.1 mm


class Query(NamedTuple):
    """One instance: model state, (n,), command in force, m/s, and what is wanted, (N,), m."""

    state: Array
    last: float
    wanted: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """What is the same in every instance."""

    A: Array  # (n, n)
    B: Array  # (n,)
    C: Array  # (n,)
    speed: float  # m/s
    change: float  # m/s, from sample to sample
    period: float  # s
    horizon: int = PREVIEW

    @classmethod
    def of(cls, p: PfcParameters) -> Self:
        """Return the problem of a design."""
        m = p.model
        change = p.acceleration_limit * m.period
        return cls(m.A, m.B, m.C, p.speed_limit, change, m.period)

    def query(self, state: PfcState, now: Signals) -> Query:
        """Return the instance that a predictive controller in this state has to solve."""
        preview = [now[name] for name in CYLINDER_PREVIEW.fields]
        wanted = np.array(preview[: self.horizon]) - state.origin - state.errors[-1]
        return Query(state.model, state.command, wanted)

    @property
    def free(self) -> Array:
        """The outputs that follow from the state alone, (N, n)."""
        return np.array(
            [self.C @ np.linalg.matrix_power(self.A, h) for h in range(1, self.horizon + 1)]
        )

    @property
    def forced(self) -> Array:
        """The outputs that follow from the commands, (N, N)."""
        pulse = np.concatenate(([self.C @ self.B], self.free @ self.B))
        rows = range(self.horizon)
        return np.array([[pulse[h - k] if h >= k else 0.0 for k in rows] for h in rows])


def by_osqp(problem: Problem) -> Callable[[Query], float]:
    """Return a solver by OSQP in the N commands, set up once; its answer is the first, m/s."""
    import osqp  # noqa: PLC0415 (only wanted here)
    from scipy import sparse  # noqa: PLC0415 (as above)

    n, free, forced = problem.horizon, problem.free, problem.forced
    change = np.eye(n) - np.eye(n, k=-1)
    first = np.eye(n)[0]
    solver = osqp.OSQP()
    solver.setup(
        P=sparse.csc_matrix(np.triu(2.0 * UNIT * (forced.T @ forced + RHO * change.T @ change))),
        q=np.zeros(n),
        A=sparse.csc_matrix(np.vstack((np.eye(n), change))),
        l=np.repeat([-problem.speed, -problem.change], n),
        u=np.repeat([problem.speed, problem.change], n),
        verbose=False,
        eps_abs=1e-6,
        eps_rel=1e-6,
    )
    low = np.repeat([-problem.speed, -problem.change], n)
    high = -low

    def solve(query: Query) -> float:
        slope = forced.T @ (free @ query.state - query.wanted) - RHO * query.last * first
        low[n], high[n] = query.last - problem.change, query.last + problem.change
        solver.update(q=2.0 * UNIT * slope, l=low, u=high)
        return float(solver.solve(raise_error=True).x[0])

    return solve


def by_do_mpc(problem: Problem) -> Callable[[Query], float]:
    """Return a solver by do-mpc, set up once; its answer is the first command, m/s."""
    with warnings.catch_warnings(action="ignore"):  # of what do-mpc and casadi could do besides
        return _by_do_mpc(problem)


def _by_do_mpc(problem: Problem) -> Callable[[Query], float]:
    import do_mpc  # noqa: PLC0415 (only wanted here)

    n = len(problem.A)
    model: Any = do_mpc.model.Model("discrete")
    x = model.set_variable("_x", "x", shape=(n, 1))
    last = model.set_variable("_x", "last")
    u = model.set_variable("_u", "u")
    wanted = model.set_variable("_tvp", "wanted")
    model.set_rhs("x", problem.A @ x + problem.B[:, None] @ u)
    model.set_rhs("last", u)
    model.setup()

    mpc: Any = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon = problem.horizon
    mpc.settings.t_step = problem.period
    mpc.settings.store_full_solution = False
    mpc.settings.supress_ipopt_output()
    miss = (problem.C[None, :] @ x - wanted) ** 2
    mpc.set_objective(mterm=UNIT * miss, lterm=UNIT * (miss + RHO * (u - last) ** 2))
    mpc.set_rterm(u=0.0)  # it is in the objective, together with the last command
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -problem.speed, problem.speed
    mpc.set_nl_cons("rising", u - last, ub=problem.change)
    mpc.set_nl_cons("falling", last - u, ub=problem.change)
    values = mpc.get_tvp_template()
    mpc.set_tvp_fun(lambda _time: values)
    mpc.setup()

    def solve(query: Query) -> float:
        for k, value in enumerate(query.wanted, 1):
            values["_tvp", k, "wanted"] = value
        state = np.append(query.state, query.last)
        if not mpc.flags["initial_run"]:
            mpc.x0 = state
            mpc.set_initial_guess()
        return float(mpc.make_step(state[:, None])[0, 0])

    return solve
