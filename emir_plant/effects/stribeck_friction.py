"""Dry friction of the piston's seals that is largest at breakaway and falls with speed."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.smooth_sign import smooth_sign, uneven
from emir_plant.jit import compiled


@dataclass(frozen=True)
class StribeckFriction(Effect):
    """Force against the motion: tanh(v/v_0) F_c [1 + (b - 1) exp(-(v/v_s)^2)].

    For gradual_share of it v / sqrt(v^2 + v_0^2) in place of tanh(v / v_0). Lifting 1 + asymmetry
    times as much, lowering 1 - asymmetry. With presliding it comes along the way instead, see
    `emir_plant.bristles`.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force",)
    source: ClassVar[str] = "breakaway 1.3 times the sliding force, v_s 5-10 mm/s"
    trial: ClassVar[dict[str, float]] = {
        "force": 3e3,
        "breakaway": 1.5,
        "stribeck_speed": 7e-3,
        "gradual_share": 0.5,
    }
    given: ClassVar[tuple[str, ...]] = ("asymmetry",)
    other_law: ClassVar[tuple[str, ...]] = ("presliding", "presliding_time", "elastic_share")

    force: float = quantity("N", 0.0, 1e5, "F_c, while sliding fast", default=0.0)
    breakaway: float = quantity("1", 1.0, 5.0, "F_s / F_c", default=1.3)
    stribeck_speed: float = quantity("m/s", 1e-4, 0.2, "v_s", default=7e-3)
    smoothing_speed: float = quantity("m/s", 1e-5, 1e-2, "v_0", default=1e-3)
    gradual_share: float = quantity("1", 0.0, 1.0, "of v/sqrt(v^2 + v_0^2)", default=0.0)
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
def friction(velocity: float, p: Any) -> float:
    """Return the friction force on the piston, N; it has the sign of the velocity, m/s."""
    if p.stribeck_friction_force == 0.0:
        return 0.0
    number = velocity / p.stribeck_friction_smoothing_speed
    sign = smooth_sign(number, p.stribeck_friction_gradual_share)
    return level(velocity, p) * uneven(sign, p.stribeck_friction_asymmetry)


@compiled
def level(velocity: float, p: Any) -> float:
    """Return the friction at which the seals slide, N, at the piston's velocity, m/s."""
    hump = math.exp(-((velocity / p.stribeck_friction_stribeck_speed) ** 2))
    return p.stribeck_friction_force * (1.0 + (p.stribeck_friction_breakaway - 1.0) * hump)
