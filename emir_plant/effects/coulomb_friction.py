"""Dry friction of the piston's seals, the same at every speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.effects.smooth_sign import smooth_sign, uneven
from emir_plant.jit import compiled


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Force against the motion of the piston: F_c tanh(v / v_0).

    For gradual_share of it v / sqrt(v^2 + v_0^2) in place of tanh(v / v_0). Lifting 1 + asymmetry
    times as much, lowering 1 - asymmetry. With presliding it comes along the way instead, see
    `emir_plant.bristles`.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("force",)
    source: ClassVar[str] = "seal friction, 1-3 % of the load"
    trial: ClassVar[dict[str, float]] = {"force": 3e3, "gradual_share": 0.5}
    given: ClassVar[tuple[str, ...]] = ("asymmetry",)
    other_law: ClassVar[tuple[str, ...]] = ("presliding", "presliding_time", "elastic_share")

    force: float = quantity("N", 0.0, 1e5, "F_c", default=0.0)
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
    if p.coulomb_friction_force == 0.0:
        return 0.0
    number = velocity / p.coulomb_friction_smoothing_speed
    sign = smooth_sign(number, p.coulomb_friction_gradual_share)
    return p.coulomb_friction_force * uneven(sign, p.coulomb_friction_asymmetry)
