"""A valve whose gain changes along the run, as the oil warms up."""

from dataclasses import dataclass
from typing import Any, ClassVar

from emir_common.quantity import quantity
from emir_plant.effects.base import Balance, Effect
from emir_plant.elementary import exponential
from emir_plant.jit import compiled

MINUTE = 60.0  # s


@dataclass(frozen=True)
class FlowGainDrift(Effect):
    """Opening times 1 + change [1 - exp(-t / T)] / [1 - exp(-1 min / T)], t since the start.

    With a T beyond the run's length it is a straight line. The gain does not fall below 0. Of both
    metering edges or, for inlet_share of it, of that from the pump alone.
    """

    balance: ClassVar[Balance] = "valve"
    sizes: ClassVar[tuple[str, ...]] = ("change",)
    source: ClassVar[str] = (
        "viscosity falls as the tank warms up; 5-20 % of the flow over some minutes"
    )
    trial: ClassVar[dict[str, float]] = {"change": 0.05, "inlet_share": 0.5}

    change: float = quantity("1", -0.9, 5.0, "relative, of the gain, in a minute", default=0.0)
    time_constant: float = quantity("s", 1.0, 1e5, "T, of warming up", default=300.0)
    inlet_share: float = quantity("1", 0.0, 1.0, "of it, at the inlet's edge alone", default=0.0)


@compiled
def gain(time: float, p: Any) -> float:
    """Return the factor on the opening at a time since the start of the run, s, at the inlet."""
    if p.flow_gain_drift_change == 0.0:
        return 1.0
    warming = p.flow_gain_drift_time_constant
    share = _warmed(time, warming) / _warmed(MINUTE, warming)
    return max(1.0 + p.flow_gain_drift_change * share, 0.0)


@compiled
def _warmed(time: float, time_constant: float) -> float:
    """Return how far the oil has warmed up at a time, s, as a share of all."""
    return 1.0 - exponential(-time / time_constant)
