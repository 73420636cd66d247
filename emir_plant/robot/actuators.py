"""The six actuators on their one pump: the parameters of each, and their equations.

Each is the actuator of `emir_plant.hydraulics` with its own areas, chambers and valve size. The
base turns on a motor: its "stroke" is its angle, its areas the displacement per angle, its
chambers do not change. No logic block there: it carries no weight.

The state of all actuators is (1 + 6 * 5,): the supply pressure, then of base and joints 1-5 the
five of `emir_plant.core`.
"""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant.core import LOGIC, P_H, P_S, SPOOL, SPOOL_RATE
from emir_plant.effects import Effects, pressure_dependent_friction, terms
from emir_plant.hydraulics import chambers, logic_block, valve
from emir_plant.hydraulics.flows import Pressures, delivered, flows
from emir_plant.jit import compiled
from emir_plant.parameters import Machine
from emir_plant.record import record
from emir_plant.robot.parameters import Joint, Robot
from emir_plant.robot.reach import Reach
from emir_plant.unnamed import UNNAMED

Array = NDArray[np.float64]

ACTUATORS = 6
EACH = 5  # states of an actuator
SIZE = 1 + ACTUATORS * EACH
NO_LIMIT = 1e9  # Pa
SUPPLY = 0  # index of the supply pressure
LOWERING = 1.1  # times the speed of lifting, as the main joint's valve is sized (data/joint1.yaml)

EFFECTS = (  # those without a memory of their own
    "coulomb_friction",
    "stribeck_friction",
    "viscous_friction",
    "pressure_dependent_friction",
    "payload",
    "internal_leakage",
    "external_leakage",
    "entrained_air",
    "vessel_compliance",
    "valve_null_offset",
    "valve_gain_asymmetry",
    "valve_dead_zone_error",
    "logic_block_fault",
)

PRESSURE, FLOW, SLOPE, STIFFNESS = 0, 1, 2, 3  # of `pump_record`


def machines(robot: Robot, reaches: tuple[Reach, ...]) -> tuple[Machine, ...]:
    """Return base and joints 1-5, each as a main joint of its own size.

    Effects act on the joint that they are stated for, the main joint's payload on all. Raises
    ParameterError for an effect that is switched on and has no place here.
    """
    _check_effects(robot.main.effects, EFFECTS, "")
    for group in UNNAMED:
        if getattr(robot.main, group).over:
            raise ParameterError(f"{group}: not in the model of the whole robot")
    for name, effects in robot.effects.items():
        _check_effects(effects, tuple(e for e in EFFECTS if e != "payload"), f"{name}.")
    others = (
        _scaled(robot.main, joint, reach)
        for joint, reach in zip(robot.four_bars, reaches[1:], strict=True)
    )
    return (_motor(robot), robot.main, *others)


def _check_effects(effects: Effects, allowed: tuple[str, ...], where: str) -> None:
    for name, effect in vars(effects).items():
        if effect.is_on and name not in allowed:
            raise ParameterError(
                f"{where}effects.{name}: not in the model of the whole robot; there are"
                f" {', '.join(allowed)}"
            )
        for field in effect.other_law:  # these need a memory of their own
            if getattr(effect, field):
                raise ParameterError(
                    f"{where}effects.{name}.{field}: not in the model of the whole robot"
                )


def records(robot: Robot, reaches: tuple[Reach, ...]) -> NDArray[Any]:
    """Return the parameters of all actuators as the compiled functions read them, (6,)."""
    return np.concatenate([record(machine) for machine in machines(robot, reaches)])


def pump_record(robot: Robot) -> Array:
    """Return (4,): set pressure, largest flow, flow per pressure missing, stiffness of the line."""
    pump, main = robot.pump, robot.main
    slope = pump.flow_max / pump.droop
    return np.array([main.supply.p0, pump.flow_max, slope, main.cylinder.beta / pump.line_volume])


def _scaled(main: Machine, joint: Joint, reach: Reach) -> Machine:
    drive = joint.drive
    lifting = math.pi * drive.bore**2 / 4.0
    lowering = lifting - math.pi * drive.rod**2 / 4.0
    values = {
        "cylinder.area_lifting": lifting,
        "cylinder.area_lowering": lowering,
        "cylinder.volume_lifting_0": drive.dead_volume_lifting - lifting * reach.stroke_low,
        "cylinder.volume_lowering_0": drive.dead_volume_lowering + lowering * reach.stroke_high,
        "valve.flow_ratio_lowering": LOWERING * lowering / lifting,
        "valve.limit_lowering": NO_LIMIT,  # folded, the weight pulls the other way
    }
    return _valve_sized(main, drive.flow_nominal, values, joint.effects)


def _motor(robot: Robot) -> Machine:
    base = robot.base
    values = {
        "cylinder.area_lifting": base.displacement,
        "cylinder.area_lowering": base.displacement,
        "cylinder.volume_lifting_0": base.chamber,
        "cylinder.volume_lowering_0": base.chamber,
        "valve.flow_ratio_lowering": 1.0,
        "valve.balance_lowering": 0,
        "valve.limit_lowering": NO_LIMIT,
        "logic_block.threshold": 0.0,
    }
    return _valve_sized(robot.main, base.flow_nominal, values, base.effects)


def _valve_sized(main: Machine, flow: float, values: dict[str, float], effects: Effects) -> Machine:
    """Return the machine with a valve and lines that drop the main joint's pressures at `flow`."""
    share = (main.valve.flow_nominal / flow) ** 2
    values |= {
        f"resistances.{field.name}": getattr(main.resistances, field.name) * share
        for field in dataclasses.fields(main.resistances)
    }
    values |= {"valve.flow_nominal": flow}
    return with_values(dataclasses.replace(main, effects=effects), values)


@compiled
def own(x: Array, k: int) -> Array:
    """Return a view, (5,), of the states of actuator k in those of all, x."""
    return x[1 + k * EACH : 1 + (k + 1) * EACH]


@compiled
def _valve_flows(x: Array, supply: float, p: Any) -> tuple[float, float, float]:
    """Return the flows Q_H and Q_S through the valve and the pump's part of them, m^3/s."""
    edges = terms.edges(valve.opening(x[SPOOL], p), 0.0, 0.0, p)
    lifting, lowering = flows(edges, Pressures(supply, x[P_H], x[P_S]), x[LOGIC], p)
    return lifting, lowering, delivered(edges, lifting, lowering)


@compiled
def _write_actuator(
    x: Array, command: float, supply: float, motion: tuple[float, float], p: Any, dx: Array
) -> float:
    """Write an actuator's rates, (5,), to dx; return what it draws from the pump, m^3/s.

    supply: pressure at the pump, Pa. motion: stroke, m, which changes the chambers' volumes, and
    velocity, m/s, which sweeps them.
    """
    stroke, velocity = motion
    lifting, lowering, drawn = _valve_flows(x, supply, p)
    leak_lifting, leak_lowering = terms.leakage(x[P_H], x[P_S], p)
    volume = chambers.volume_lifting(stroke, p)
    stiffness = terms.stiffness_lifting(x[P_H], volume, p)
    surplus = lifting - leak_lifting - chambers.relief_flow(x[P_H], p) - p.area_lifting * velocity
    dx[P_H] = chambers.pressure_rate(surplus, volume, x[P_H], stiffness)
    volume = chambers.volume_lowering(stroke, p)
    stiffness = terms.stiffness_lowering(x[P_S], volume, p)
    surplus = lowering - leak_lowering - chambers.relief_flow(x[P_S], p)
    surplus += p.area_lowering * velocity
    dx[P_S] = chambers.pressure_rate(surplus, volume, x[P_S], stiffness)
    dx[SPOOL] = x[SPOOL_RATE]
    dx[SPOOL_RATE] = valve.spool_acceleration(command, x[SPOOL], x[SPOOL_RATE], p)
    pilot = logic_block.pilot_pressure(x[P_H], x[P_S], p)
    dx[LOGIC] = logic_block.opening_rate(x[LOGIC], pilot, p)
    return drawn


@compiled
def write_rates(
    x: Array, commands: Array, motion: Array, actuators: NDArray[Any], pump: Array, dx: Array
) -> None:
    """Write dx/dt of all actuators, (31,), to dx.

    commands: (6,). motion: (2 or more, 6), strokes and velocities. actuators: (6,) records.
    pump: see `pump_record`; it feeds all, and what they draw makes its pressure fall.
    """
    drawn = 0.0
    for k in range(ACTUATORS):
        stroke = motion[0, k] if k > 0 else 0.0  # the motor's chambers keep their volume
        moving, p = (stroke, motion[1, k]), actuators[k]
        drawn += _write_actuator(own(x, k), commands[k], x[SUPPLY], moving, p, own(dx, k))
    wanted = (pump[PRESSURE] - x[SUPPLY]) * pump[SLOPE]
    dx[SUPPLY] = (min(max(wanted, 0.0), pump[FLOW]) - drawn) * pump[STIFFNESS]


@compiled
def limit(x: Array) -> None:
    """Keep the chambers' pressures from going below 0, in place: oil does not pull."""
    for k in range(ACTUATORS):
        each = own(x, k)
        each[P_H], each[P_S] = max(each[P_H], 0.0), max(each[P_S], 0.0)


@compiled
def oil_force(x: Array, k: int, actuators: NDArray[Any]) -> float:
    """Return the oil's force on actuator k's piston, N; N m on the base."""
    each = own(x, k)
    return chambers.piston_force(each[P_H], each[P_S], actuators[k])


@compiled
def pressing(x: Array, k: int, actuators: NDArray[Any]) -> float:
    """Return the force on bearings and seals of actuator k, N; N m on the base."""
    each = own(x, k)
    return pressure_dependent_friction.pressing(each[P_H], each[P_S], actuators[k])


@compiled
def forces(x: Array, velocities: Array, actuators: NDArray[Any], result: Array) -> None:
    """Write the forces of oil and friction on the pistons, (6,), N, and N m on the base."""
    for k in range(ACTUATORS):
        friction = terms.friction(velocities[k], pressing(x, k, actuators), actuators[k])
        result[k] = oil_force(x, k, actuators) - friction


@compiled
def friction_slope(velocity: float, pressing: float, p: Any) -> float:
    """Return d(friction)/d(velocity), N s/m, at a piston velocity, m/s, never negative.

    pressing: on bearings and seals, N.
    """
    step = 1e-5  # m/s
    rise = terms.friction(velocity + step, pressing, p)
    rise -= terms.friction(velocity - step, pressing, p)
    return max(rise / (2.0 * step), 0.0)
