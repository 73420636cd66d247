"""The safety logic block (paper 2.2): fast to open, slow to close."""

from typing import Any

from emir_plant.jit import compiled


@compiled
def opening_rate(opening: float, pilot_pressure: float, p: Any) -> float:
    """Return dy4/dt, 1/s: y4 goes to 1 while the pilot pressure, Pa, is above the threshold."""
    if pilot_pressure > p.threshold:
        return (1.0 - opening) / p.time_constant_opening
    return -opening / p.time_constant_closing
