"""The compressible chambers of the cylinder, paper equations (5)-(8)."""

from typing import Any

from emir_plant.effects import terms
from emir_plant.jit import compiled


@compiled
def volume_lifting(stroke: float, p: Any) -> float:
    """Return V_H, m^3, at the piston stroke, m (7)."""
    return p.volume_lifting_0 + p.area_lifting * stroke


@compiled
def volume_lowering(stroke: float, p: Any) -> float:
    """Return V_S, m^3, at the piston stroke, m (8)."""
    return p.volume_lowering_0 - p.area_lowering * stroke


@compiled
def pressure_rate(flow: float, swept: float, volume: float, pressure: float, p: Any) -> float:
    """Return dp/dt, Pa/s, of one chamber (5), (6).

    flow into it and the swept volume rate that makes room, m^3/s; volume, m^3; pressure, Pa.
    Oil does not pull: at 0 the pressure does not fall further.
    """
    rate = (flow - swept) * terms.stiffness(pressure, p) / volume
    return max(rate, 0.0) if pressure <= 0.0 else rate


@compiled
def piston_force(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return F = p_H A_H - p_S A_S, N, positive when it lifts (9)."""
    return pressure_lifting * p.area_lifting - pressure_lowering * p.area_lowering
