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
from emir_plant.core import LOGIC, P_H, P_S, SPOOL, SPOOL_RATE
from emir_plant.effects import Effects, terms
from emir_plant.hydraulics import chambers, logic_block, valve
from emir_plant.hydraulics.flows import flows
from emir_plant.jit import compiled
from emir_plant.parameters import Machine
from emir_plant.record import record
from emir_plant.robot.parameters import Drive, Robot
from emir_plant.robot.reach import Reach

Array = NDArray[np.float64]

ACTUATORS = 6
EACH = 5  # states of an actuator
SIZE = 1 + ACTUATORS * EACH
SUPPLY = 0  # index of the supply pressure

PRESSURE, FLOW, SLOPE, STIFFNESS = 0, 1, 2, 3  # of `pump_record`


def machines(robot: Robot, reaches: tuple[Reach, ...]) -> tuple[Machine, ...]:
    """Return base and joints 1-5, each as a main joint of its own size.

    Effects act on joint 1, the only one whose lack of them is told from measurements.
    """
    others = (
        _scaled(robot.main, joint.drive, reach)
        for joint, reach in zip(robot.four_bars, reaches[1:], strict=True)
    )
    return (_motor(robot), robot.main, *others)


def records(robot: Robot, reaches: tuple[Reach, ...]) -> NDArray[Any]:
    """Return the parameters of all actuators as the compiled functions read them, (6,)."""
    return np.concatenate([record(machine) for machine in machines(robot, reaches)])


def pump_record(robot: Robot) -> Array:
    """Return (4,): set pressure, largest flow, flow per pressure missing, stiffness of the line."""
    pump, main = robot.pump, robot.main
    slope = pump.flow_max / pump.droop
    return np.array([main.supply.p0, pump.flow_max, slope, main.cylinder.beta / pump.line_volume])


def _scaled(main: Machine, drive: Drive, reach: Reach) -> Machine:
    lifting = math.pi * drive.bore**2 / 4.0
    lowering = lifting - math.pi * drive.rod**2 / 4.0
    values = {
        "cylinder.area_lifting": lifting,
        "cylinder.area_lowering": lowering,
        "cylinder.volume_lifting_0": drive.dead_volume_lifting - lifting * reach.stroke_low,
        "cylinder.volume_lowering_0": drive.dead_volume_lowering + lowering * reach.stroke_high,
        "valve.flow_ratio_lowering": 1.1 * lowering / lifting,
    }
    return _valve_sized(main, drive.flow_nominal, values)


def _motor(robot: Robot) -> Machine:
    base = robot.base
    values = {
        "cylinder.area_lifting": base.displacement,
        "cylinder.area_lowering": base.displacement,
        "cylinder.volume_lifting_0": base.chamber,
        "cylinder.volume_lowering_0": base.chamber,
        "valve.flow_ratio_lowering": 1.0,
        "logic_block.threshold": 0.0,
    }
    return _valve_sized(robot.main, base.flow_nominal, values)


def _valve_sized(main: Machine, flow: float, values: dict[str, float]) -> Machine:
    """Return the machine with a valve and lines that drop the main joint's pressures at `flow`."""
    share = (main.valve.flow_nominal / flow) ** 2
    values |= {
        f"resistances.{field.name}": getattr(main.resistances, field.name) * share
        for field in dataclasses.fields(main.resistances)
    }
    values |= {"valve.flow_nominal": flow}
    return with_values(dataclasses.replace(main, effects=Effects()), values)


@compiled
def _write_actuator(
    x: Array, command: float, motion: tuple[float, float], p: Any, dx: Array
) -> float:
    """Write an actuator's rates, (5,), to dx; return what it draws from the pump, m^3/s.

    motion: stroke, m, which changes the chambers' volumes, and velocity, m/s, which sweeps them.
    p.p0 is the supply pressure of the moment.
    """
    stroke, velocity = motion
    opening = valve.opening(x[SPOOL], p)
    lifting, lowering = flows(opening, x[P_H], x[P_S], x[LOGIC], p)
    leak = terms.cross_flow(x[P_H], x[P_S], p)
    volume = chambers.volume_lifting(stroke, p)
    swept = p.area_lifting * velocity
    dx[P_H] = chambers.pressure_rate(lifting - leak, swept, volume, x[P_H], p)
    volume = chambers.volume_lowering(stroke, p)
    swept = -p.area_lowering * velocity
    dx[P_S] = chambers.pressure_rate(lowering + leak, swept, volume, x[P_S], p)
    dx[SPOOL] = x[SPOOL_RATE]
    dx[SPOOL_RATE] = valve.spool_acceleration(command, x[SPOOL], x[SPOOL_RATE], p)
    dx[LOGIC] = logic_block.opening_rate(x[LOGIC], x[P_H], p)
    if opening == 0.0:
        return 0.0
    return lifting if opening > 0.0 else lowering


@compiled
def write_rates(
    x: Array, commands: Array, motion: Array, actuators: NDArray[Any], pump: Array, dx: Array
) -> None:
    """Write dx/dt of all actuators, (31,), to dx.

    commands: (6,). motion: (2 or more, 6), strokes and velocities. actuators: (6,) records,
    whose p0 is overwritten: one pump feeds all, and what they draw makes its pressure fall.
    pump: see `pump_record`.
    """
    drawn = 0.0
    for k in range(ACTUATORS):
        actuators[k].p0 = x[SUPPLY]
        own = slice(1 + k * EACH, 1 + (k + 1) * EACH)
        stroke = motion[0, k] if k > 0 else 0.0  # the motor's chambers keep their volume
        moving = (stroke, motion[1, k])
        drawn += _write_actuator(x[own], commands[k], moving, actuators[k], dx[own])
    wanted = (pump[PRESSURE] - x[SUPPLY]) * pump[SLOPE]
    dx[SUPPLY] = (min(max(wanted, 0.0), pump[FLOW]) - drawn) * pump[STIFFNESS]


@compiled
def limit(x: Array) -> None:
    """Keep the chambers' pressures from going below 0, in place: oil does not pull."""
    for k in range(ACTUATORS):
        own = x[1 + k * EACH : 1 + (k + 1) * EACH]
        own[P_H], own[P_S] = max(own[P_H], 0.0), max(own[P_S], 0.0)


@compiled
def forces(x: Array, velocities: Array, actuators: NDArray[Any], result: Array) -> None:
    """Write the forces of oil and friction on the pistons, (6,), N, and N m on the base."""
    for k in range(ACTUATORS):
        own, p = x[1 + k * EACH : 1 + (k + 1) * EACH], actuators[k]
        oil = chambers.piston_force(own[P_H], own[P_S], p)
        result[k] = oil - terms.friction(velocities[k], p)


@compiled
def friction_slope(velocity: float, p: Any) -> float:
    """Return d(friction)/d(velocity), N s/m, at a piston velocity, m/s, never negative."""
    step = 1e-5
    rise = terms.friction(velocity + step, p) - terms.friction(velocity - step, p)
    return max(rise / (2.0 * step), 0.0)


@compiled
def flows_of(x: Array, k: int, actuators: NDArray[Any]) -> tuple[float, float]:
    """Return actuator k's flows into its chambers, m^3/s."""
    own = x[1 + k * EACH : 1 + (k + 1) * EACH]
    actuators[k].p0 = x[SUPPLY]
    return flows(
        valve.opening(own[SPOOL], actuators[k]), own[P_H], own[P_S], own[LOGIC], actuators[k]
    )
