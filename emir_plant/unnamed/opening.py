"""Metering edges that open otherwise than stated, as a curve over the stroke or the opening."""

from dataclasses import dataclass
from typing import Any

from emir_common.quantity import quantity
from emir_plant.curve import POINTS, ZERO, place, place_within, value
from emir_plant.jit import compiled

STROKE, OPENING = 1, 2  # what the curve may run over


@dataclass(frozen=True, kw_only=True)
class UnnamedOpening:
    """Relative change of the opening.

    Beyond the ends of the curve it is as there over the stroke, goes straight on over the opening.
    """

    over: int = quantity("1", 0, 2, "0 off, 1 over the stroke, 2 the stated opening", default=0)
    first: float = quantity("SI", -10.0, 10.0, "stroke, m, or opening, 1", default=0.0)
    last: float = quantity("SI", -10.0, 10.0, "the same of the last point", default=1.0)
    change: tuple[float, ...] = quantity(
        "1", -1.0, 10.0, "at evenly spaced points; -1: shut", default=ZERO, count=POINTS
    )


@compiled
def factor(opening: float, stroke: float, p: Any) -> float:
    """Return the opening over the stated one. stroke: of the piston, m."""
    if p.unnamed_opening_over == 0.0:
        return 1.0
    at = place(opening, p.unnamed_opening_first, p.unnamed_opening_last)
    if p.unnamed_opening_over == STROKE:
        at = place_within(stroke, p.unnamed_opening_first, p.unnamed_opening_last)
    return max(1.0 + value(p.unnamed_opening_change, at), 0.0)
