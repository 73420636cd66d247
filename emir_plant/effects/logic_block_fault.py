"""A safety logic block that does not switch as stated."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.jit import compiled


@dataclass(frozen=True)
class LogicBlockFault(Effect):
    """Threshold, pilot or times off, or a poppet that does not open all the way.

    p_threshold + threshold - hysteresis y4 (the pressure works on more of an open poppet);
    T_closing (1 + closing); T_opening (1 + opening); a pilot pressure mixed with a share of the
    other chamber's (a leaking pilot line); and y4 goes to 1 - blocked in place of 1.
    """

    balance: ClassVar[Balance] = "logic block"
    sizes: ClassVar[tuple[str, ...]] = (
        "threshold",
        "closing",
        "opening",
        "pilot",
        "blocked",
        "hysteresis",
    )
    source: ClassVar[str] = (
        "spring setting, a sticking or blocked pilot, dirt, a poppet's area that the pressure"
        " works on once it has lifted; magnitudes of a maladjusted valve"
    )
    trial: ClassVar[dict[str, float]] = {
        "threshold": 5e5,
        "closing": 0.5,
        "opening": 2.0,
        "pilot": 0.1,
        "blocked": 0.3,
        "hysteresis": 5e5,
    }
    given: ClassVar[tuple[str, ...]] = ("hysteresis",)
    # the threshold is crossed by few minima of the pilot pressure, or by all
    stepwise: ClassVar[tuple[str, ...]] = ("threshold", "pilot", "hysteresis")

    threshold: float = quantity("Pa", -5e7, 5e7, "added to the threshold", default=0.0)
    closing: float = quantity("1", -0.9, 20.0, "relative error of the closing time", default=0.0)
    opening: float = quantity("1", -0.9, 50.0, "relative error of the opening time", default=0.0)
    pilot: float = quantity("1", 0.0, 1.0, "share of the other chamber's pressure", default=0.0)
    blocked: float = quantity("1", 0.0, 0.95, "share of the opening that is missing", default=0.0)
    hysteresis: float = quantity("Pa", 0.0, 5e7, "shuts below the threshold by", default=0.0)


@compiled
def threshold(opening: float, p: Any) -> float:
    """Return the threshold of a block that is open by y4, Pa."""
    raised = p.threshold + p.logic_block_fault_threshold
    return raised - p.logic_block_fault_hysteresis * opening


@compiled
def time_constant_closing(p: Any) -> float:
    """Return the closing time constant as it is, s."""
    return p.time_constant_closing * (1.0 + p.logic_block_fault_closing)


@compiled
def time_constant_opening(p: Any) -> float:
    """Return the opening time constant as it is, s."""
    return p.time_constant_opening * (1.0 + p.logic_block_fault_opening)


@compiled
def pilot_pressure(own: float, other: float, p: Any) -> float:
    """Return the pressure that works on the pilot, Pa, from those of both chambers."""
    return own + p.logic_block_fault_pilot * (other - own)


@compiled
def fully_open(p: Any) -> float:
    """Return y4 once the block has opened as far as it does."""
    return 1.0 - p.logic_block_fault_blocked
