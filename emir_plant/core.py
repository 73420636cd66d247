"""The compiled core: the right-hand side of joint 1's integrated model and what is read off it.

The state vector holds the hydraulic states at the indices named here, then time and the memory
of effects, then the boom's modal coordinates and then their rates.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant import bristles
from emir_plant.effects import (
    backlash,
    command_delay,
    external_load,
    linkage_error,
    pressure_dependent_friction,
    sensor_delay,
    supply_pressure_droop,
    terms,
    valve_hysteresis,
    viscous_friction,
)
from emir_plant.elementary import cosine
from emir_plant.hydraulics import chambers, logic_block, valve
from emir_plant.hydraulics.flows import Pressures, delivered, flows
from emir_plant.jit import compiled, compiled_in_place
from emir_plant.unnamed import force as unnamed_force
from emir_plant.unnamed import load as unnamed_load

Array = NDArray[np.float64]

P_H, P_S, SPOOL, SPOOL_RATE, LOGIC = 0, 1, 2, 3, 4
TIME = 5  # s, since the start of the run
DROOP = 6  # Pa, of the supply pressure
EDGES = 7  # 1, where the play of the spool has left the metering edges
OFFSET = 8  # m, of the piston against the joint
LATE_ANGLE, LATE_P_H, LATE_P_S, LATE_DEFLECTION, LATE_STROKE = 9, 10, 11, 12, 13  # of sensors
PLAYED = 14  # 1, the command behind the valve's play
BRISTLES = 15  # N, force of the seals' bristles
DELAY_LINE = 16  # of the command, see command_delay.py
MODES = DELAY_LINE + command_delay.SIZE


class Truth(NamedTuple):
    """What the model knows and no sensor blurs; SI units."""

    angle: float  # alpha_1, rad
    tip_angle: float  # alpha_6, rad
    stroke: float  # h, m
    velocity: float  # dh/dt, m/s
    force: float  # F on the piston by the oil, N
    pressure_lifting: float  # p_H, Pa
    pressure_lowering: float  # p_S, Pa
    flow_lifting: float  # Q_H, m^3/s
    flow_lowering: float  # Q_S, m^3/s
    spool: float  # y, 1
    logic_block: float  # y4, 1
    tcp_deflection: float  # off the line of the first section, up positive, m


COLUMNS = len(Truth._fields)


class Motion(NamedTuple):
    """The boom and the piston at an instant; SI units."""

    angle: float  # alpha_1, rad
    tip_angle: float  # alpha_6, rad
    arm: float  # dh/dalpha, m
    stroke: float  # of the piston, m
    joint_stroke: float  # the same without the piston's play, m
    velocity: float  # of the piston, m/s
    joint_velocity: float  # the same without the piston's play, m/s
    force: float  # of the oil on the piston, N
    pressing: float  # of it on bearings and seals, N
    offset_rate: float  # of the piston against the joint, m/s


@compiled_in_place
def motion_of(x: Array, p: Any) -> Motion:
    """Return the motion with the play crossed as the oil pushes."""
    standing = standing_motion(x, p)
    return crossing_motion(standing, backlash.rate(x[OFFSET], standing.force, p))


@compiled_in_place
def standing_motion(x: Array, p: Any) -> Motion:
    """Return the motion with the play as it stands."""
    n = p.mode_joint.size
    angle, tip_angle, turning = 0.0, 0.0, 0.0
    for i in range(n):
        angle += p.mode_joint[i] * x[MODES + i]
        tip_angle += p.mode_tip_angle[i] * x[MODES + i]
        turning += p.mode_joint[i] * x[MODES + n + i]
    arm = linkage_error.lever_arm(angle, p)
    joint_stroke, joint_velocity = linkage_error.stroke(angle, p), arm * turning
    return Motion(
        angle,
        tip_angle,
        arm,
        joint_stroke + x[OFFSET],
        joint_stroke,
        joint_velocity,
        joint_velocity,
        chambers.piston_force(x[P_H], x[P_S], p),
        pressure_dependent_friction.pressing(x[P_H], x[P_S], p),
        0.0,
    )


@compiled_in_place
def crossing_motion(standing: Motion, rate: float) -> Motion:
    """Return the motion with the play crossed at a rate, m/s."""
    return Motion(
        standing.angle,
        standing.tip_angle,
        standing.arm,
        standing.stroke,
        standing.joint_stroke,
        standing.joint_velocity + rate,
        standing.joint_velocity,
        standing.force,
        standing.pressing,
        rate,
    )


@compiled_in_place
def situation_of(motion: Motion) -> terms.Situation:
    """Return what the dry friction depends on beside the velocity."""
    return terms.Situation(motion.pressing, motion.stroke)


@compiled_in_place
def bristles_of(motion: Motion, p: Any) -> bristles.Bristles:
    """Return the seals' bristles as velocity and force make them."""
    return terms.bristles(motion.joint_velocity, motion.pressing, p)


@compiled_in_place
def _valve_flows(x: Array, stroke: float, p: Any) -> tuple[float, float, float]:
    """Return the flows Q_H and Q_S through the valve and the pump's part of them, m^3/s.

    stroke: of the piston, m.
    """
    position = valve_hysteresis.edges(x[SPOOL], x[EDGES], p)
    edges = terms.edges(valve.opening(position, p), x[TIME], stroke, p)
    pressures = Pressures(p.p0 - x[DROOP], x[P_H], x[P_S])
    lifting, lowering = flows(edges, pressures, x[LOGIC], p)
    return lifting, lowering, delivered(edges, lifting, lowering)


@compiled
def derivative(x: Array, command: float, parameters: NDArray[Any]) -> Array:
    """Return dx/dt of the integrated model (paper Fig. 6) with a command at the valve.

    That is the command y2 behind delay line and play, on which the integration alone works.
    """
    dx = np.zeros_like(x)
    write_derivative(x, command, parameters, dx)
    return dx


@compiled_in_place
def write_derivative(x: Array, command: float, parameters: NDArray[Any], dx: Array) -> None:
    """Write dx/dt to dx, (n,), all but the delay line's entries, which stay as they are."""
    write_derivative_of(x, command, parameters[0], dx)


@compiled_in_place
def write_derivative_of(x: Array, command: float, p: Any, dx: Array) -> None:
    """As `write_derivative`, with the parameters of one machine."""
    motion = motion_of(x, p)
    if terms.has_bristles(p):
        force, velocity, b = x[BRISTLES], motion.joint_velocity, bristles_of(motion, p)
        write_rates(x, command, motion, bristles.friction(force, velocity, b), p, dx)
        dx[BRISTLES] = b.stiffness * bristles.bending(force, velocity, b)
    else:
        dry = terms.dry_friction(motion.joint_velocity, situation_of(motion), p)
        write_rates(x, command, motion, dry, p, dx)


@compiled_in_place
def write_rates(  # noqa: PLR0913, PLR0917 (compiled code has no object to bundle them in)
    x: Array, command: float, motion: Motion, dry: float, p: Any, dx: Array
) -> None:
    """Write dx/dt under a given dry friction, N."""
    flow_lifting, flow_lowering, pumped = _valve_flows(x, motion.stroke, p)
    leak_lifting, leak_lowering = terms.leakage(x[P_H], x[P_S], p)
    lifting = flow_lifting - leak_lifting - chambers.relief_flow(x[P_H], p)
    volume = chambers.volume_lifting(motion.stroke, p)
    stiffness = terms.stiffness_lifting(x[P_H], volume, p)
    surplus = lifting - p.area_lifting * motion.velocity
    dx[P_H] = chambers.pressure_rate(surplus, volume, x[P_H], stiffness)

    lowering = flow_lowering - leak_lowering - chambers.relief_flow(x[P_S], p)
    volume = chambers.volume_lowering(motion.stroke, p)
    stiffness = terms.stiffness_lowering(x[P_S], volume, p)
    surplus = lowering + p.area_lowering * motion.velocity
    dx[P_S] = chambers.pressure_rate(surplus, volume, x[P_S], stiffness)

    dx[SPOOL] = x[SPOOL_RATE]
    dx[SPOOL_RATE] = valve.spool_acceleration(command, x[SPOOL], x[SPOOL_RATE], p)
    pilot = logic_block.pilot_pressure(x[P_H], x[P_S], p)
    dx[LOGIC] = logic_block.opening_rate(x[LOGIC], pilot, p)
    dx[TIME] = 1.0
    dx[DROOP] = supply_pressure_droop.rate(x[DROOP], pumped, p)
    dx[EDGES] = dx[PLAYED] = dx[BRISTLES] = 0.0  # the integration moves them
    dx[OFFSET] = motion.offset_rate
    _write_lags(x, motion, p, dx)
    _write_boom(x, motion, dry, p, dx)


@compiled_in_place
def _write_lags(x: Array, motion: Motion, p: Any, dx: Array) -> None:
    bending = motion.tip_angle - motion.angle
    rate, dead = sensor_delay.rate, p.sensor_delay_dead_share
    dx[LATE_ANGLE] = rate(motion.angle, x[LATE_ANGLE], p.sensor_delay_angle, dead)
    dx[LATE_P_H] = rate(x[P_H], x[LATE_P_H], p.sensor_delay_pressure_lifting, dead)
    dx[LATE_P_S] = rate(x[P_S], x[LATE_P_S], p.sensor_delay_pressure_lowering, dead)
    dx[LATE_STROKE] = rate(motion.stroke, x[LATE_STROKE], p.sensor_delay_stroke, dead)
    dx[LATE_DEFLECTION] = rate(bending, x[LATE_DEFLECTION], p.sensor_delay_deflection, dead)


@compiled_in_place
def _write_boom(x: Array, motion: Motion, dry: float, p: Any, dx: Array) -> None:
    n = p.mode_joint.size
    friction = dry + viscous_friction.friction(motion.joint_velocity, p)
    unnamed = unnamed_force.along(motion.joint_velocity, motion.stroke, p)
    load = external_load.force(x[TIME], p)
    any_load = unnamed_load.course(x[TIME], p)
    beside = unnamed + external_load.on_piston(load, p)
    torque = (motion.force + beside - friction) * motion.arm
    torque += external_load.about_joint(load, p) + unnamed_load.about_joint(any_load, p)
    gravity = cosine(motion.angle)
    across = external_load.at_tip(load, motion.angle, p) + unnamed_load.at_tip(any_load, p)
    for i in range(n):
        dx[MODES + i] = x[MODES + n + i]
        dx[MODES + n + i] = (
            p.mode_joint[i] * torque
            - p.mode_weight[i] * gravity
            - p.mode_stiffness[i] * x[MODES + i]
            - p.mode_damping[i] * x[MODES + n + i]
            + p.mode_tip[i] * across
        )


@compiled_in_place
def truth(x: Array, parameters: NDArray[Any]) -> Truth:
    """Return what an ideal observer would read off the state."""
    return truth_of(x, parameters[0])


@compiled_in_place
def truth_of(x: Array, p: Any) -> Truth:
    """As `truth`, with the parameters of one machine."""
    motion = motion_of(x, p)
    flow_lifting, flow_lowering, _ = _valve_flows(x, motion.stroke, p)
    bending = 0.0
    for i in range(p.mode_deflection.size):
        bending += p.mode_deflection[i] * x[MODES + i]
    across = external_load.at_tip(external_load.force(x[TIME], p), motion.angle, p)
    across += unnamed_load.at_tip(unnamed_load.course(x[TIME], p), p)
    return Truth(
        motion.angle,
        motion.tip_angle,
        motion.stroke,
        motion.velocity,
        motion.force,
        x[P_H],
        x[P_S],
        flow_lifting,
        flow_lowering,
        x[SPOOL],
        x[LOGIC],
        bending + p.residual_sag * cosine(motion.angle) + p.residual_compliance * across,
    )
