"""Friction of the piston that grows with its speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ViscousFriction(Effect):
    """Force against the motion of the piston: B v."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient",)
    source: ClassVar[str] = "oil film of the seals; 2-10 kN at 25 mm/s"
    trial: ClassVar[dict[str, float]] = {"coefficient": 1e5}

    coefficient: float = quantity("N s/m", 0.0, 1e7, "B", default=0.0)


@compiled
def friction(velocity: float, p: Any) -> float:
    """Return the friction force on the piston, N; it has the sign of the velocity, m/s."""
    return p.viscous_friction_coefficient * velocity
