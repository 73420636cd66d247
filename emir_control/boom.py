"""The boom as a planner or an observer sees it: a few modes for each of some payloads.

    q'' + D q' + K q = J tau - W cos(alpha),    alpha = J^T q

with q the coordinates of mass-normalised modes, the rigid one first, and tau the torque at the
joint, N m.
"""

from dataclasses import dataclass, fields

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Boom:
    """Modes of the boom with one payload, m of them.

    stiffness, damping: (m,) K and D, 1/s^2 and 1/s. joint, tip_angle: (m,) rotation of the first
    and the last section. weight: (m,) W. deflection, tip: (m,) m, displacement of the TCP off the
    line of the first section and as a whole. All per modal coordinate.
    """

    stiffness: Array
    damping: Array
    joint: Array
    tip_angle: Array
    weight: Array
    deflection: Array
    tip: Array

    @property
    def holding_torque(self) -> float:
        """Return the torque, N m, that holds the horizontal boom."""
        return float(self.weight[0] / self.joint[0])

    def sag(self) -> Array:
        """Return q, (m,), that the weight of the horizontal boom adds to a straight one."""
        bent = self.joint * self.holding_torque - self.weight
        q = np.zeros_like(bent)
        q[1:] = bent[1:] / self.stiffness[1:]
        q[0] = -self.joint[1:] @ q[1:] / self.joint[0]
        return q

    def clamped(self) -> "ClampedBoom":
        """Return how the boom bends under a given motion of the joint."""
        rigid = np.zeros_like(self.joint)
        rigid[0] = 1.0 / self.joint[0]
        basis = scipy.linalg.null_space(self.joint[None, :])
        squares, vectors = np.linalg.eigh(basis.T @ (self.stiffness[:, None] * basis))
        shapes = basis @ vectors
        return ClampedBoom(
            stiffness=squares,
            damping=shapes.T @ (self.damping[:, None] * shapes),
            drive=-shapes.T @ rigid,
            deflection=self.deflection @ shapes,
            shapes=shapes,
            rigid=rigid,
        )


@dataclass(frozen=True, eq=False)
class ClampedBoom:
    """z'' + D z' + K z = b alpha'': what the joint's acceleration does to the boom, n = m - 1.

    z: (n,) off the sag of the posture, the slowest first. stiffness: (n,) the diagonal of K.
    damping: (n, n) D. drive: (n,) b. deflection: (n,) of the TCP, m, per coordinate. shapes,
    rigid: (m, n), (m,): q = shapes z + rigid alpha, and the sag.
    """

    stiffness: Array
    damping: Array
    drive: Array
    deflection: Array
    shapes: Array
    rigid: Array

    @property
    def A(self) -> Array:
        """Return the matrix of (z, z'), (2 n, 2 n)."""
        n = len(self.drive)
        return np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(self.stiffness), -self.damping]])

    @property
    def B(self) -> Array:
        """Return how alpha'' drives (z, z'), (2 n,)."""
        return np.append(np.zeros_like(self.drive), self.drive)

    @property
    def C(self) -> Array:
        """Return the row of the TCP's dynamic deflection, m, (2 n,)."""
        return np.append(self.deflection, np.zeros_like(self.drive))


@dataclass(frozen=True, eq=False)
class BoomTable:
    """The boom with each of k rising payloads, kg; between them its numbers change linearly.

    Raises ParameterError for what is no such table.
    """

    payloads: tuple[float, ...]
    booms: tuple[Boom, ...]

    def __post_init__(self) -> None:
        loads = self.payloads
        if len(loads) != len(self.booms) or not loads or list(loads) != sorted(set(loads)):
            raise ParameterError(f"boom: payloads = {list(loads)}: not rising, or not one a boom")
        shape = np.shape(self.booms[0].stiffness)
        for boom in self.booms:
            for field in fields(boom):
                values = getattr(boom, field.name)
                if np.shape(values) != shape or len(shape) != 1 or not np.isfinite(values).all():
                    raise ParameterError(f"boom: {field.name}: not one number for each mode")

    def loaded(self, payload: float) -> Boom:
        """Return the boom with a payload, kg; beyond the table's ends, that of its end."""
        k = int(np.searchsorted(self.payloads, payload))
        low, high = max(k - 1, 0), min(k, len(self.payloads) - 1)
        step = self.payloads[high] - self.payloads[low]
        share = (payload - self.payloads[low]) / step if step else 0.0
        ends = self.booms[low], self.booms[high]
        return Boom(**{
            field.name: (1.0 - share) * getattr(ends[0], field.name)
            + share * getattr(ends[1], field.name)
            for field in fields(Boom)
        })  # fmt: skip

    def payload(self, torque: float) -> float:
        """Return the payload, kg, with which a torque, N m, holds the horizontal boom."""
        torques = [boom.holding_torque for boom in self.booms]
        return float(np.interp(torque, torques, self.payloads))
