"""EMIR's main joint as an object: frozen parameters, run state in and out."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emir_plant import core, integration, rest
from emir_plant.core import Array, Truth
from emir_plant.effects import command_delay
from emir_plant.parameters import Machine
from emir_plant.record import record

REST_PRESSURE = 2e6  # Pa, p_S of the boom at rest where nothing else is asked for


class SimulationError(RuntimeError):
    """The simulation left the range in which the model means anything."""


@dataclass(frozen=True)
class Plant:
    """The integrated model of paper 2.3, Fig. 6, boom stretched, joints 2-5 locked.

    The state is a float array (core.MODES + 2 m,): pressures, spool, logic block, time and the
    memory of effects, modal coordinates and rates (indices in `core.py`). The one input is the
    valve command y2 in [-1, 1].
    """

    machine: Machine

    @cached_property
    def record(self) -> NDArray[Any]:
        """The parameters as the compiled core reads them, shape (1,)."""
        return record(self.machine)

    @property
    def fastest(self) -> float:
        """The highest natural frequency of boom and spool, rad/s."""
        boom = math.sqrt(float(self.record["mode_stiffness"].max()))
        return max(boom, self.machine.valve.natural_frequency)

    def initial(self, angle: float, pressure_lowering: float | None = None) -> Array:
        """Return the state at rest at t = 0, both chambers shut, at the boom angle, rad.

        pressure_lowering: p_S, Pa, the tank's when not given; p_H follows from the balance of
        forces. Raises SimulationError where the linkage does not reach or the cylinder cannot
        hold the boom.
        """
        p = self.record[0]
        acting = rest.acting(angle, self.record)
        if not acting.lowest < angle < acting.highest:
            raise SimulationError(
                f"boom angle {math.degrees(angle):.1f} deg: outside the linkage's reach,"
                f" {math.degrees(acting.lowest):.1f} ... {math.degrees(acting.highest):.1f} deg"
            )
        low = float(p["pT"]) if pressure_lowering is None else pressure_lowering
        position, force = self._resting(angle, acting)
        high = (force + low * p["area_lowering"]) / p["area_lifting"]
        if not 0.0 <= high <= p["p0"]:
            raise SimulationError(
                f"at {math.degrees(angle):.1f} deg the boom needs {high / 1e5:.0f} bar to rest on,"
                f" the pump gives 0 ... {p['p0'] / 1e5:.0f}"
            )
        x = np.zeros(core.MODES + 2 * position.size)
        x[core.P_H], x[core.P_S] = high, low
        x[core.LOGIC], x[core.OFFSET] = rest.seated(high, low, force, self.record)
        x[core.DELAY_LINE : core.MODES] = command_delay.empty_line()
        x[core.MODES : core.MODES + position.size] = position
        x[core.LATE_ANGLE], x[core.LATE_P_H], x[core.LATE_P_S] = angle, high, low
        x[core.LATE_STROKE] = acting.stroke + x[core.OFFSET]
        x[core.LATE_DEFLECTION] = p["mode_tip_angle"] @ position - angle
        return x

    def _resting(self, angle: float, acting: rest.Acting) -> tuple[Array, float]:
        """Return the modal coordinates at rest at a boom angle, rad, and the oil's force, N."""
        p = self.record[0]
        load = p["mode_weight"] * math.cos(angle) - p["mode_tip"] * acting.at_tip
        torque = load[0] / p["mode_joint"][0]
        force = (torque - acting.about_joint) / acting.lever_arm - acting.on_piston - acting.unnamed
        bent = p["mode_joint"] * torque - load
        position = np.zeros_like(load)
        position[1:] = bent[1:] / p["mode_stiffness"][1:]
        position[0] = (angle - p["mode_joint"][1:] @ position[1:]) / p["mode_joint"][0]
        return position, float(force)

    def derivative(self, state: Array, command: float) -> Array:
        """Return dx/dt, same shape as the state, with a command that has arrived at the valve."""
        return core.derivative(state, command, self.record)

    def outputs(self, state: Array) -> Truth:
        """Return what an ideal observer would read off the state."""
        return core.truth(state, self.record)

    def step(self, state: Array, command: float, dt: float) -> tuple[Array, Truth]:
        """Return the state after dt, s, under a constant command, and what it shows.

        The command is limited to [-1, 1]. Raises SimulationError when the state is not finite.
        """
        after, shown = integration.step(state, min(max(command, -1.0), 1.0), dt, self.record)
        if not math.isfinite(shown.force + shown.stroke + shown.velocity + shown.spool):
            raise SimulationError(f"the state is not finite after a step with y2 = {command!r}")
        return after, shown

    def simulate(self, state: Array, commands: Array, dt: float, every: int = 1) -> Array:
        """Return the truth, (1 + k // every, 12), over k commands, each held for dt, s."""
        return integration.simulate(state, np.clip(commands, -1.0, 1.0), dt, every, self.record)
