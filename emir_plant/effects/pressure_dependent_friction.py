"""Dry friction that grows with the load on the piston."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.smooth_sign import smooth_sign, uneven
from emir_plant.jit import compiled


@dataclass(frozen=True)
class PressureDependentFriction(Effect):
    """Force against the motion: mu |p_H A_H - p_S A_S| tanh(v / v_0).

    For seal_share of it p_H A_H + p_S A_S in place of the difference: bearings carry what the oil
    pushes, seals are pressed on each by the pressure of its own chamber. For gradual_share of it
    v / sqrt(v^2 + v_0^2) in place of tanh(v / v_0). Lifting 1 + asymmetry times as much, lowering
    1 - asymmetry. With presliding it comes along the way instead, see `emir_plant.bristles`.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient",)
    source: ClassVar[str] = "seal and bearing friction, 1-3 % of the load"
    trial: ClassVar[dict[str, float]] = {
        "coefficient": 0.02,
        "gradual_share": 0.5,
        "seal_share": 0.5,
    }
    given: ClassVar[tuple[str, ...]] = ("asymmetry",)
    other_law: ClassVar[tuple[str, ...]] = ("presliding", "presliding_time", "elastic_share")

    coefficient: float = quantity("1", 0.0, 0.2, "mu", default=0.0)
    smoothing_speed: float = quantity("m/s", 1e-5, 1e-2, "v_0", default=2e-3)
    gradual_share: float = quantity("1", 0.0, 1.0, "of v/sqrt(v^2 + v_0^2)", default=0.0)
    seal_share: float = quantity("1", 0.0, 1.0, "of seals, on p_H A_H + p_S A_S", default=0.0)
    asymmetry: float = quantity(
        "1", -0.5, 0.5, "share by which it is more lifting, less lowering", default=0.0
    )
    presliding: float = quantity(
        "m", 0.0, 1e-2, "way on which the seals give before they slide; 0: by velocity", default=0.0
    )
    presliding_time: float = quantity("s", 0.0, 0.1, "sigma_1 / sigma_0 on that way", default=0.0)
    elastic_share: float = quantity(
        "1", 0.0, 1.0, "of the friction, up to which they spring back", default=0.0
    )


@compiled
def pressing(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return the force on bearings and seals, N, at the chambers' pressures, Pa."""
    lifting, lowering = pressure_lifting * p.area_lifting, pressure_lowering * p.area_lowering
    on_bearings, on_seals = abs(lifting - lowering), lifting + lowering
    return on_bearings + p.pressure_dependent_friction_seal_share * (on_seals - on_bearings)


@compiled
def friction(velocity: float, pressing: float, p: Any) -> float:
    """Return the friction force, N, at the piston velocity, m/s, under `pressing`, N."""
    if p.pressure_dependent_friction_coefficient == 0.0:
        return 0.0
    level = p.pressure_dependent_friction_coefficient * abs(pressing)
    number = velocity / p.pressure_dependent_friction_smoothing_speed
    sign = smooth_sign(number, p.pressure_dependent_friction_gradual_share)
    return level * uneven(sign, p.pressure_dependent_friction_asymmetry)
