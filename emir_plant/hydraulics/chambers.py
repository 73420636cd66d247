"""The compressible chambers of the cylinder, paper equations (5)-(8)."""

from typing import Any

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
def pressure_rate(surplus: float, volume: float, pressure: float, stiffness: float) -> float:
    """Return dp/dt, Pa/s, of one chamber (5), (6).

    surplus: flow into it less the swept volume rate that makes room, m^3/s; volume, m^3;
    pressure and stiffness, Pa. Oil does not pull: at 0 the pressure does not fall further.
    """
    rate = surplus * stiffness / volume
    return max(rate, 0.0) if pressure <= 0.0 else rate


@compiled
def relief_flow(pressure: float, p: Any) -> float:
    """Return what a chamber's relief valve lets off to the tank, m^3/s, at its pressure, Pa."""
    return p.relief_slope * max(pressure - p.relief_pressure, 0.0)


@compiled
def piston_force(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return F = p_H A_H - p_S A_S, N, positive when it lifts (9)."""
    return pressure_lifting * p.area_lifting - pressure_lowering * p.area_lowering
