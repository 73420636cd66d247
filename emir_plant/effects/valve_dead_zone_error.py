"""A dead zone other than stated."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveDeadZoneError(Effect):
    """Overlap of the metering edges: dead zone + error, never below 0.

    Fully open is at full stroke as before.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("error",)
    source: ClassVar[str] = "overlap tolerance and wear, 1-3 % of the stroke"
    trial: ClassVar[dict[str, float]] = {"error": 0.02}

    error: float = quantity("1", -0.5, 0.4, "of the dead zone, share of full stroke", default=0.0)


@compiled
def dead_zone(p: Any) -> float:
    """Return the dead zone as it is, as a share of full stroke."""
    return max(p.dead_zone + p.valve_dead_zone_error_error, 0.0)
