"""A linkage that is not quite the stated triangle."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant import linkage
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class LinkageError(Effect):
    """Lever arm off by a function of the stroke, r (1 + e(h)).

    e = scale + slope u + curvature u^2 + cubic u^3 + quartic u^4, u = h - about, with h the stated
    stroke. The stroke is off by the integral of that from h = 0 on, so that r = dh/dalpha still
    holds and the linkage neither makes nor takes power.
    """

    balance: ClassVar[Balance] = "kinematics"
    sizes: ClassVar[tuple[str, ...]] = ("scale", "slope", "curvature", "cubic", "quartic")
    source: ClassVar[str] = (
        "first terms of any static error; 10 mm of 650 mm at the rod eye make 1.5 %"
    )
    trial: ClassVar[dict[str, float]] = {
        "scale": 0.01,
        "slope": 0.02,
        "curvature": 0.05,
        "cubic": 0.1,
        "quartic": 0.2,
    }
    given: ClassVar[tuple[str, ...]] = ("about",)
    is_series: ClassVar[bool] = True

    about: float = quantity("m", -10.0, 10.0, "stroke about which the terms are", default=0.0)
    scale: float = quantity("1", -0.5, 0.5, "relative error of r there", default=0.0)
    # a steeper slope would promise the balances what soft hoses do
    slope: float = quantity("1/m", -0.5, 0.5, "its growth with the stroke", default=0.0)
    curvature: float = quantity("1/m^2", -20.0, 20.0, "and with its square", default=0.0)
    cubic: float = quantity("1/m^3", -100.0, 100.0, "with its third power", default=0.0)
    quartic: float = quantity("1/m^4", -500.0, 500.0, "and its fourth", default=0.0)


@compiled
def stroke(angle: float, p: Any) -> float:
    """Return the stroke as built, m, at the boom angle, rad."""
    h, about = linkage.stroke(angle, p), p.linkage_error_about
    if _is_none(p):
        return h
    return h + _integral(h - about, p) - _integral(-about, p)


@compiled
def _integral(u: float, p: Any) -> float:
    """Return the integral of the error over the stroke, m, from u = 0 on."""
    bent = p.linkage_error_curvature / 3.0
    bent += u * (p.linkage_error_cubic / 4.0 + u * p.linkage_error_quartic / 5.0)
    return u * (p.linkage_error_scale + u * (0.5 * p.linkage_error_slope + u * bent))


@compiled
def lever_arm(angle: float, p: Any) -> float:
    """Return the lever arm dh/dalpha as built, m, at the boom angle, rad."""
    if _is_none(p):
        return linkage.lever_arm(angle, p)
    u = linkage.stroke(angle, p) - p.linkage_error_about
    bent = p.linkage_error_curvature + u * (p.linkage_error_cubic + u * p.linkage_error_quartic)
    error = p.linkage_error_scale + u * (p.linkage_error_slope + u * bent)
    return linkage.lever_arm(angle, p) * (1.0 + error)


@compiled
def _is_none(p: Any) -> bool:
    """Tell whether there is none, for which the terms need not be summed up."""
    terms = abs(p.linkage_error_scale) + abs(p.linkage_error_slope)
    terms += abs(p.linkage_error_curvature) + abs(p.linkage_error_cubic)
    return terms + abs(p.linkage_error_quartic) == 0.0
