"""Where the boom and its cylinder are, in a plane: x ahead, z up, the joint at the origin."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 41  # along the boom


@dataclass(frozen=True)
class Outline:
    """Lengths, m, and the angle, rad, that the drawing needs: boom and cylinder triangle."""

    boom: float
    triangle_a: float  # joint to cylinder foot
    triangle_b: float  # joint to rod eye
    triangle_gamma0: float  # between these two, boom horizontal


def centreline(outline: Outline, angle: float, deflection: float) -> Array:
    """Return points of the bent boom, (POINTS, 3) m, for joint angle, rad, and TCP deflection, m.

    In between it has the shape of a uniform cantilever under its own weight.
    """
    share = np.linspace(0.0, 1.0, POINTS)
    along = share * outline.boom
    across = deflection * (share**4 - 4.0 * share**3 + 6.0 * share**2) / 3.0
    x = along * np.cos(angle) - across * np.sin(angle)
    z = along * np.sin(angle) + across * np.cos(angle)
    return np.column_stack([x, np.zeros(POINTS), z])


def cylinder(outline: Outline, angle: float) -> tuple[Array, Array]:
    """Return cylinder foot and rod eye, (3,) m each; the rod eye drawn on the boom's own axis."""
    foot = _polar(outline.triangle_a, -outline.triangle_gamma0)
    return foot, _polar(outline.triangle_b, angle)


def _polar(radius: float, angle: float) -> Array:
    return np.array([radius * np.cos(angle), 0.0, radius * np.sin(angle)])
