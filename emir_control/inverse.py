"""Inverse kinematics along a path of the TCP: six joints for four numbers of place.

The two joints more than needed are resolved by the weighted pseudo-inverse: of all ways to follow
the path the one with the least motion, each joint's counted in the room that it has in its range
(Chan and Dubey 1995 weight so, too); and what is left free pulls every joint towards the middle.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_common.quantity import ParameterError
from emir_control.arm import JOINTS, Arm

Array = NDArray[np.float64]

CLOSE = 1e-9  # m and rad, of the place met
ITERATIONS = 50
LARGEST = 0.3  # rad, that a joint may need from one place to the next
PULL = 0.1  # 1/m, towards the middle of the range per way of the TCP


class ReachError(ParameterError):
    """A place that the arm does not reach; the message is one line."""


@dataclass(frozen=True)
class Ranges:
    """The joints' ranges, (6,) each, rad, base first."""

    low: Array
    high: Array

    def share(self, joints: Array) -> Array:
        """Return where in their ranges joints stand, (6,): -1 ... 1."""
        return np.asarray((2.0 * joints - self.low - self.high) / (self.high - self.low))

    def room(self, joints: Array) -> Array:
        """Return how freely the joints may move, (6,), rad: half the range in its middle."""
        share = np.clip(self.share(joints), -0.99, 0.99)
        return np.asarray(0.5 * (self.high - self.low) * (1.0 - share**2))

    def pull(self, joints: Array) -> Array:
        """Return the way to the middle of the ranges, (6,), rad."""
        return 0.5 * (self.low + self.high) - joints


def follow(arm: Arm, ranges: Ranges, start: Array, places: Array) -> Array:
    """Return joints, (n, 6), rad, whose TCP is at the places, (n, 4), from joints `start`, (6,).

    Raises ReachError, naming place or joint, where the arm or a joint's range ends.
    """
    found = np.empty((len(places), start.size))
    joints, before = start, arm.tcp(start)
    for k, place in enumerate(places):
        way = float(np.linalg.norm(place[:3] - before[:3]))
        joints = _met(arm, ranges, joints, place, PULL * way)
        _check(ranges, joints, place)
        found[k], before = joints, place
    return found


def _met(arm: Arm, ranges: Ranges, joints: Array, place: Array, pull: float) -> Array:
    """Return the joints near `joints` at which the TCP is at the place."""
    begin, weight = joints, ranges.room(joints) ** 2
    for iteration in range(ITERATIONS):
        error = place - arm.tcp(joints)
        if iteration and np.abs(error).max() < CLOSE:
            return joints
        slope = arm.jacobian(joints)
        inverse = _pseudo_inverse(slope, weight)
        step = inverse @ error
        if iteration == 0:
            free = ranges.pull(joints)
            step += pull * (free - inverse @ (slope @ free))
        joints = joints + step
        if np.abs(joints - begin).max() > LARGEST:
            break
    raise ReachError(f"the arm does not reach {_text(place)}")


def _pseudo_inverse(slope: Array, weight: Array) -> Array:
    """Return W J^T (J W J^T)^-1, (6, 4), for the weights W of the joints, (6,)."""
    weighted = weight[:, np.newaxis] * slope.T
    try:
        return np.asarray(weighted @ np.linalg.inv(slope @ weighted))
    except np.linalg.LinAlgError:
        raise ReachError("the arm is stretched or stands upright: it cannot go straight") from None


def _check(ranges: Ranges, joints: Array, place: Array) -> None:
    for name, angle, low, high in zip(JOINTS, joints, ranges.low, ranges.high, strict=True):
        if not low <= angle <= high:
            raise ReachError(
                f"{_text(place)}: {name} would be at {np.degrees(angle):.1f} deg,"
                f" its range is {np.degrees(low):.1f} ... {np.degrees(high):.1f} deg"
            )


def _text(place: Array) -> str:
    x, y, z, pitch = place
    return f"x {x:.2f} m, y {y:.2f} m, z {z:.2f} m, pitch {np.degrees(pitch):.1f} deg"
