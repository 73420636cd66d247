"""Flows out of the chambers that have no name, as curves over their pressures."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import POINTS, ZERO, place, value
from emir_plant.jit import compiled

PRESSURE, DIFFERENCE = 1, 2  # what the curves may run over


@dataclass(frozen=True, kw_only=True)
class UnnamedLeakage:
    """Flows out of the chambers; beyond the ends of the curves they go straight on.

    lifting and lowering run over each chamber's own pressure, across over the difference.
    """

    over: int = quantity(
        "1", 0, 2, "0 off, 1 over each chamber's own pressure, 2 over p_H - p_S", default=0
    )
    first: float = quantity("SI", -1e8, 1e8, "pressure or difference, Pa", default=0.0)
    last: float = quantity("SI", -1e8, 1e8, "the same of the last point", default=1e7)
    lifting: tuple[float, ...] = quantity(
        "m^3/s", -0.1, 0.1, "out of the lifting chamber", default=ZERO, count=POINTS
    )
    lowering: tuple[float, ...] = quantity(
        "m^3/s", -0.1, 0.1, "out of the lowering chamber", default=ZERO, count=POINTS
    )
    across: tuple[float, ...] = quantity(
        "m^3/s", -0.1, 0.1, "from the lifting to the lowering chamber", default=ZERO, count=POINTS
    )


@compiled
def across(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return the flow from the lifting to the lowering chamber, m^3/s; pressures in Pa."""
    if p.unnamed_leakage_over != DIFFERENCE:
        return 0.0
    difference = pressure_lifting - pressure_lowering
    at = place(difference, p.unnamed_leakage_first, p.unnamed_leakage_last)
    return value(p.unnamed_leakage_across, at)


@compiled
def flow(pressure: float, points: Any, p: Any) -> float:
    """Return the flow out of a chamber, m^3/s, at its pressure, Pa; points: its curve."""
    if p.unnamed_leakage_over != PRESSURE:
        return 0.0
    return value(points, place(pressure, p.unnamed_leakage_first, p.unnamed_leakage_last))
