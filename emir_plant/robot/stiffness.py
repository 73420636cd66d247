"""Spring and damper of a cut between two sections: the elasticity of the beam about it.

A cut stands for an element of the arm's box, whose compliance it gathers at the element's
middle. Seen from there the six deflections of a symmetric box do not mix: the compliances are

    axial l/(E A), shear l/(G A_s) + l^3/(12 E I), torsion l/(G J), bending l/(E I)

(rigid finite elements; any text on beams). Coordinates of a cut, in this order everywhere: the
displacement of the outer section along its x, y, z, m, then its rotation about z, y, x, rad.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emir_plant.parameters import Geometry
from emir_plant.robot.parameters import Arm

Array = NDArray[np.float64]

COORDINATES = 6  # of a cut


@dataclass(frozen=True)
class Box:
    """Section properties of a hollow rectangular box, y lateral, z vertical."""

    area: float  # m^2
    shear_area_lateral: float  # m^2, the two flanges
    shear_area_vertical: float  # m^2, the two webs
    bending_vertical: float  # m^4, about y
    bending_lateral: float  # m^4, about z
    torsion: float  # m^4, thin-walled tube (Bredt)


def box(arm: Arm) -> Box:
    """Return the section properties of an arm's box."""
    h, w, t = arm.height, arm.width, arm.wall
    inner_h, inner_w = h - 2.0 * t, w - 2.0 * t
    middle_h, middle_w = h - t, w - t
    return Box(
        area=h * w - inner_h * inner_w,
        shear_area_lateral=2.0 * w * t,
        shear_area_vertical=2.0 * h * t,
        bending_vertical=(w * h**3 - inner_w * inner_h**3) / 12.0,
        bending_lateral=(h * w**3 - inner_h * inner_w**3) / 12.0,
        torsion=2.0 * t * (middle_h * middle_w) ** 2 / (middle_h + middle_w),
    )


def cuts_per_arm(geometry: Geometry) -> int:
    """Return the number of cuts in an arm."""
    return geometry.sections_per_arm - 1


def cut_stiffness(arm: Arm, geometry: Geometry) -> Array:
    """Return the spring of a cut, (6, 6), N/m, N/rad, N m/rad."""
    section = box(arm)
    length = geometry.boom_length / (geometry.arms * cuts_per_arm(geometry))
    e, g = arm.youngs_modulus, arm.youngs_modulus / (2.0 * (1.0 + arm.poisson_ratio))
    lateral, vertical = e * section.bending_lateral, e * section.bending_vertical
    compliance = [
        length / (e * section.area),
        length / (g * section.shear_area_lateral) + length**3 / (12.0 * lateral),
        length / (g * section.shear_area_vertical) + length**3 / (12.0 * vertical),
        length / lateral,
        length / vertical,
        length / (g * section.torsion),
    ]
    return np.diag(1.0 / np.array(compliance))


def cut_damping(arm: Arm, geometry: Geometry) -> Array:
    """Return the damper of a cut, (6, 6), N s/m, N s/rad, N m s/rad: proportional to its spring."""
    return arm.damping_time * cut_stiffness(arm, geometry)
