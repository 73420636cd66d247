"""A linkage that is not quite the stated triangle."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant import linkage
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class LinkageError(Effect):
    """Lever arm off by a function of the stroke: r (1 + scale + slope h + curvature h^2).

    h is the stated stroke. The stroke is off by the integral of that,
    h (1 + scale + slope h / 2 + curvature h^2 / 3), so that r = dh/dalpha still holds and the
    linkage neither makes nor takes power.
    """

    balance: ClassVar[Balance] = "kinematics"
    sizes: ClassVar[tuple[str, ...]] = ("scale", "slope", "curvature")
    source: ClassVar[str] = (
        "first terms of any static error; 10 mm of 650 mm at the rod eye make 1.5 %"
    )
    trial: ClassVar[dict[str, float]] = {"scale": 0.01, "slope": 0.02, "curvature": 0.05}

    scale: float = quantity("1", -0.5, 0.5, "relative error of r at h = 0", default=0.0)
    slope: float = quantity("1/m", -0.5, 0.5, "its growth with the stroke", default=0.0)
    curvature: float = quantity("1/m^2", -2.0, 2.0, "and with its square", default=0.0)


@compiled
def stroke(angle: float, p: Any) -> float:
    """Return the stroke as built, m, at the boom angle, rad."""
    h = linkage.stroke(angle, p)
    growth = 0.5 * p.linkage_error_slope * h + p.linkage_error_curvature * h * h / 3.0
    return h * (1.0 + p.linkage_error_scale + growth)


@compiled
def lever_arm(angle: float, p: Any) -> float:
    """Return the lever arm dh/dalpha as built, m, at the boom angle, rad."""
    stated = linkage.lever_arm(angle, p)
    scale, slope = p.linkage_error_scale, p.linkage_error_slope
    if scale == 0.0 and slope == 0.0 and p.linkage_error_curvature == 0.0:
        return stated
    h = linkage.stroke(angle, p)
    return stated * (1.0 + scale + slope * h + p.linkage_error_curvature * h * h)
