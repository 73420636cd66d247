"""A dead zone other than stated."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveDeadZoneError(Effect):
    """Overlap of the metering edges: dead zone + error, never below 0.

    edge says which of them is off, since each is ground, and wears, by itself: 0 both, 1 the one
    that lifts, -1 the one that lowers. With rescaled = 1 full stroke opens fully as before, with 0
    the opening grows with the stroke as before, as it does where ports of the same width begin
    elsewhere.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("error",)
    source: ClassVar[str] = "overlap tolerance and wear, 1-3 % of the stroke"
    trial: ClassVar[dict[str, float]] = {"error": 0.02, "rescaled": 0.5}
    given: ClassVar[tuple[str, ...]] = ("edge",)
    forms: ClassVar[dict[str, tuple[float, ...]]] = {"edge": (0.0, 1.0, -1.0)}

    error: float = quantity("1", -0.5, 0.4, "of the dead zone, share of full stroke", default=0.0)
    rescaled: float = quantity("1", 0.0, 1.0, "1: full stroke opens fully", default=1.0)
    edge: float = quantity("1", -1.0, 1.0, "off: 0 both, 1 lifting, -1 lowering", default=0.0)


@compiled
def dead_zone(edges: float, p: Any) -> float:
    """Return the dead zone as it is, as a share of full stroke.

    edges: signed place of the edges, above 0 the one that lifts opens.
    """
    edge, error = p.valve_dead_zone_error_edge, p.valve_dead_zone_error_error
    other = edge if edges < 0.0 else -edge
    return max(p.dead_zone + error * (1.0 - max(other, 0.0)), 0.0)


@compiled
def travel(dead_zone: float, p: Any) -> float:
    """Return the travel over which an edge with a dead zone opens fully, shares of full stroke."""
    error = dead_zone - p.dead_zone
    return 1.0 - p.dead_zone - p.valve_dead_zone_error_rescaled * error
