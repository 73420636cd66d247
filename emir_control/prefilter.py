"""The static prefilter: from a wanted velocity to the valve's current (paper 3.1, Fig. 8).

It inverts the machine's static nonlinearities as the controller knows them: dead zone, flow
gain of each direction and, for a wanted joint rate, the linkage ratio.
"""

import math
from dataclasses import dataclass

from emir_common.quantity import check_ranges, quantity


@dataclass(frozen=True, kw_only=True)
class PrefilterParameters:
    """The controller's picture of cylinder, valve and linkage; the machine file's values."""

    area_lifting: float = quantity("m^2", 1e-5, 1.0, "A_H", default=0.06157521601035994)
    area_lowering: float = quantity("m^2", 1e-5, 1.0, "A_S", default=0.030159289474462014)
    flow_lifting: float = quantity(
        "m^3/s", 1e-6, 0.1, "Q_n, fully open, into the lifting chamber", default=1.0 / 300.0
    )
    flow_lowering: float = quantity(
        "m^3/s", 1e-6, 0.1, "fully open, into the lowering chamber", default=1.7959183673469388e-3
    )
    dead_zone: float = quantity("1", 0.0, 0.5, "of the valve", default=0.10)
    standstill: float = quantity(
        "m/s", 0.0, 0.01, "below this wanted speed the valve stays shut", default=5e-4
    )
    triangle_a: float = quantity("m", 0.05, 20.0, "joint to cylinder foot", default=2.0)
    triangle_b: float = quantity("m", 0.05, 20.0, "joint to rod eye", default=0.65)
    triangle_gamma0: float = quantity(
        "rad", 0.0, 3.1, "angle foot-joint-rod eye at alpha = 0", default=0.6981317007977318
    )

    def __post_init__(self) -> None:
        check_ranges(self)

    @property
    def speeds(self) -> tuple[float, float]:
        """The piston's steady velocities, m/s, with the valve fully open: lowering, lifting."""
        return -self.flow_lowering / self.area_lowering, self.flow_lifting / self.area_lifting


def valve_command(velocity: float, p: PrefilterParameters) -> float:
    """Return the valve command y2 in [-1, 1] that gives a steady piston velocity, m/s."""
    if velocity == 0.0 or abs(velocity) < p.standstill:
        return 0.0
    if velocity > 0.0:
        opening = velocity * p.area_lifting / p.flow_lifting
    else:
        opening = velocity * p.area_lowering / p.flow_lowering
    beyond = p.dead_zone + (1.0 - p.dead_zone) * min(abs(opening), 1.0)
    return math.copysign(beyond, velocity)


def commanded_velocity(command: float, p: PrefilterParameters) -> float:
    """Return the steady piston velocity, m/s, of a valve command y2; the inverse of the above."""
    opening = max(abs(command) - p.dead_zone, 0.0) / (1.0 - p.dead_zone)
    if command > 0.0:
        return opening * p.flow_lifting / p.area_lifting
    return -opening * p.flow_lowering / p.area_lowering


def piston_stroke(angle: float, p: PrefilterParameters) -> float:
    """Return the piston stroke, m, at a joint angle, rad; stroke 0 is at angle 0 (1)."""
    return _length(angle, p) - _length(0.0, p)


def joint_angle(stroke: float, p: PrefilterParameters) -> float:
    """Return the joint angle, rad, at a piston stroke, m; stroke 0 is at angle 0 (1).

    Not a number where the triangle does not close.
    """
    a, b = p.triangle_a, p.triangle_b
    length = _length(0.0, p) + stroke
    cosine = (a * a + b * b - length * length) / (2.0 * a * b)
    if not abs(cosine) <= 1.0:
        return math.nan
    return math.acos(cosine) - p.triangle_gamma0


def piston_velocity(joint_rate: float, angle: float, p: PrefilterParameters) -> float:
    """Return the piston velocity, m/s, for a joint rate, rad/s, at the joint angle, rad (1)."""
    a, b, opening = p.triangle_a, p.triangle_b, angle + p.triangle_gamma0
    return joint_rate * a * b * math.sin(opening) / _length(angle, p)


def lever_arm(angle: float, p: PrefilterParameters) -> float:
    """Return dh/dalpha, m, the piston's way for an angle of the joint, at that angle, rad (1)."""
    return piston_velocity(1.0, angle, p)


def piston_force(lifting: float, lowering: float, p: PrefilterParameters) -> float:
    """Return F = p_H A_H - p_S A_S, N, of the chambers' pressures, Pa (9)."""
    return lifting * p.area_lifting - lowering * p.area_lowering


def _length(angle: float, p: PrefilterParameters) -> float:
    """Return the distance from cylinder foot to rod eye, m."""
    a, b = p.triangle_a, p.triangle_b
    return math.sqrt(a * a + b * b - 2.0 * a * b * math.cos(angle + p.triangle_gamma0))
