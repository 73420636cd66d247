"""Order reduction of a continuous linear model dx = A x + B u, y = C x + D u.

Slow modes, the integrator from valve to stroke first of all, are kept as they are; the stable
rest is reduced. (python-control's own balanced reduction needs SLICOT, for which there is no
wheel.)
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError

Array = NDArray[np.float64]

NOTHING = 1e-6  # of the largest Hankel singular value: what gramians in double precision still hold
SLOW = 0.02  # 1/s: modes that decay slower, or grow, are kept


@dataclass(frozen=True)
class Linear:
    """A: (n, n). B: (n, m). C: (p, n). D: (p, m)."""

    A: Array
    B: Array
    C: Array
    D: Array

    @property
    def order(self) -> int:
        """Return n."""
        return len(self.A)


def balanced(model: Linear, order: int) -> Linear:
    """Return the balanced model with `order` states, the weak ones at rest.

    Moore 1981, Liu and Anderson 1989. It has the static gain of the model; over all frequencies
    its error is at most twice the sum of `hankel(model)` that is left out. Raises ParameterError
    for an order that the model does not allow.
    """
    slow, rest = _split(model)
    _check(order, slow.order, model.order)
    reach, observe = _roots(rest)
    U, sizes, V = scipy.linalg.svd(observe.T @ reach)
    n, kept = int(np.count_nonzero(sizes > NOTHING * sizes[0])), order - slow.order
    if kept > n:
        raise ParameterError(f"order = {order}: the model has nothing more to keep")
    scale = 1.0 / np.sqrt(sizes[:n])
    left, right = (observe @ U[:, :n]) * scale, (reach @ V[:n].T) * scale
    even = Linear(left.T @ rest.A @ right, left.T @ rest.B, rest.C @ right, rest.D)
    return _beside(slow, _at_rest(even, kept))


def _at_rest(model: Linear, kept: int) -> Linear:
    """Return the model whose states from `kept` on follow the others at once."""
    A, B, C = model.A, model.B, model.C
    follow = -scipy.linalg.solve(A[kept:, kept:], np.hstack((A[kept:, :kept], B[kept:])))
    states, inputs = follow[:, :kept], follow[:, kept:]
    return Linear(
        A[:kept, :kept] + A[:kept, kept:] @ states,
        B[:kept] + A[:kept, kept:] @ inputs,
        C[:, :kept] + C[:, kept:] @ states,
        model.D + C[:, kept:] @ inputs,
    )


def modal(model: Linear, order: int) -> Linear:
    """Return the model with the modes that weigh most in `order` states, the others at rest.

    Weight of a mode: its residue over its distance from the imaginary axis, the height of its
    peak. What the others add to the static gain becomes D. A pair of modes is not split: where
    only one state is left, the largest real mode takes it, or it stays empty.
    """
    slow, rest = _split(model)
    _check(order, slow.order, model.order)
    poles, vectors = scipy.linalg.eig(rest.A)
    inputs, outputs = scipy.linalg.solve(vectors, rest.B.astype(complex)), rest.C @ vectors
    height = (
        scipy.linalg.norm(inputs, axis=1) * scipy.linalg.norm(outputs, axis=0) / abs(poles.real)
    )
    chosen: list[int] = []
    for k in np.argsort(-height):
        size = 2 if poles[k].imag > 0.0 else 1
        if poles[k].imag >= 0.0 and _states(poles, chosen) + size <= order - slow.order:
            chosen.append(int(k))
    A, B, C = _real_form(poles[chosen], inputs[chosen], outputs[:, chosen])
    static = -rest.C @ scipy.linalg.solve(rest.A, rest.B) + C @ scipy.linalg.solve(A, B)
    return _beside(slow, Linear(A, B, C, rest.D + static))


def hankel(model: Linear) -> Array:
    """Return the Hankel singular values of the model beside its slow modes, largest first."""
    _, rest = _split(model)
    reach, observe = _roots(rest)
    return np.asarray(scipy.linalg.svdvals(observe.T @ reach))


def _check(order: int, slow: int, full: int) -> None:
    if not slow < order <= full:
        raise ParameterError(f"order = {order}: the model allows {slow + 1} ... {full}")


def _split(model: Linear) -> tuple[Linear, Linear]:
    """Return slow and fast modes; their outputs add up to the model's."""
    scaled, (scale, _) = scipy.linalg.matrix_balance(model.A, permute=False, separate=True)
    A, B, C = scaled, model.B / scale[:, None], model.C * scale
    T, Z, n = scipy.linalg.schur(A, sort=lambda re, _: re > -SLOW)
    # T = [[slow, coupling], [0, fast]]; a Sylvester equation takes the coupling away.
    X = scipy.linalg.solve_sylvester(T[:n, :n], -T[n:, n:], -T[:n, n:])
    B, C = Z.T @ B, C @ Z
    slow = Linear(T[:n, :n], B[:n] - X @ B[n:], C[:, :n], np.zeros_like(model.D))
    return slow, Linear(T[n:, n:], B[n:], C[:, :n] @ X + C[:, n:], model.D)


def _beside(a: Linear, b: Linear) -> Linear:
    return Linear(
        scipy.linalg.block_diag(a.A, b.A), np.vstack((a.B, b.B)), np.hstack((a.C, b.C)), a.D + b.D
    )


def _roots(model: Linear) -> tuple[Array, Array]:
    """Return roots of the reachability and observability gramians of a stable model."""
    reach = scipy.linalg.solve_continuous_lyapunov(model.A, -model.B @ model.B.T)
    observe = scipy.linalg.solve_continuous_lyapunov(model.A.T, -model.C.T @ model.C)
    return _root(np.asarray(reach)), _root(np.asarray(observe))


def _root(gramian: Array) -> Array:
    """Return R with R R^T = gramian, which may be singular."""
    values, vectors = scipy.linalg.eigh(0.5 * (gramian + gramian.T))
    return np.asarray(vectors * np.sqrt(np.clip(values, 0.0, None)))


def _states(poles: NDArray[np.complex128], chosen: list[int]) -> int:
    return sum(2 if poles[k].imag > 0.0 else 1 for k in chosen)


def _real_form(
    poles: NDArray[np.complex128],
    inputs: NDArray[np.complex128],
    outputs: NDArray[np.complex128],
) -> tuple[Array, Array, Array]:
    """Return A, B, C of modes, one of each pair given, in real numbers."""
    blocks, rows, columns = [], [], []
    for pole, b, c in zip(poles, inputs, outputs.T, strict=True):
        if pole.imag == 0.0:
            blocks.append(np.array([[pole.real]]))
            rows.append([b.real])
            columns.append([c.real])
        else:
            blocks.append(np.array([[pole.real, pole.imag], [-pole.imag, pole.real]]))
            rows.append([2.0 * b.real, -2.0 * b.imag])
            columns.append([c.real, c.imag])
    A = scipy.linalg.block_diag(*blocks)
    return A, np.vstack([np.array(r) for r in rows]), np.vstack([np.array(c) for c in columns]).T
