"""Steady motion through a posture: the operating points about which the machine is linearized.

The boom turns as a whole, the pressures of chambers and supply stand still, the logic block is
open. At rest the valve is in its dead zone and no command would move anything.
"""

import math
from collections.abc import Callable

import numpy as np
import scipy

from emir_plant import core
from emir_plant.core import Array
from emir_plant.effects import (
    linkage_error,
    logic_block_fault,
    pressure_dependent_friction,
    terms,
)
from emir_plant.plant import Plant, SimulationError

BAR = 1e5
GUESSES = (30.0, 5.0, 100.0)  # bar, of the lowering chamber


def at_velocity(plant: Plant, angle: float, velocity: float) -> tuple[Array, float]:
    """Return state and valve command of the steady motion at a boom angle, rad.

    velocity: of the piston, m/s, not 0. Raises SimulationError where there is no such motion.
    """
    valve, cylinder = plant.machine.valve, plant.machine.cylinder
    area, full = cylinder.area_lifting, valve.flow_nominal
    if velocity < 0.0 and valve.balance_lowering == 0:
        area, full = cylinder.area_lowering, full * valve.flow_ratio_lowering
    opening = min(abs(velocity) * area / full, 1.0)
    guess = math.copysign(valve.dead_zone + (1.0 - valve.dead_zone) * opening, velocity)
    found = _solution(plant, angle, lambda command: (velocity, command), guess)
    if found is None or abs(found[1]) > 1.0:
        raise SimulationError(
            f"no steady motion of {velocity * 1e3:g} mm/s at {math.degrees(angle):.0f} deg"
            f" with {plant.machine.geometry.payload:g} kg"
        )
    return found


def under_command(plant: Plant, angle: float, command: float) -> Array:
    """Return the state of the steady motion under a valve command at a boom angle, rad.

    Raises SimulationError where there is no such motion.
    """
    valve = plant.machine.valve
    opening = max(abs(command) - valve.dead_zone, 0.0) / (1.0 - valve.dead_zone)
    if opening == 0.0:
        raise SimulationError(f"y2 = {command:g}: in the valve's dead zone nothing moves")
    guess = math.copysign(opening * valve.flow_nominal, command)
    guess /= plant.machine.cylinder.area_lifting
    found = _solution(plant, angle, lambda velocity: (velocity, command), guess)
    if found is None:
        raise SimulationError(
            f"no steady motion with y2 = {command:g} at {math.degrees(angle):.0f} deg"
            f" with {plant.machine.geometry.payload:g} kg"
        )
    return found[0]


def _solution(
    plant: Plant, angle: float, motion: Callable[[float], tuple[float, float]], guess: float
) -> tuple[Array, float] | None:
    """Return the steady state and the command; None if there is none.

    motion: from the second unknown to velocity and command. The others, bar: the lowering
    chamber's pressure, what friction adds to that of the lifting one, and where the supply sags,
    by how much. Raises SimulationError as `Plant.initial`.
    """
    turning = core.MODES + plant.record[0]["mode_joint"].size
    still, units = [core.P_H, core.P_S, turning], [BAR, BAR, 1.0]
    if plant.machine.effects.supply_pressure_droop.resistance:
        still, units = [*still, core.DROOP], [*units, BAR]

    def state(unknown: Array) -> tuple[Array, float]:
        velocity, command = motion(float(unknown[1]))
        return _state(plant, angle, unknown, velocity, command), command

    def rates(unknown: Array) -> Array:
        return np.asarray(plant.derivative(*state(unknown))[still] / units)

    plant.initial(angle)  # says so where the cylinder cannot hold the boom at all
    others = [0.0] * (len(still) - 2)
    for pressure in GUESSES:
        try:
            found = scipy.optimize.root(rates, [pressure, guess, *others])
        except SimulationError:  # on the way to a pressure that the cylinder cannot have
            continue
        if found.success and found.x[0] >= 0.0:
            return state(found.x)
    return None


def _state(plant: Plant, angle: float, unknown: Array, velocity: float, command: float) -> Array:
    p = plant.record[0]
    lowering, _, more, *sagging = unknown * BAR
    x = plant.initial(angle, lowering)
    x[core.P_H] += more
    x[core.DROOP] = sum(sagging)
    x[core.SPOOL], x[core.LOGIC] = command, logic_block_fault.fully_open(p)
    rate = velocity / linkage_error.lever_arm(angle, p)
    x[core.MODES + p["mode_joint"].size] = rate / p["mode_joint"][0]
    pressing = pressure_dependent_friction.pressing(x[core.P_H], x[core.P_S], p)
    x[core.BRISTLES] = math.copysign(terms.bristles(velocity, pressing, p).sliding, velocity)
    return x
