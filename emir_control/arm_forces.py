"""What moving the arm along a path takes: torques of its joints by weight and inertia.

The arm is its sections' masses, each as two points at +-1/sqrt(12) of the section's length off its
middle, which have a uniform rod's mass, centre and inertia, and the payload at the TCP. With r(w)
the points over the way w along the path, bending under the weight included,

    tau = sum m J^T (g + r' w'' + r'' w'^2),    J = dr/d(joints).
"""

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_control.arm import GRAVITY, JOINTS, Arm

Array = NDArray[np.float64]

UNIT = 1.0  # kg
ITERATIONS = 3
LEAST_DOUBT = 0.02  # of the joint that carries most
HALF = 0.5 / np.sqrt(3.0)  # of a section, its points off its middle


def torques_along(arm: Arm, ways: Array, joints: Array) -> Array:
    """Return the torques, (n, 3, 6), N m: at rest, and by w'^2 and by w''.

    ways: (n,), where the path has the joints' angles, (n, 6), rad.
    """
    masses = _masses(arm)
    points = _points(arm, joints)
    flat = scipy.interpolate.CubicSpline(ways, points.reshape(len(ways), -1))
    moved = (flat(ways, k).reshape(points.shape) for k in (2, 1))
    weight = np.broadcast_to([0.0, 0.0, GRAVITY], points.shape)
    pulls = masses[:, np.newaxis] * np.stack([weight, *moved], axis=1)  # (n, 3, points, 3)
    slopes = _slopes(arm, points, joints)
    return np.asarray(np.einsum("ntpc,njpc->ntj", pulls, slopes, optimize=True))


def holding_torques(arm: Arm, joints: Array) -> Array:
    """Return the torques, (6,), N m, that hold the arm at the joints' angles, (6,), rad."""
    return GRAVITY * np.asarray(_slopes(arm, _points(arm, joints), joints)[:, :, 2] @ _masses(arm))


def weighed(arm: Arm, joints: Array, torques: Array) -> float:
    """Return the payload, kg, by which the torques, (6,), N m, hold the arm at rest.

    What the picture of the arm is wrong by grows with the weight beyond a joint; so each joint
    counts the less the more the arm without payload loads it: the last one most.
    """

    def carried(payload: float) -> Array:
        return holding_torques(Arm(replace(arm.parameters, payload=payload)), joints)[1:]

    empty, payload = np.abs(carried(0.0)), 0.0
    doubt = np.maximum(empty, LEAST_DOUBT * empty.max())
    for _ in range(ITERATIONS):  # the arm sags under what it carries
        now = carried(payload)
        per_kg = (carried(payload + UNIT) - now) / UNIT / doubt
        missing = (torques[1:] - now) / doubt
        payload = max(payload + float(per_kg @ missing / (per_kg @ per_kg)), 0.0)
    return payload


def _masses(arm: Arm) -> Array:
    p = arm.parameters
    sections = p.sections * (len(JOINTS) - 1)
    return np.append(np.full(2 * sections, 0.5 * p.arm_mass / p.sections), p.payload)


def _points(arm: Arm, joints: Array) -> Array:
    """Return where the masses are, (..., points, 3), m, from joint 1; the payload last.

    joints: angles, (..., 6), rad.
    """
    forward, up = arm.ends(joints)
    base = joints[..., :1]

    def spread(ends: Array) -> Array:
        middle, length = 0.5 * (ends[..., 1:] + ends[..., :-1]), np.diff(ends)
        pairs = np.stack((middle - HALF * length, middle + HALF * length), -1)
        return np.concatenate((pairs.reshape(*ends.shape[:-1], -1), ends[..., -1:]), -1)

    out = spread(forward)
    return np.stack((out * np.cos(base), out * np.sin(base), spread(up)), -1)


def _slopes(arm: Arm, points: Array, joints: Array) -> Array:
    """Return dr/d(joints), (..., 6, points, 3), with the bending held.

    points: (..., points, 3). joints: (..., 6).
    """
    forward, up = arm.ends(joints)
    cos, sin = np.cos(joints[..., :1]), np.sin(joints[..., :1])
    distance = points[..., 0] * cos + points[..., 1] * sin
    slopes = np.zeros((*joints.shape[:-1], len(JOINTS), *points.shape[-2:]))
    slopes[..., 0, :, 0], slopes[..., 0, :, 1] = -points[..., 1], points[..., 0]
    each = 2 * arm.parameters.sections
    for k in range(1, len(JOINTS)):
        first = (k - 1) * each
        pivot = (k - 1) * arm.parameters.sections
        over = up[..., pivot, np.newaxis] - points[..., first:, 2]
        slopes[..., k, first:, 0], slopes[..., k, first:, 1] = over * cos, over * sin
        slopes[..., k, first:, 2] = distance[..., first:] - forward[..., pivot, np.newaxis]
    return slopes
