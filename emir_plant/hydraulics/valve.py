"""The 4/3 solenoid valve: spool dynamics and dead zone (paper 2.2)."""

from typing import Any

from emir_plant.effects import valve_dead_zone_error, valve_null_offset
from emir_plant.jit import compiled


@compiled
def spool_acceleration(command: float, spool: float, spool_rate: float, p: Any) -> float:
    """Return the spool's acceleration, 1/s^2: second order from the current y2 in [-1, 1]."""
    stiffness = p.natural_frequency * p.natural_frequency
    return stiffness * (command - spool) - 2.0 * p.damping * p.natural_frequency * spool_rate


@compiled
def opening(spool: float, p: Any) -> float:
    """Return the signed opening o of the metering edges; 0 inside the dead zone, 1 fully open."""
    edges = valve_null_offset.shifted(spool, p)
    dead_zone = valve_dead_zone_error.dead_zone(edges, p)
    beyond = abs(edges) - dead_zone
    if beyond <= 0.0:
        return 0.0
    share = beyond / valve_dead_zone_error.travel(dead_zone, p)
    return share if edges > 0.0 else -share
