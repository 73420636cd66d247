"""Offline design of the predictive control: model reduction, observer, stability.

A machine comes in as a sampled linear model from the piston velocity command to the controlled
output; nothing here knows which machine it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError
from emir_control.force_loop import ForceLoopParameters
from emir_control.internal_model import InternalModel
from emir_control.pfc import Pfc, PfcInputs, PfcState
from emir_control.scheduled_pfc import blended

Array = NDArray[np.float64]

INTEGRATOR = 5e-3  # |z - 1| below which the slowest pole counts as the valve-to-stroke integrator
SMALL = 1e-6  # size of the states that probe the law, far from its limits


def with_force_loop(
    valve: InternalModel, force: Array, slope: float, p: ForceLoopParameters
) -> InternalModel:
    """Return the model from velocity command to output behind the force loop (9), (10).

    valve: the machine from valve current to output. force: (n,), the row that reads the piston
    force, N, off its state. slope: valve current per wanted piston velocity, s/m, the prefilter's.
    The result's last state is the force's low-passed part.
    """
    n, keep = valve.order, np.exp(-valve.period / p.time_constant)
    B = slope * valve.B
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = valve.A - np.outer(B, p.gain * keep * force)
    A[:n, n] = p.gain * keep * B
    A[n, :n] = (1.0 - keep) * force
    A[n, n] = keep
    return InternalModel(A, np.append(B, 0.0), np.append(valve.C, 0.0), valve.period)


def reduced(model: InternalModel, order: int) -> InternalModel:
    """Return the model with `order` states: the integrator and a balanced truncation of the rest.

    Raises ParameterError where the model has no integrator, is unstable beside it, or has fewer
    states than asked for.
    """
    if not 2 <= order <= model.order:  # noqa: PLR2004 (an integrator and one state at least)
        raise ParameterError(f"order = {order}: the model allows 2 ... {model.order}")
    rest, integrator = _split(model)
    A, B, C = _balanced(*rest, order - 1)
    return InternalModel(
        scipy.linalg.block_diag(np.ones((1, 1)), A),
        np.append(integrator, B),
        np.append(1.0, C),
        model.period,
    )


def _split(model: InternalModel) -> tuple[tuple[Array, Array, Array], float]:
    """Return the stable part (A, B, C) and the gain b of the integrator b / (z - 1)."""
    distance = np.sort(abs(scipy.linalg.eigvals(model.A) - 1.0))
    if distance[0] > INTEGRATOR:
        raise ParameterError(
            f"the model has no integrator: its slowest pole is {distance[0]:.2g} off 1"
        )
    between = 0.5 * (distance[0] + distance[1])
    T, Z, _ = scipy.linalg.schur(model.A, sort=lambda re, im: np.hypot(re - 1.0, im) > between)
    # T = [[stable, coupling], [0, integrator]]; a Sylvester equation takes the coupling away.
    n = model.order - 1
    X = scipy.linalg.solve_sylvester(T[:n, :n], -T[n:, n:], -T[:n, n:])
    B, C = Z.T @ model.B, model.C @ Z
    stable = T[:n, :n], B[:n] - X[:, 0] * B[n], C[:n]
    if max(abs(scipy.linalg.eigvals(stable[0]))) >= 1.0:
        raise ParameterError("the model is unstable beside its integrator")
    return stable, float((C[:n] @ X[:, 0] + C[n]) * B[n])


def _balanced(A: Array, B: Array, C: Array, order: int) -> tuple[Array, Array, Array]:
    """Return the balanced truncation of a stable model (square-root method, Moore 1981)."""
    reach = _root(_gramian(A, B))
    observe = _root(_gramian(A.T, C))
    U, hankel, V = scipy.linalg.svd(observe.T @ reach)
    if hankel[order - 1] < np.finfo(float).eps * hankel[0]:
        raise ParameterError(f"order = {order + 1}: the model has nothing more to keep")
    scale = 1.0 / np.sqrt(hankel[:order])
    left, right = (observe @ U[:, :order]) * scale, (reach @ V[:order].T) * scale
    return left.T @ A @ right, left.T @ B, C @ right


def _gramian(A: Array, B: Array) -> Array:
    """Return X = A X A^T + B B^T. By Schur's form: it takes badly scaled states, too."""
    return np.asarray(scipy.linalg.solve_discrete_lyapunov(A, np.outer(B, B), method="bilinear"))


def _root(gramian: NDArray[Any]) -> Array:
    """Return R with R R^T = gramian, which may be singular."""
    values, vectors = scipy.linalg.eigh(gramian)
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))


@dataclass(frozen=True)
class Noise:
    """Standard deviations that weigh the observer's trust in model and measurement.

    disturbance: m/s, by which the unknown input changes from sample to sample. output: of the
    measurement, m or rad.
    """

    disturbance: float
    output: float


def with_observer(model: InternalModel, noise: Noise) -> InternalModel:
    """Return the model with an unknown constant added to its input, and the Kalman gain for both.

    The command itself is taken to be as uncertain as that input's change.
    """
    n = model.order
    A = np.block([[model.A, model.B[:, None]], [np.zeros((1, n)), np.ones((1, 1))]])
    B, C = np.append(model.B, 0.0), np.append(model.C, 0.0)
    drive = noise.disturbance**2 * scipy.linalg.block_diag(
        np.outer(model.B, model.B), np.ones((1, 1))
    )
    P = scipy.linalg.solve_discrete_are(A.T, C[:, None], drive, np.array([[noise.output**2]]))
    return InternalModel(A, B, C, model.period, P @ C / (C @ P @ C + noise.output**2))


Part = tuple[Pfc, float]  # a law and its weight


def closed_loop(parts: Sequence[Part], machine: InternalModel) -> Array:
    """Return the matrix z(i+1) = M z(i) of laws and machine at a constant set point, no limits.

    parts: one law of weight 1, or several of a schedule whose weights stand still. z: the
    machine's state, each law's model and errors, and the command. The laws themselves are asked:
    they are linear, so their answers to unit states are the columns.
    """
    laws, weights = [law for law, _ in parts], dict(enumerate(w for _, w in parts))
    p = laws[0].parameters
    own = [size for law in laws for size in (law.parameters.model.order, p.error_window)]
    sizes = [machine.order, *own, 1]
    columns = []
    for unit in SMALL * np.eye(sum(sizes)):
        x, *memory, command = np.split(unit, np.cumsum(sizes)[:-1])
        inputs = PfcInputs(0.0, 0.0, (0.0,) * p.coincidence[-1], float(machine.C @ x))
        states = [
            PfcState(0.0, model, errors, float(command[0]))
            for model, errors in zip(memory[::2], memory[1::2], strict=True)
        ]
        after, outputs = blended(laws, weights, states, inputs, p.model.period)
        moved = machine.next(x, outputs.velocity_command)
        remembered = [part for state in after for part in (state.model, state.errors)]
        columns.append(np.concatenate([moved, *remembered, [after[0].command]]))
    return np.array(columns).T / SMALL


def spectral_radius(law: Pfc | Sequence[Part], machine: InternalModel) -> float:
    """Return the largest |z| of the closed loop's poles; below 1 it is stable.

    An independent model and the machine both integrate the same command; where they stand
    against each other changes nothing. That one pole at 1, of each law, is left out.
    """
    parts = [(law, 1.0)] if isinstance(law, Pfc) else law
    poles = scipy.linalg.eigvals(closed_loop(parts, machine))
    for part, _ in parts:
        if part.parameters.model.observer is None:
            poles = np.delete(poles, np.argmin(abs(poles - 1.0)))
    return float(max(abs(poles)))
