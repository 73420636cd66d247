"""The safety logic block (paper 2.2): fast to open, slow to close."""

from typing import Any

from emir_plant.effects import logic_block_fault
from emir_plant.jit import compiled


@compiled
def pilot_pressure(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return the pressure that works on the pilot, Pa, from those of both chambers, Pa."""
    if p.pilot == 0.0:
        return logic_block_fault.pilot_pressure(pressure_lifting, pressure_lowering, p)
    return logic_block_fault.pilot_pressure(pressure_lowering, pressure_lifting, p)


@compiled
def is_piloted(opening: float, pilot_pressure: float, p: Any) -> bool:
    """Tell whether a block that is open by y4 is told to open by its pilot pressure, Pa."""
    return pilot_pressure > logic_block_fault.threshold(opening, p)


@compiled
def opening_rate(opening: float, pilot_pressure: float, p: Any) -> float:
    """Return dy4/dt, 1/s: y4 goes to 1 while the pilot pressure, Pa, is above the threshold.

    To less than 1 where something is in its way.
    """
    if is_piloted(opening, pilot_pressure, p):
        missing = logic_block_fault.fully_open(p) - opening
        return missing / logic_block_fault.time_constant_opening(p)
    return -opening / logic_block_fault.time_constant_closing(p)


@compiled
def settled(pilot_pressure: float, p: Any) -> float:
    """Return y4 once a block that was shut has settled at a pilot pressure, Pa."""
    return logic_block_fault.fully_open(p) if is_piloted(0.0, pilot_pressure, p) else 0.0
