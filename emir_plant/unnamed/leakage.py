"""A flow out of a chamber that has no name, as a curve over the chamber's own pressure."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import POINTS, ZERO, place, value
from emir_plant.jit import compiled

PRESSURE = 1  # what the curve runs over


@dataclass(frozen=True, kw_only=True)
class UnnamedLeakage:
    """Flows out of the chambers; beyond the ends of the curves they go straight on."""

    over: int = quantity("1", 0, 1, "0 off, 1 over the chamber's own pressure", default=0)
    first: float = quantity("SI", 0.0, 1e8, "pressure, Pa", default=0.0)
    last: float = quantity("SI", 0.0, 1e8, "the same of the last point", default=1e7)
    lifting: tuple[float, ...] = quantity(
        "m^3/s", -0.1, 0.1, "out of the lifting chamber", default=ZERO, count=POINTS
    )
    lowering: tuple[float, ...] = quantity(
        "m^3/s", -0.1, 0.1, "out of the lowering chamber", default=ZERO, count=POINTS
    )


@compiled
def flow(pressure: float, points: Any, p: Any) -> float:
    """Return the flow out of a chamber, m^3/s, at its pressure, Pa; points: its curve."""
    if p.unnamed_leakage_over == 0.0:
        return 0.0
    return value(points, place(pressure, p.unnamed_leakage_first, p.unnamed_leakage_last))
