"""The robot at rest in a posture: deflection under its weight, forces to hold it, its modes."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_plant.robot import kinematics
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.kinematics import Deflection
from emir_plant.robot.reach import PostureError, check

Array = NDArray[np.float64]

SETTLED = 1e-13  # m or rad, change of the deflections from one iteration to the next


@dataclass(frozen=True)
class Rest:
    """The robot at rest.

    coordinates: q, (96,). torques: (6,) N m, base and joints 1-5. forces: (5,) N on the pistons.
    """

    coordinates: Array
    torques: Array
    forces: Array


class Modes(NamedTuple):
    """Undamped small oscillations, slowest first: frequency, (m,) Hz, shapes (n, m)."""

    frequency: Array
    shapes: Array


def rigid(mechanics: Mechanics, joints: Array) -> Array:
    """Return the coordinates, (n,), of the undeflected robot at the six joint angles, rad.

    joints: base, then joints 1-5. Raises PostureError outside a linkage's reach.
    """
    joints = np.asarray(joints, dtype=np.float64)
    if joints.shape != (6,) or not np.isfinite(joints).all():
        raise PostureError(f"a posture has 6 finite joint angles, not {joints.tolist()}")
    check(joints[1:], mechanics.reaches)
    q = np.zeros(mechanics.size)
    q[mechanics.topology.joints] = joints
    return q


def rest(mechanics: Mechanics, joints: Array) -> Rest:
    """Return the robot at rest at the six joint angles, rad, base first.

    The deflections are those under the weight in the deflected posture. Raises PostureError
    outside a linkage's reach, or where the boom would buckle.
    """
    q = rigid(mechanics, joints)
    cuts, standing = mechanics.topology.cuts.ravel(), np.zeros(mechanics.size)
    springs = mechanics.stiffness[np.ix_(cuts, cuts)]
    for _ in range(100):
        weight = mechanics.bias(q, standing)
        before = q[cuts]
        q[cuts] = np.linalg.solve(springs, -weight[cuts])
        if not np.abs(q).max() < math.pi:
            break
        if np.abs(q[cuts] - before).max() < SETTLED:
            torques = mechanics.bias(q, standing)[mechanics.topology.joints]
            return Rest(q, torques, torques[1:] / mechanics.ratios(q))
    raise PostureError("the boom does not come to rest: its springs are too weak for its weight")


def deflection(mechanics: Mechanics, q: Array) -> Deflection:
    """Return the TCP's deflection at the coordinates q, (n,), moving or not."""
    return kinematics.deflection(*mechanics.tips(q))


def weight_stiffness(mechanics: Mechanics, q: Array) -> Array:
    """Return how the weight's generalised forces change with the coordinates, (n, n)."""
    step, standing = 1e-6, np.zeros_like(q)
    slope = np.empty((q.size, q.size))
    for k in range(q.size):
        ahead, behind = q.copy(), q.copy()
        ahead[k] += step
        behind[k] -= step
        difference = mechanics.bias(ahead, standing) - mechanics.bias(behind, standing)
        slope[:, k] = difference / (2.0 * step)
    return 0.5 * (slope + slope.T)


def modes(mechanics: Mechanics, q: Array, springs: Array, *, weight: bool = True) -> Modes:
    """Return the small oscillations about q, (n,), with a spring on each joint.

    springs: (6,) N m/rad, base first; 0 leaves the joint free, infinity locks it.
    weight: whether the weight's change with the posture takes part.
    """
    joints = mechanics.topology.joints
    free = np.setdiff1d(np.arange(q.size), joints[np.isinf(springs)])
    stiffness = mechanics.stiffness.copy()
    held = joints[np.isfinite(springs)]
    stiffness[held, held] += springs[np.isfinite(springs)]
    if weight:
        stiffness += weight_stiffness(mechanics, q)
    block = np.ix_(free, free)
    squares, shapes = scipy.linalg.eigh(stiffness[block], mechanics.mass(q)[block])
    whole = np.zeros((q.size, free.size))
    whole[free] = shapes
    return Modes(np.sqrt(np.clip(squares, 0.0, None)) / (2.0 * math.pi), whole)
