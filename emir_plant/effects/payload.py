"""A load on the boom that the model does not know of."""

from dataclasses import dataclass
from typing import ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect


@dataclass(frozen=True)
class Payload(Effect):
    """Point mass, added to the stated payload: weight, inertia, other modes.

    At the TCP, unless it is said to be elsewhere along the stretched boom.
    """

    balance: ClassVar[Balance] = "force"
    sizes: ClassVar[tuple[str, ...]] = ("mass",)
    source: ClassVar[str] = "paper 1: up to 1500 kg"
    trial: ClassVar[dict[str, float]] = {"mass": 100.0}
    given: ClassVar[tuple[str, ...]] = ("place",)
    forms: ClassVar[dict[str, tuple[float, ...]]] = {"place": (1.0, 0.5)}

    mass: float = quantity("kg", 0.0, 3000.0, "beyond the stated payload", default=0.0)
    place: float = quantity("1", 0.3, 1.2, "from joint to TCP, 1: at the TCP", default=1.0)
