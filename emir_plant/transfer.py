"""Transfer functions of joint 1's mechanics from the piston force: paper equations (2)-(4).

With the boom's modes q_j and small deviations from rest at the angle alpha,

    q_j'' + d_j q_j' + k_j q_j = phi_j r dF + u_j dalpha,   dalpha = sum of phi_j dq_j
    u_j = phi_j F dr/dalpha + W_j sin(alpha)

where u is what linkage and gravity change with the angle. With the rigid and four bending modes
the numerators have degree 8, the denominator degree 10.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from emir_plant.core import Array
from emir_plant.effects import linkage_error
from emir_plant.plant import Plant


@dataclass(frozen=True)
class TransferFunction:
    """gain * numerator(s) / denominator(s).

    Coefficients by rising power of s as in the paper, that of the highest power being 1.
    """

    gain: float
    numerator: Array
    denominator: Array

    def __call__(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the value at complex frequencies s, rad/s, same shape."""
        above, below = Polynomial(self.numerator)(s), Polynomial(self.denominator)(s)
        return np.asarray(self.gain * above / below)


@dataclass(frozen=True)
class Mechanics:
    """Joint 1's mechanics about rest at an angle, n modes; the input is the piston force, N.

    damping, stiffness: (n,) of the modes. joint, tip: (n,) rotation of the first and the last
    section per mode. follower: (n,) u above. arm: r, m.
    """

    damping: Array
    stiffness: Array
    joint: Array
    tip: Array
    follower: Array
    arm: float

    def state_space(self) -> tuple[Array, Array, Array]:
        """Return A (2n, 2n), B (2n, 1), C (3, 2n); outputs h, m, alpha_1 and alpha_6, rad."""
        n = self.joint.size
        zero = np.zeros((n, n))
        back = np.diag(self.stiffness) - np.outer(self.follower, self.joint)
        a = np.block([[zero, np.eye(n)], [-back, -np.diag(self.damping)]])
        b = np.concatenate((np.zeros(n), self.arm * self.joint)).reshape(-1, 1)
        rows = np.array([self.arm * self.joint, self.joint, self.tip])
        return a, b, np.hstack((rows, np.zeros((3, n))))

    def stroke(self) -> TransferFunction:
        """Return G_h, m/N (2)."""
        return self._function(self.arm * self.joint)

    def joint_angle(self) -> TransferFunction:
        """Return G_alpha1, rad/N (3)."""
        return self._function(self.joint)

    def tip_angle(self) -> TransferFunction:
        """Return G_alpha6, rad/N (4)."""
        return self._function(self.tip)

    def _function(self, row: Array) -> TransferFunction:
        """Return that of the output row . q, exact: no coefficient of a small difference.

        The rank-one term u phi^T is eliminated by hand; what is left over of it is a sum over
        pairs of modes (Lagrange's identity).
        """
        n, u, phi = self.joint.size, self.follower, self.joint
        modes = [Polynomial([k, d, 1.0]) for k, d in zip(self.stiffness, self.damping, strict=True)]

        def others(*left_out: int) -> Polynomial:
            return math.prod(
                (modes[k] for k in range(n) if k not in left_out), start=Polynomial([1.0])
            )

        below = others() - sum(u[i] * phi[i] * others(i) for i in range(n))
        above = sum((row[i] * phi[i] * others(i) for i in range(n)), start=Polynomial([0.0]))
        for i in range(n):
            for j in range(i):
                pair = (row[i] * phi[j] - row[j] * phi[i]) * (u[i] * phi[j] - u[j] * phi[i])
                above = above + pair * others(i, j)
        numerator, denominator = above.coef, below.coef
        return TransferFunction(
            float(self.arm * numerator[-1] / denominator[-1]),
            numerator / numerator[-1],
            denominator / denominator[-1],
        )


def mechanics(plant: Plant, angle: float) -> Mechanics:
    """Return the mechanics about rest at the boom angle, rad, payload and effects included.

    Raises SimulationError where the cylinder cannot hold the boom.
    """
    p = plant.record[0]
    force = plant.outputs(plant.initial(angle)).force
    arm, d = linkage_error.lever_arm(angle, p), 1e-5
    slope = linkage_error.lever_arm(angle + d, p) - linkage_error.lever_arm(angle - d, p)
    slope /= 2.0 * d
    return Mechanics(
        damping=p["mode_damping"],
        stiffness=p["mode_stiffness"],
        joint=p["mode_joint"],
        tip=p["mode_tip_angle"],
        follower=p["mode_joint"] * force * slope + p["mode_weight"] * math.sin(angle),
        arm=arm,
    )
