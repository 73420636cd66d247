"""Linkages between cylinder and joint: stroke, ratio dh/dalpha and the motion of every part.

All in the vertical plane of the joint, seen from the right: x forward along the carrying arm,
z up, directions as angles from x towards z. The cylinder turns the lever about its pivot. The
lever of joint 1 is fixed to the arm (a triangle: the pivot is the joint); the levers of joints
2-5 drive the arm through a thrust bar (a four-bar). Paper equation (1).

Signs as in `emir_plant.linkage`: h = 0 at alpha = 0, h grows when the arm is lifted. Points of
the plane are complex numbers, so that a turn by 90 deg is a factor 1j.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant.jit import compiled
from emir_plant.linkage import third_side

Array = NDArray[np.float64]

LEVER, THRUST_BAR, CYLINDER, LENGTH = 0, 1, 2, 3  # rows of `motion`


@compiled
def _unit(direction: float) -> complex:
    return complex(math.cos(direction), math.sin(direction))


@compiled
def _direction(point: complex) -> float:
    return math.atan2(point.imag, point.real)


@compiled
def _dot(a: complex, b: complex) -> float:
    return a.real * b.real + a.imag * b.imag


@compiled
def _apex(near: float, base: float, far: float) -> float:
    """Return the angle between the sides `near` and `base` of a triangle, rad; nan if none."""
    cosine = (near * near + base * base - far * far) / (2.0 * near * base)
    return math.acos(cosine) if abs(cosine) <= 1.0 else math.nan


@compiled
def lever_direction(angle: float, p: Any) -> float:
    """Return the lever's direction, rad, at the joint angle, rad; nan outside the loop's reach."""
    if p.thrust_bar == 0.0:
        return angle + p.arm_link_direction
    pin = p.arm_link * _unit(angle + p.arm_link_direction) - p.ground_link * _unit(
        p.ground_direction
    )
    return _direction(pin) + p.assembly * _apex(p.lever, abs(pin), p.thrust_bar)


@compiled
def motion(angle: float, p: Any) -> Array:
    """Return where the linkage's parts are and how they move with the joint.

    (4, 3): direction of lever, thrust bar and cylinder, rad, and the cylinder's length, m; in
    the columns the value, its first and its second derivative with respect to the angle.
    """
    parts = np.zeros((4, 3))
    lever = lever_direction(angle, p)
    rod_eye = p.lever * _unit(lever)  # from the lever's pivot
    turn = 1j * rod_eye
    slope, bend = 1.0, 0.0
    if p.thrust_bar > 0.0:
        arm_link = p.arm_link * _unit(angle + p.arm_link_direction)
        bar = arm_link - p.ground_link * _unit(p.ground_direction) - rod_eye
        # the bar keeps its length: bar . d(bar) = 0, differentiated once more for the bend
        slope = _dot(bar, 1j * arm_link) / _dot(bar, turn)
        rate = 1j * arm_link - slope * turn
        rest = slope * slope * rod_eye - arm_link
        bend = (_dot(rate, rate) + _dot(bar, rest)) / _dot(bar, turn)
        square = p.thrust_bar * p.thrust_bar
        parts[THRUST_BAR, 0] = _direction(bar)
        parts[THRUST_BAR, 1] = _dot(rate, 1j * bar) / square
        parts[THRUST_BAR, 2] = _dot(rest - bend * turn, 1j * bar) / square
    parts[LEVER, 0], parts[LEVER, 1], parts[LEVER, 2] = lever, slope, bend

    cylinder = rod_eye - p.foot * _unit(p.foot_direction)
    length = abs(cylinder)
    along, across = cylinder / length, 1j * cylinder / length
    rate = slope * turn
    second = bend * turn - slope * slope * rod_eye
    parts[LENGTH, 0] = length
    parts[LENGTH, 1] = _dot(rate, along)
    parts[CYLINDER, 0] = _direction(cylinder)
    parts[CYLINDER, 1] = _dot(rate, across) / length
    parts[LENGTH, 2] = _dot(second, along) + length * parts[CYLINDER, 1] ** 2
    twice = 2.0 * parts[LENGTH, 1] * parts[CYLINDER, 1]
    parts[CYLINDER, 2] = (_dot(second, across) - twice) / length
    return parts


@compiled
def cylinder_length(angle: float, p: Any) -> float:
    """Return the distance from cylinder foot to rod eye, m, at the joint angle, rad."""
    return third_side(p.foot, p.lever, lever_direction(angle, p) - p.foot_direction)


@compiled
def stroke(angle: float, p: Any) -> float:
    """Return the piston stroke h, m, at the joint angle, rad."""
    return cylinder_length(angle, p) - p.length_stretched


@compiled
def ratio(angle: float, p: Any) -> float:
    """Return r = dh/dalpha, m, at the joint angle, rad."""
    return motion(angle, p)[LENGTH, 1]


@compiled
def ratio_slope(angle: float, p: Any) -> float:
    """Return dr/dalpha, m, at the joint angle, rad."""
    return motion(angle, p)[LENGTH, 2]


@compiled
def angle(stroke: float, p: Any) -> float:
    """Return the joint angle, rad, at the piston stroke, m; nan outside the linkage's reach."""
    theta = _apex(p.foot, p.lever, p.length_stretched + stroke)
    lever = p.foot_direction + p.lever_side * theta
    if p.thrust_bar == 0.0:
        found = lever - p.arm_link_direction
    else:
        rod_eye = p.ground_link * _unit(p.ground_direction) + p.lever * _unit(lever)
        inside = p.arm_side * _apex(p.arm_link, abs(rod_eye), p.thrust_bar)
        found = _direction(rod_eye) + inside - p.arm_link_direction
    return _direction(_unit(found))
