"""Joint 1's triangle: piston stroke against boom angle. Every sign convention lives here.

Stroke h grows when the boom is lifted, h = 0 at alpha = 0 (horizontal). F > 0 pushes the boom
up; the joint torque is F r with r = dh/dalpha > 0. Paper equation (1), with its factor 1/r.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant.elementary import cosine, sine
from emir_plant.jit import compiled, square_root

Array = NDArray[np.float64]


@compiled
def third_side(a: float, b: float, enclosed: float) -> float:
    """Return a triangle's third side, m, from two, m, and the angle that they enclose, rad."""
    return square_root(a * a + b * b - 2.0 * a * b * cosine(enclosed))


@compiled
def cylinder_length(angle: float, p: Any) -> float:
    """Return the distance from cylinder foot to rod eye, m, at the boom angle, rad."""
    return third_side(p.triangle_a, p.triangle_b, angle + p.triangle_gamma0)


@compiled
def stroke(angle: float, p: Any) -> float:
    """Return the piston stroke h, m, at the boom angle, rad."""
    return cylinder_length(angle, p) - p.length_stretched


@compiled
def lever_arm(angle: float, p: Any) -> float:
    """Return r = dh/dalpha, m, at the boom angle, rad."""
    across = p.triangle_b * sine(angle + p.triangle_gamma0)
    return p.triangle_a * across / cylinder_length(angle, p)


@compiled
def angle(stroke: float, p: Any) -> float:
    """Return the boom angle, rad, at the piston stroke, m."""
    a, b = p.triangle_a, p.triangle_b
    length = p.length_stretched + stroke
    return math.acos((a * a + b * b - length * length) / (2.0 * a * b)) - p.triangle_gamma0


@compiled
def strokes(angles: Array, p: Any) -> Array:
    """Return the piston strokes, (n,) m, at boom angles, (n,) rad."""
    found = np.empty(angles.size)
    for k in range(angles.size):
        found[k] = stroke(angles[k], p)
    return found


@compiled
def lever_arms(angles: Array, p: Any) -> Array:
    """Return the lever arms dh/dalpha, (n,) m, at boom angles, (n,) rad."""
    found = np.empty(angles.size)
    for k in range(angles.size):
        found[k] = lever_arm(angles[k], p)
    return found


@compiled
def reach(p: Any) -> tuple[float, float]:
    """Return the lowest and highest boom angle, rad.

    Between the triangle's dead points, where foot, joint and rod eye are in line and the piston
    moves nothing, and as far as both chambers hold oil.
    """
    low, high = -p.triangle_gamma0, math.pi - p.triangle_gamma0
    retracted = -p.volume_lifting_0 / p.area_lifting
    extended = p.volume_lowering_0 / p.area_lowering
    if stroke(low, p) < retracted:
        low = angle(retracted, p)
    if stroke(high, p) > extended:
        high = angle(extended, p)
    return low, high
