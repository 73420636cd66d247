"""A valve that opens further in one direction than in the other."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveGainAsymmetry(Effect):
    """Opening times 1 + error, with an error of its own for each direction.

    Of both metering edges or, for inlet_share of it, of that from the pump alone.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("lifting", "lowering")
    source: ClassVar[str] = "manufacturing tolerance of the metering edges, 5-10 %"
    trial: ClassVar[dict[str, float]] = {"lifting": 0.05, "lowering": 0.05, "inlet_share": 0.5}

    lifting: float = quantity("1", -0.9, 2.0, "relative error of the opening, o > 0", default=0.0)
    lowering: float = quantity("1", -0.9, 2.0, "relative error of the opening, o < 0", default=0.0)
    inlet_share: float = quantity("1", 0.0, 1.0, "of it, at the inlet's edge alone", default=0.0)


@compiled
def gain(opening: float, p: Any) -> float:
    """Return the factor on an opening as stated, at the inlet."""
    lifting, lowering = p.valve_gain_asymmetry_lifting, p.valve_gain_asymmetry_lowering
    return 1.0 + (lifting if opening > 0.0 else lowering)
