"""A load at the TCP that the model does not know of."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect


@dataclass(frozen=True)
class Payload(Effect):
    """Point mass at the TCP, added to the stated payload: weight, inertia, other modes."""

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("mass",)
    source: ClassVar[str] = "paper 1: up to 1500 kg"
    trial: ClassVar[dict[str, float]] = {"mass": 100.0}

    mass: float = quantity("kg", 0.0, 3000.0, "beyond the stated payload", default=0.0)
