"""Friction of the piston that grows with its speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ViscousFriction(Effect):
    """Force against the motion of the piston: B v + B_2 v |v|.

    A film of oil sheared, and oil pushed through what is narrow at the piston.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("coefficient", "square")
    source: ClassVar[str] = (
        "oil film of the seals, 2-10 kN at 25 mm/s; narrow passages, as much again at 0.1 m/s"
    )
    trial: ClassVar[dict[str, float]] = {"coefficient": 1e5, "square": 1e6}
    given: ClassVar[tuple[str, ...]] = ("square",)

    coefficient: float = quantity("N s/m", 0.0, 1e7, "B", default=0.0)
    square: float = quantity("N s^2/m^2", 0.0, 1e9, "B_2, by the square", default=0.0)


@compiled
def friction(velocity: float, p: Any) -> float:
    """Return the friction force on the piston, N; it has the sign of the velocity, m/s."""
    by_speed: float = p.viscous_friction_coefficient + p.viscous_friction_square * abs(velocity)
    return by_speed * velocity
