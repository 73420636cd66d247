"""The controller's picture of the whole arm: where its TCP is, bent by its own weight.

All five arms turn in one vertical plane, which the base turns about the vertical. So the TCP's
place has four numbers that the six joints decide: x forward, y left, z up, m, and the pitch of the
last section over the horizontal, rad. Its yaw is the base's, it cannot roll.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import ParameterError, check_ranges, quantity

Array = NDArray[np.float64]

JOINTS = ("base", "joint1", "joint2", "joint3", "joint4", "joint5")
PLACE = ("x", "y", "z", "pitch")
GRAVITY = 9.81  # m/s^2
SETTLED = 1e-12  # rad, change of the bending from one iteration to the next


@dataclass(frozen=True, kw_only=True)
class ArmParameters:
    """Five equal arms of equal sections with a bending spring between any two of an arm."""

    height: float = quantity("m", 0.0, 20.0, "ground to joint 1")
    arm_length: float = quantity("m", 0.1, 20.0, "of each of the five arms")
    arm_mass: float = quantity("kg", 0.0, 1e5, "of each arm, uniform")
    sections: int = quantity("1", 1, 1000, "of an arm", default=4)
    section_spring: float = quantity("N m/rad", 1e5, 1e15, "bending spring between sections")
    payload: float = quantity("kg", 0.0, 3000.0, "at the TCP, as far as it is known", default=0.0)
    sag: int = quantity("1", 0, 1, "1: the TCP bent by its weight; 0: of the rigid arm", default=1)

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True)
class Arm:
    """The TCP's place from the joints' angles, and its slope."""

    parameters: ArmParameters

    def tcp(self, joints: Array) -> Array:
        """Return the TCP's x, y, z, pitch, (..., 4), m and rad, at rest.

        joints: angles, (..., 6), of one posture or many, rad.
        """
        direction = self._directions(joints)
        forward, up = self._ends(direction)
        base, out = joints[..., 0], forward[..., -1]
        height = self.parameters.height + up[..., -1]
        return np.stack((np.cos(base) * out, np.sin(base) * out, height, direction[..., -1]), -1)

    def jacobian(self, joints: Array) -> Array:
        """Return d(x, y, z, pitch)/d(joints), (4, 6), of the arm with its bending held."""
        p, base = self.parameters, joints[0]
        forward, up = self.ends(joints)
        pivots = np.arange(len(JOINTS) - 1) * p.sections
        outward, upward = forward[-1] - forward[pivots], up[-1] - up[pivots]
        slope = np.zeros((len(PLACE), len(JOINTS)))
        slope[:2, 0] = -math.sin(base) * forward[-1], math.cos(base) * forward[-1]
        slope[0, 1:], slope[1, 1:] = -math.cos(base) * upward, -math.sin(base) * upward
        slope[2, 1:], slope[3, 1:] = outward, 1.0
        return slope

    def ends(self, joints: Array) -> tuple[Array, Array]:
        """Return how far out and up the sections' ends are from joint 1, (..., n + 1) each, m.

        joints: angles, (..., 6), rad.
        """
        return self._ends(self._directions(joints))

    def _directions(self, joints: Array) -> Array:
        """Return the sections' directions over the horizontal, (..., n), rad.

        Bent, they are those in which the bending agrees with the weight of the bent arm.
        """
        p = self.parameters
        straight = np.repeat(np.cumsum(joints[..., 1:], -1), p.sections, -1)
        if not p.sag:
            return straight
        cut = np.arange(straight.shape[-1]) % p.sections != 0  # the others are joints
        direction = straight
        for _ in range(100):
            bent = straight - np.cumsum(cut * self._moments(direction), -1) / p.section_spring
            change = np.abs(bent - direction).max()
            direction = bent
            if change < SETTLED:
                return direction
        raise ParameterError("section_spring: too weak for the arm's weight")

    def _moments(self, direction: Array) -> Array:
        """Return the moments of all weight beyond at the sections' inner ends, (..., n), N m."""
        p = self.parameters
        forward, _ = self._ends(direction)
        mass = p.arm_mass / p.sections
        middle = 0.5 * (forward[..., :-1] + forward[..., 1:])
        torque = np.cumsum((mass * middle)[..., ::-1], -1)[..., ::-1]
        torque = torque + p.payload * forward[..., -1:]
        beyond = mass * np.arange(middle.shape[-1], 0, -1) + p.payload
        return np.asarray(GRAVITY * (torque - beyond * forward[..., :-1]))

    def _ends(self, direction: Array) -> tuple[Array, Array]:
        length = self.parameters.arm_length / self.parameters.sections
        start = np.zeros((*direction.shape[:-1], 1))
        forward = np.concatenate((start, np.cumsum(length * np.cos(direction), -1)), -1)
        return forward, np.concatenate((start, np.cumsum(length * np.sin(direction), -1)), -1)
