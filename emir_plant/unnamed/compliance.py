"""What a chamber's vessels take up beyond the stated stiffness, over its own pressure."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import POINTS, ZERO, place_within, value
from emir_plant.jit import compiled

PRESSURE = 1  # what the curve runs over


@dataclass(frozen=True, kw_only=True)
class UnnamedCompliance:
    """Volume per pressure; beyond the ends of the curves it is as there."""

    over: int = quantity("1", 0, 1, "0 off, 1 over the chamber's own pressure", default=0)
    first: float = quantity("SI", 0.0, 1e8, "pressure, Pa", default=0.0)
    last: float = quantity("SI", 0.0, 1e8, "the same of the last point", default=1e7)
    lifting: tuple[float, ...] = quantity(
        "m^3/Pa", -1e-9, 1e-9, "of the lifting chamber", default=ZERO, count=POINTS
    )
    lowering: tuple[float, ...] = quantity(
        "m^3/Pa", -1e-9, 1e-9, "of the lowering chamber", default=ZERO, count=POINTS
    )


@compiled
def taken_up(pressure: float, points: Any, p: Any) -> float:
    """Return what a chamber takes up, m^3/Pa, at its pressure, Pa; points: its curve."""
    if p.unnamed_compliance_over == 0.0:
        return 0.0
    at = place_within(pressure, p.unnamed_compliance_first, p.unnamed_compliance_last)
    return value(points, at)
