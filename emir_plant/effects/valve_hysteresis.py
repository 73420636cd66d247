"""Play between the spool and its metering edges: the opening lags behind on every reversal."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class ValveHysteresis(Effect):
    """Play operator: the edges rest until the spool has moved by half the width to either side.

    A state w remembers where the edges are; the spool at y puts them to w limited to
    y - width/2 ... y + width/2, which w becomes at the end of each integration step.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("width",)
    source: ClassVar[str] = "spool hysteresis 1-3 %"
    trial: ClassVar[dict[str, float]] = {"width": 0.02}

    width: float = quantity("1", 0.0, 0.5, "of the loop, as a share of full stroke", default=0.0)


@compiled
def edges(spool: float, memory: float, p: Any) -> float:
    """Return the position of the metering edges for a spool position and the remembered one."""
    if p.valve_hysteresis_width == 0.0:
        return spool
    half = 0.5 * p.valve_hysteresis_width
    return min(max(memory, spool - half), spool + half)
