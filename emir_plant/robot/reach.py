"""How far a linkage reaches, and where it is dead."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from emir_common.quantity import ParameterError, quantities
from emir_plant.robot import linkage
from emir_plant.robot.parameters import Linkage


class PostureError(ParameterError):
    """A posture that the linkages do not reach; the message is one line."""


class DeadPoint(NamedTuple):
    """An angle, rad, at which the linkage transmits no force one way or no motion the other."""

    angle: float
    meaning: str


class Reach(NamedTuple):
    """What a cylinder's stroke makes of a joint; m and rad."""

    stroke_low: float
    stroke_high: float
    angle_low: float
    angle_high: float
    ratio_low: float
    ratio_high: float
    dead_points: tuple[DeadPoint, ...]


def record(geometry: Linkage) -> NDArray[Any]:
    """Return the linkage as the compiled functions read it, a structured array of one element.

    Adds on which side of their dead points lever and arm link stand in the stretched posture.
    Raises PostureError where the loop does not close there.
    """
    values: dict[str, float] = {n: float(getattr(geometry, n)) for n in quantities(geometry)}
    values |= {"lever_side": 1.0, "arm_side": 1.0, "length_stretched": 0.0}
    table = np.array([tuple(values.values())], dtype=[(name, np.float64) for name in values])
    p = table[0]
    if not math.isfinite(linkage.lever_direction(0.0, p)):
        raise PostureError("the linkage does not close at alpha = 0")
    p["lever_side"] = math.copysign(1.0, _lever_in_line_with_cylinder(0.0, p))
    p["length_stretched"] = linkage.cylinder_length(0.0, p)
    p["arm_side"] = math.copysign(1.0, _bar_in_line_with_arm_link(0.0, p))
    return table


def reach(geometry: Linkage) -> Reach:
    """Return strokes, angles, extremes of dh/dalpha and the dead points of the whole turn.

    Raises PostureError where an end of the stroke is beyond the linkage or a dead point lies
    within it.
    """
    p = record(geometry)[0]
    low = geometry.length_retracted - linkage.cylinder_length(0.0, p)
    high = low + geometry.stroke
    angles = [linkage.angle(h, p) for h in (low, high)]
    if not np.isfinite(angles).all():
        raise PostureError(f"strokes {low:.3f} ... {high:.3f} m are beyond the linkage")
    if angles[0] >= angles[1]:
        raise PostureError("the cylinder lowers the arm when it extends")
    ratios = [linkage.ratio(a, p) for a in np.linspace(angles[0], angles[1], 361)]
    if not min(ratios) > 0.0:
        raise PostureError(f"a dead point lies within the strokes {low:.3f} ... {high:.3f} m")
    dead = dead_points(geometry)
    return Reach(low, high, angles[0], angles[1], min(ratios), max(ratios), dead)


def check(angles: NDArray[np.float64], reaches: tuple[Reach, ...]) -> None:
    """Raise PostureError, naming the joint, unless every angle, rad, is within its reach."""
    for number, (angle, of) in enumerate(zip(angles, reaches, strict=True), start=1):
        if not of.angle_low - 1e-9 <= angle <= of.angle_high + 1e-9:
            low, high = math.degrees(of.angle_low), math.degrees(of.angle_high)
            raise PostureError(
                f"joint {number}: {math.degrees(angle):.1f} deg is outside the linkage's reach, "
                f"{low:.1f} ... {high:.1f} deg"
            )


def dead_points(geometry: Linkage) -> tuple[DeadPoint, ...]:
    """Return the dead points between -180 and 180 deg, by angle."""
    p = record(geometry)[0]
    kinds: list[tuple[str, Callable[[float, Any], float]]] = [
        ("cylinder in line with lever: it cannot turn the joint", _lever_in_line_with_cylinder)
    ]
    if geometry.thrust_bar > 0.0:
        blocked = "thrust bar in line with lever: the arm cannot move it"
        kinds += [
            (
                "thrust bar in line with arm link: it cannot turn the arm",
                _bar_in_line_with_arm_link,
            ),
            (blocked, lambda angle, p: _span(angle, p) - float(p["lever"] + p["thrust_bar"])),
            (blocked, lambda angle, p: _span(angle, p) - abs(float(p["lever"] - p["thrust_bar"]))),
        ]
    found = [DeadPoint(root, meaning) for meaning, zero in kinds for root in _roots(zero, p)]
    return tuple(sorted(found))


def _roots(function: Callable[[float, Any], float], p: Any) -> list[float]:
    """Return the sign changes of a continuous function over one turn, rad."""
    angles = np.linspace(-math.pi, math.pi, 722)[1:]
    values = np.array([function(a, p) for a in angles])
    changes = np.flatnonzero(values[1:] * values[:-1] < 0.0)  # nan where the loop is open
    return [
        float(scipy.optimize.brentq(function, angles[k], angles[k + 1], args=(p,))) for k in changes
    ]


def _lever_in_line_with_cylinder(angle: float, p: Any) -> float:
    return math.sin(linkage.lever_direction(angle, p) - float(p["foot_direction"]))


def _bar_in_line_with_arm_link(angle: float, p: Any) -> float:
    bar = linkage.motion(angle, p)[linkage.THRUST_BAR, 0]
    return math.sin(bar - angle - float(p["arm_link_direction"]))


def _span(angle: float, p: Any) -> float:
    """Return the distance from the lever's pivot to the arm-side pin, m."""
    pin = float(p["arm_link"]) * np.exp(1j * (angle + float(p["arm_link_direction"])))
    return float(abs(pin - float(p["ground_link"]) * np.exp(1j * float(p["ground_direction"]))))
