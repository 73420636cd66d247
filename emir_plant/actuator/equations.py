"""The actuator's equations.

    spool      T dy/dt = u - y
    flow       Q = gain o(y)
    oil        dp/dt = (Q - w - leakage) / share; 1, or less behind a shut load-holding valve
    mass       dw/dt = omega^2 (p - friction(w) - load) - force of the swinging load

p: pressure above that at rest, w: velocity as a flow, o: opening behind play, delay, offset and
overlap. One unit of flow raises the pressure by one per unit of time. With an elastic arm a share m
of the mass is the piston's and the rest's velocity is another one, a:

    arm        f = (s beyond the play) / compliance + d (w - a),   ds/dt = w - a
    piston     dw/dt = omega^2 / m (p - friction(w) - load - f)
    mass       da/dt = omega^2 / (1 - m) f - force of the swinging load

A light piston, m below LIGHT, has the velocity that follows from p = friction(w) + load + f.

The state has the time, too, and what the spool drags behind play, which is moved at a step's end.
"""

from typing import Any

import numpy as np

from emir_plant.actuator.effects import LIGHT
from emir_plant.actuator.unnamed import straight
from emir_plant.effects.smooth_sign import smooth_sign
from emir_plant.jit import compiled_in_place

STATES = 10
SPOOL, PRESSURE, VELOCITY, WAY, ARM, ARM_WAY, SWING, SWING_WAY, EDGES, CLOCK = range(STATES)
CRITICAL = 0.02  # pressure below which a gap's root law becomes laminar
USUAL = 3.0  # pressure that signals of the order of one hardly exceed
APPROACHED = 3  # times, the speed of a light piston that sticks
LAMINAR = 0.02  # relative drop below which the orifice's square root is made smooth


@compiled_in_place
def dragged(held: float, leading: float, play: float) -> float:
    """Return where what leads with play drags what it holds."""
    return min(max(held, leading - play), leading + play)


@compiled_in_place
def play_ahead(p: Any) -> float:
    """Return half the play between command and spool."""
    return p.effects_valve_hysteresis_play * p.effects_valve_hysteresis_command_share


@compiled_in_place
def metering_edges(spool: float, held: float, p: Any) -> float:
    """Return where the metering edges are that a spool drags."""
    return dragged(held, spool, p.effects_valve_hysteresis_play - play_ahead(p))


@compiled_in_place
def valve_flow(edges: float, pressure: float, time: float, p: Any) -> float:
    """Return the flow that the valve gives, in the sense of rising pressure."""
    gain = abs(p.valve_gain) * max(1.0 + p.effects_flow_gain_drift_rate * time, 0.0)
    sign = 1.0 if p.valve_gain > 0.0 else -1.0
    opening = sign * (edges + p.effects_valve_null_offset_offset)
    if opening > 0.0:
        metered = max(opening - p.effects_valve_dead_zone_error_lifting, 0.0)
        flow = gain * metered
        if p.effects_flow_limit_lifting > 0.0:
            flow = min(flow, p.effects_flow_limit_lifting)
        return flow * _orifice(1.0 - p.effects_supply_pressure_droop_lifting * pressure)
    metered = max(-opening - p.effects_valve_dead_zone_error_lowering, 0.0)
    flow = gain * (1.0 + p.effects_valve_gain_asymmetry_lowering) * metered
    if p.effects_flow_limit_lowering > 0.0:
        flow = min(flow, p.effects_flow_limit_lowering)
    return -flow * _orifice(1.0 + p.effects_supply_pressure_droop_lowering * pressure)


@compiled_in_place
def _softened_root(drop: float, laminar: float) -> float:
    """Return the root of a pressure drop, made smooth below a laminar one."""
    return np.sqrt(np.sqrt(drop * drop + laminar * laminar))


@compiled_in_place
def _orifice(drop: float) -> float:
    """Return the flow's share at a relative pressure drop; 1 at a drop of 1."""
    if drop == 1.0:
        return 1.0
    return drop / _softened_root(drop, LAMINAR) * _softened_root(1.0, LAMINAR)


@compiled_in_place
def _unnamed_flow(opening: float, p: Any) -> float:
    low, high = p.effects_unnamed_flow_low, p.effects_unnamed_flow_high
    return straight(opening, low, high, p.effects_unnamed_flow_points)


@compiled_in_place
def _unnamed_leakage(pressure: float, p: Any) -> float:
    low, high = p.effects_unnamed_leakage_low, p.effects_unnamed_leakage_high
    return straight(pressure, low, high, p.effects_unnamed_leakage_points)


@compiled_in_place
def _unnamed_friction(velocity: float, p: Any) -> float:
    low, high = p.effects_unnamed_friction_low, p.effects_unnamed_friction_high
    return straight(velocity, low, high, p.effects_unnamed_friction_points)


@compiled_in_place
def _unnamed_force(way: float, p: Any) -> float:
    low, high = p.effects_unnamed_force_low, p.effects_unnamed_force_high
    return straight(way, low, high, p.effects_unnamed_force_points)


@compiled_in_place
def _stuck(velocity: float, p: Any) -> float:
    """Return Stribeck's friction at a velocity, whatever its sign."""
    if p.effects_stribeck_friction_breakaway == 0.0:
        return p.effects_stribeck_friction_force
    number = velocity / p.effects_stribeck_friction_velocity
    return p.effects_stribeck_friction_force + p.effects_stribeck_friction_breakaway * np.exp(
        -number * number
    )


@compiled_in_place
def _pressed(pressure: float, p: Any) -> float:
    """Return the friction of seals under a pressure, whatever its sign."""
    loaded = pressure + p.effects_pressure_dependent_friction_rest
    return p.effects_pressure_dependent_friction_coefficient * abs(loaded)


@compiled_in_place
def _dry(velocity: float, pressure: float, p: Any) -> float:
    """Return the dry friction of a piston that moves."""
    return p.effects_coulomb_friction_force + _stuck(velocity, p) + _pressed(pressure, p)


@compiled_in_place
def _directed(size: float, number: float, gradual_share: float) -> float:
    """Return dry friction of a size against the motion, at a velocity over v_0."""
    return size * smooth_sign(number, gradual_share) if size > 0.0 else 0.0


@compiled_in_place
def _friction(velocity: float, pressure: float, p: Any) -> float:
    """Return what resists a velocity, as a pressure."""
    resisting = p.load_viscous_friction * velocity
    resisting += p.effects_turbulent_resistance_coefficient * velocity * abs(velocity)
    resisting += _directed(
        p.effects_coulomb_friction_force,
        velocity / p.effects_coulomb_friction_smoothing_speed,
        p.effects_coulomb_friction_gradual_share,
    )
    resisting += _directed(
        _stuck(velocity, p),
        velocity / p.effects_stribeck_friction_smoothing_speed,
        p.effects_stribeck_friction_gradual_share,
    )
    resisting += _directed(
        _pressed(pressure, p),
        velocity / p.effects_pressure_dependent_friction_smoothing_speed,
        p.effects_pressure_dependent_friction_gradual_share,
    )
    return resisting


@compiled_in_place
def _steepest(p: Any) -> float:
    """Return the most that dry friction grows with velocity, about standstill."""
    steepest = p.effects_coulomb_friction_force / p.effects_coulomb_friction_smoothing_speed
    steepest += _stuck(0.0, p) / p.effects_stribeck_friction_smoothing_speed
    pressed = _pressed(USUAL, p)
    return steepest + pressed / p.effects_pressure_dependent_friction_smoothing_speed


@compiled_in_place
def leakage(pressure: float, p: Any) -> float:
    """Return the flow that leaves the oil by no valve."""
    leakage = p.effects_internal_leakage_conductance * pressure
    if p.effects_internal_leakage_orifice > 0.0:
        root = _softened_root(pressure, CRITICAL)
        leakage += p.effects_internal_leakage_orifice * pressure / root
    relief = 0.0
    if p.effects_relief_valve_high > 0.0:
        relief += max(pressure - p.effects_relief_valve_high, 0.0)
    if p.effects_relief_valve_low > 0.0:
        relief -= max(-pressure - p.effects_relief_valve_low, 0.0)
    leakage += p.effects_relief_valve_conductance * relief
    return leakage + _unnamed_leakage(pressure, p)


@compiled_in_place
def _damper(p: Any) -> float:
    """Return the elastic arm's damping, pressure per velocity."""
    stiffness = 1.0 / p.effects_elastic_boom_compliance
    return 2.0 * p.effects_elastic_boom_damping * np.sqrt(stiffness) / p.load_frequency


@compiled_in_place
def _spring_force(way: float, p: Any) -> float:
    """Return the arm's force at a way of the piston against the mass, as a pressure."""
    play = p.effects_elastic_boom_play
    return (way - min(max(way, -play), play)) / p.effects_elastic_boom_compliance


@compiled_in_place
def _share(flow: float, p: Any) -> float:
    """Return the share of the oil that is compressed beside the piston."""
    return 1.0 if flow > 0.0 else 1.0 - p.effects_load_holding_valve_line


@compiled_in_place
def may_switch(x: Any, command: float, p: Any) -> bool:
    """Tell whether a load-holding valve may open or shut before the spool is at a command."""
    if p.effects_load_holding_valve_line == 0.0:
        return False
    now, then = metering_edges(x[SPOOL], x[EDGES], p), metering_edges(command, x[EDGES], p)
    return (valve_flow(now, 0.0, 0.0, p) > 0.0) != (valve_flow(then, 0.0, 0.0, p) > 0.0)


@compiled_in_place
def _piston_rate(p: Any) -> float:
    """Return how fast a piston with a share of the mass settles between oil and elastic arm."""
    piston = p.load_frequency * p.load_frequency / p.effects_elastic_boom_piston_share
    springs = np.sqrt(piston * (1.0 + 1.0 / p.effects_elastic_boom_compliance))
    return max(springs, piston * (p.load_viscous_friction + _damper(p) + _steepest(p)))


@compiled_in_place
def _piston_is_light(p: Any) -> bool:
    """Tell whether the piston beside an elastic arm has no mass."""
    return p.effects_elastic_boom_piston_share < LIGHT


@compiled_in_place
def fastest(p: Any) -> float:
    """Return the rate of what is fastest on the oil."""
    mass, steepest = p.load_frequency * p.load_frequency, _steepest(p)
    if p.effects_elastic_boom_compliance == 0.0:
        rate = mass * steepest
    elif _piston_is_light(p):
        rate = 1.0 / (p.load_viscous_friction + _damper(p))
    else:
        rate = _piston_rate(p)
    if p.effects_relief_valve_high > 0.0 or p.effects_relief_valve_low > 0.0:
        rate += p.effects_relief_valve_conductance
    rate += p.effects_internal_leakage_orifice / np.sqrt(CRITICAL)
    return rate / (1.0 - p.effects_load_holding_valve_line)


@compiled_in_place
def _light_piston(pressure: float, own: float, damper: float, p: Any) -> float:
    """Return the velocity at which friction and the arm's damper resist with a pressure.

    own: the oil's, on which friction may depend. What is larger near standstill is approached
    from there.
    """
    speed = _speed(abs(pressure) - _dry(0.0, own, p), damper, p)
    if p.effects_stribeck_friction_breakaway > 0.0:
        for _ in range(APPROACHED):
            speed = _speed(abs(pressure) - _dry(speed, own, p), damper, p)
    return speed if pressure > 0.0 else -speed


@compiled_in_place
def _speed(left: float, damper: float, p: Any) -> float:
    """Return the speed at which viscous and turbulent friction resist with what is left."""
    moving = max(left, 0.0)
    linear = p.load_viscous_friction + damper
    turbulent = p.effects_turbulent_resistance_coefficient
    # the root of turbulent v^2 + linear v = moving, without cancellation
    return 2.0 * moving / (linear + np.sqrt(linear * linear + 4.0 * turbulent * moving))


@compiled_in_place
def _resistance(velocity: float, pressure: float, p: Any) -> float:
    return _friction(velocity, pressure, p) + _unnamed_friction(velocity, p)


@compiled_in_place
def write_slope(x: Any, pressure: float, command: float, p: Any, slope: Any) -> None:
    """Write the state's derivative. pressure: of the oil, in every term."""
    edges = metering_edges(x[SPOOL], x[EDGES], p)
    flow = valve_flow(edges, pressure, x[CLOCK], p) + _unnamed_flow(edges, p)
    mass = p.load_frequency * p.load_frequency
    load = p.effects_external_load_force + p.effects_external_load_gradient * x[WAY]
    load -= _unnamed_force(x[WAY], p)
    if p.effects_elastic_boom_compliance > 0.0:
        damper, carrier = _damper(p), x[ARM]
        spring = _spring_force(x[ARM_WAY], p)
        if _piston_is_light(p):
            share = 0.0
            pushed = pressure - load - spring + damper * carrier
            velocity = _light_piston(pushed, pressure, damper, p)
            slope[VELOCITY] = 0.0
        else:
            share = p.effects_elastic_boom_piston_share
            velocity = x[VELOCITY]
            bending = spring + damper * (velocity - carrier)
            left = pressure - load - _resistance(velocity, pressure, p) - bending
            slope[VELOCITY] = mass / share * left
        slope[ARM] = mass / (1.0 - share) * (spring + damper * (velocity - carrier))
        slope[ARM_WAY] = velocity - carrier
    else:
        velocity = x[VELOCITY]
        carrier = velocity
        slope[VELOCITY] = mass * (pressure - load - _resistance(velocity, pressure, p))
        slope[ARM] = 0.0
        slope[ARM_WAY] = 0.0
    _write_swing(x, carrier, p, slope)
    slope[SPOOL] = (command - x[SPOOL]) / p.valve_time_constant
    slope[PRESSURE] = (flow - velocity - leakage(pressure, p)) / _share(flow, p)
    slope[WAY] = velocity
    slope[EDGES] = 0.0
    slope[CLOCK] = 1.0


@compiled_in_place
def _write_swing(x: Any, carrier: float, p: Any, slope: Any) -> None:
    """Write the swinging load's derivative; take its force off that of what carries it."""
    swing = p.effects_swinging_load_frequency
    pull = swing * swing * x[SWING_WAY]
    drag = 2.0 * p.effects_swinging_load_damping * swing * (carrier - x[SWING])
    moved = ARM if p.effects_elastic_boom_compliance > 0.0 else VELOCITY
    felt = pull + (1.0 - p.effects_swinging_load_air_share) * drag
    slope[moved] -= p.effects_swinging_load_mass_ratio * felt
    slope[SWING] = pull + drag
    slope[SWING_WAY] = carrier - x[SWING]


@compiled_in_place
def line_loss(flow: float, p: Any) -> float:
    """Return the loss of a line."""
    turbulent = p.effects_line_resistance_coefficient * flow * abs(flow)
    return turbulent + p.effects_line_resistance_laminar * flow
