"""The effects' terms, summed for each balance of the compiled core."""

from typing import Any

from emir_plant.effects import coulomb_friction, entrained_air, internal_leakage, stribeck_friction
from emir_plant.jit import compiled


@compiled
def friction(velocity: float, p: Any) -> float:
    """Return the force against the piston's motion, N, at the piston velocity, m/s."""
    return coulomb_friction.friction(velocity, p) + stribeck_friction.friction(velocity, p)


@compiled
def cross_flow(pressure_lifting: float, pressure_lowering: float, p: Any) -> float:
    """Return the flow from the lifting to the lowering chamber, m^3/s; pressures in Pa."""
    return internal_leakage.flow(pressure_lifting, pressure_lowering, p)


@compiled
def stiffness(pressure: float, p: Any) -> float:
    """Return the stiffness beta of a chamber's content, Pa, at its pressure, Pa."""
    return entrained_air.stiffness(pressure, p)
