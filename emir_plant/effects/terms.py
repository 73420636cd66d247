"""The effects' terms, summed for each balance of the compiled core."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.bristles import Bristles
from emir_plant.effects import (
    backlash,
    coulomb_friction,
    entrained_air,
    external_leakage,
    flow_gain_drift,
    internal_leakage,
    linkage_error,
    pressure_dependent_friction,
    stribeck_friction,
    valve_gain_asymmetry,
    vessel_compliance,
    viscous_friction,
)
from emir_plant.effects.smooth_sign import by_direction
from emir_plant.hydraulics.flows import Edges
from emir_plant.jit import compiled
from emir_plant.unnamed import compliance as unnamed_compliance
from emir_plant.unnamed import force as unnamed_force
from emir_plant.unnamed import leakage as unnamed_leakage
from emir_plant.unnamed import opening as unnamed_opening

Array = NDArray[np.float64]


class Situation(NamedTuple):
    """What dry friction depends on beside the piston's velocity."""

    pressing: float  # on bearings and seals, N
    stroke: float  # of the piston, m


@compiled
def strokes(angles: Array, forces: Array, p: Any) -> Array:
    """Return the piston's strokes, (n,) m, at boom angles, (n,) rad.

    forces: (n,) N, of the oil, slow enough for the piston to rest on a flank of its play.
    """
    found = np.empty(angles.size)
    for k in range(angles.size):
        found[k] = linkage_error.stroke(angles[k], p) + backlash.flank(forces[k], p)
    return found


@compiled
def friction(velocity: float, pressing: float, p: Any) -> float:
    """Return the force against the piston's motion, N, at its velocity, m/s.

    pressing: on bearings and seals, N. Without a friction that depends on the stroke.
    """
    return named_dry_friction(velocity, pressing, p) + viscous_friction.friction(velocity, p)


@compiled
def dry_friction(velocity: float, at: Situation, p: Any) -> float:
    """Return all friction that is steep near standstill, N, at the piston's velocity, m/s."""
    named = named_dry_friction(velocity, at.pressing, p)
    return named + unnamed_force.friction(velocity, at.stroke, p)


@compiled
def named_dry_friction(velocity: float, pressing: float, p: Any) -> float:
    """Return the part of `friction` that is steep near standstill, N."""
    dry = coulomb_friction.friction(velocity, p) + stribeck_friction.friction(velocity, p)
    return dry + pressure_dependent_friction.friction(velocity, pressing, p)


@compiled
def bristles(velocity: float, pressing: float, p: Any) -> Bristles:
    """Return the bristles of all seals; as for `friction`.

    Each is as stiff as makes its friction, while sliding fast, over the way on which it gives.
    Together they are elastic up to the mean of their shares, each counted by its stiffness.
    """
    pressed = p.pressure_dependent_friction_coefficient * abs(pressing)
    coulomb = _over(p.coulomb_friction_force, p.coulomb_friction_presliding)
    stribeck = _over(p.stribeck_friction_force, p.stribeck_friction_presliding)
    by_load = _over(pressed, p.pressure_dependent_friction_presliding)
    damping = coulomb * p.coulomb_friction_presliding_time
    damping += stribeck * p.stribeck_friction_presliding_time
    damping += by_load * p.pressure_dependent_friction_presliding_time
    elastic = coulomb * p.coulomb_friction_elastic_share
    elastic += stribeck * p.stribeck_friction_elastic_share
    elastic += by_load * p.pressure_dependent_friction_elastic_share
    sliding = p.coulomb_friction_force * by_direction(velocity, p.coulomb_friction_asymmetry)
    sliding += pressed * by_direction(velocity, p.pressure_dependent_friction_asymmetry)
    if p.stribeck_friction_force > 0.0:
        level = stribeck_friction.level(velocity, p)
        sliding += level * by_direction(velocity, p.stribeck_friction_asymmetry)
    stiffness = coulomb + stribeck + by_load
    return Bristles(sliding, stiffness, damping, _over(elastic, stiffness))


@compiled
def _over(force: float, way: float) -> float:
    return force / way if way > 0.0 else 0.0


@compiled
def has_bristles(p: Any) -> bool:
    """Tell whether dry friction comes along the way; not beside a curve, which is by velocity."""
    way = p.coulomb_friction_force * p.coulomb_friction_presliding
    way += p.stribeck_friction_force * p.stribeck_friction_presliding
    pressed = p.pressure_dependent_friction_coefficient
    way += pressed * p.pressure_dependent_friction_presliding
    return way > 0.0 and p.unnamed_force_over == 0.0


@compiled
def has_dry_friction(p: Any) -> bool:
    """Tell whether the machine has any of it."""
    force = p.coulomb_friction_force + p.stribeck_friction_force
    return force + p.pressure_dependent_friction_coefficient + p.unnamed_force_over > 0.0


@compiled
def leakage(pressure_lifting: float, pressure_lowering: float, p: Any) -> tuple[float, float]:
    """Return the flows that leave the lifting and the lowering chamber, m^3/s; pressures in Pa."""
    across = internal_leakage.flow(pressure_lifting, pressure_lowering, p)
    across += unnamed_leakage.across(pressure_lifting, pressure_lowering, p)
    lifting = external_leakage.flow(pressure_lifting, p.external_leakage_lifting, p)
    lowering = external_leakage.flow(pressure_lowering, p.external_leakage_lowering, p)
    lifting += unnamed_leakage.flow(pressure_lifting, p.unnamed_leakage_lifting, p)
    lowering += unnamed_leakage.flow(pressure_lowering, p.unnamed_leakage_lowering, p)
    return across + lifting, lowering - across


@compiled
def stiffness(pressure: float, volume: float, compliance: float, p: Any) -> float:
    """Return the stiffness beta of a chamber, Pa, at its pressure, Pa, and volume, m^3.

    compliance: of its vessels beyond the stated stiffness, m^3/Pa.
    """
    return vessel_compliance.stiffness(entrained_air.stiffness(pressure, p), volume, compliance)


@compiled
def stiffness_lifting(pressure: float, volume: float, p: Any) -> float:
    """Return the lifting chamber's stiffness, Pa, at its pressure, Pa, and volume, m^3."""
    compliance = vessel_compliance.lifting(volume, p)
    compliance += unnamed_compliance.taken_up(pressure, p.unnamed_compliance_lifting, p)
    return stiffness(pressure, volume, compliance, p)


@compiled
def stiffness_lowering(pressure: float, volume: float, p: Any) -> float:
    """Return the same of the lowering chamber."""
    compliance = vessel_compliance.lowering(volume, p)
    compliance += unnamed_compliance.taken_up(pressure, p.unnamed_compliance_lowering, p)
    return stiffness(pressure, volume, compliance, p)


@compiled
def edges(stated: float, time: float, stroke: float, p: Any) -> Edges:
    """Return the openings of the metering edges at a time, s, from the one as stated.

    stroke: of the piston, m.
    """
    asymmetry, drift = valve_gain_asymmetry.gain(stated, p), flow_gain_drift.gain(time, p)
    opening = stated * unnamed_opening.factor(stated, stroke, p)
    outlet = opening * _at_outlet(asymmetry, p.valve_gain_asymmetry_inlet_share)
    outlet *= _at_outlet(drift, p.flow_gain_drift_inlet_share)
    return Edges(opening * asymmetry * drift, outlet)


@compiled
def _at_outlet(gain: float, inlet_share: float) -> float:
    """Return an opening's gain at the edge to the tank, of which a share is the inlet's alone."""
    return gain - inlet_share * (gain - 1.0)
