"""A spool whose middle is not where the current is zero."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveNullOffset(Effect):
    """Metering edges see the spool position y + y_0."""

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("offset",)
    source: ClassVar[str] = "null shift of a proportional valve, 1-3 % of the stroke"
    trial: ClassVar[dict[str, float]] = {"offset": 0.02}

    offset: float = quantity("1", -0.5, 0.5, "y_0, as a share of full stroke", default=0.0)


@compiled
def shifted(spool: float, p: Any) -> float:
    """Return the position of the metering edges for a spool position, shares of full stroke."""
    return spool + p.valve_null_offset_offset
