"""The whole robot as an object: frozen parameters, run state in and out."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from emir_plant.core import LOGIC, P_H, P_S, SPOOL
from emir_plant.hydraulics import logic_block
from emir_plant.plant import SimulationError
from emir_plant.robot import actuators, integration
from emir_plant.robot.actuators import ACTUATORS, EACH, SIZE, SUPPLY
from emir_plant.robot.dynamics import Mechanics
from emir_plant.robot.integration import (
    HIGHEST,
    LOWEST,
    RATIO,
    STOP_DAMPING,
    STOP_FORCE,
    STOP_STIFFNESS,
    STROKE,
    VELOCITY,
    Tables,
)
from emir_plant.robot.parameters import Robot
from emir_plant.robot.posture import rest
from emir_plant.robot.stiffness import cut_damping, cut_stiffness

Array = NDArray[np.float64]

BROKEN = 0.1  # rad beyond the end of the stroke; the linkage is dead 0.15 rad beyond it
BRAKE_STIFFNESS = 1e11  # N m/rad, of a locked joint: 500 times a cut's, so as good as rigid


class RobotTruth(NamedTuple):
    """What the model knows and no sensor blurs; SI units; base first, then joints 1-5."""

    angle: Array  # of the joints, (6,), rad
    rate: Array  # (6,), rad/s
    stroke: Array  # of the pistons, (6,), m; the base's is its angle
    velocity: Array  # of the pistons, (6,), m/s
    force: Array  # of the oil on the pistons, (6,), N; N m on the base
    pressure_lifting: Array  # (6,), Pa
    pressure_lowering: Array  # (6,), Pa
    spool: Array  # (6,), 1
    logic_block: Array  # (6,), 1
    supply_pressure: float  # Pa
    position: Array  # of the TCP, r_6, (3,), m
    axes: Array  # of the TCP, x_6, y_6, z_6 in the columns, (3, 3)
    deflection: Array  # of the TCP against the rigid robot, (3,), m
    deflection_rotation: Array  # rotation vector, (3,), rad


@dataclass(frozen=True)
class RobotPlant:
    """The integrated model of the whole robot: six actuators on one pump, 96 freedoms.

    The state is a float array (31 + 2 * 96,): oil as in `actuators.py`, coordinates and rates as
    in `dynamics.py`. Inputs are the six valve commands y2 in [-1, 1], base first.

    locked: angles, rad, at which brakes hold the joints, base first; nan leaves a joint free.
    """

    robot: Robot
    locked: tuple[float, ...] = (math.nan,) * ACTUATORS

    @cached_property
    def mechanics(self) -> Mechanics:
        """The mechanics, for postures, modes and energies."""
        return Mechanics(self.robot)

    @cached_property
    def stops(self) -> Array:
        """The end stops as the compiled functions read them, (4, 6)."""
        stop, reaches = self.robot.end_stop, self.mechanics.reaches
        table = np.zeros((4, ACTUATORS))
        table[LOWEST, 1:] = [of.stroke_low for of in reaches]
        table[HIGHEST, 1:] = [of.stroke_high for of in reaches]
        table[STOP_STIFFNESS], table[STOP_DAMPING] = stop.stiffness, stop.damping
        return table

    @cached_property
    def brakes(self) -> Array:
        """The brakes as the compiled functions read them, (3, 6)."""
        angles = np.array(self.locked)
        stiffness = np.where(np.isnan(angles), 0.0, BRAKE_STIFFNESS)
        return np.stack((np.nan_to_num(angles), stiffness, self.robot.arm.damping_time * stiffness))

    @cached_property
    def tables(self) -> Tables:
        """The machine as the compiled functions read it."""
        m, of = self.mechanics, (self.robot.arm, self.robot.main.geometry)
        return Tables(
            np.diag(cut_stiffness(*of)).copy(),
            np.diag(cut_damping(*of)).copy(),
            m.topology.joints,
            m.topology.cuts,
            m.linkages,
            self.brakes,
            self.stops,
            actuators.records(self.robot, m.reaches),
            actuators.pump_record(self.robot),
            m.tree,
        )

    def initial(self, joints: Array, pressure_lowering: float | None = None) -> Array:
        """Return the state at rest, chambers shut, at the six joint angles, rad, base first.

        pressure_lowering: pressure of the chambers that carry no weight, Pa, the tank's when not
        given; that of the others follows from the balance of forces. Raises PostureError outside
        a linkage's reach, SimulationError where a cylinder cannot hold the boom.
        """
        held = rest(self.mechanics, joints)
        supply = self.robot.main.supply
        low = supply.pT if pressure_lowering is None else pressure_lowering
        x = np.zeros(SIZE + 2 * self.mechanics.size)
        x[SUPPLY] = supply.p0
        for k in range(ACTUATORS):
            p = self.tables.drives[k]
            force = held.torques[0] if k == 0 else held.forces[k - 1]
            high = (force + low * p["area_lowering"]) / p["area_lifting"]
            other = low
            if high < low:  # the weight pulls at the piston: the lowering chamber carries it
                high, other = low, (low * p["area_lifting"] - force) / p["area_lowering"]
            if not max(high, other) <= supply.p0:
                raise SimulationError(
                    f"joint {k} needs {max(high, other) / 1e5:.0f} bar to rest on, "
                    f"the pump gives {supply.p0 / 1e5:.0f}"
                )
            own = actuators.own(x, k)
            own[P_H], own[P_S] = high, other
            pilot = logic_block.pilot_pressure(high, other, p)
            own[LOGIC] = logic_block.settled(pilot, p)
        x[SIZE : SIZE + self.mechanics.size] = held.coordinates
        return x

    def derivative(self, state: Array, commands: Array) -> Array:
        """Return dx/dt, same shape as the state, free of any splitting: for reference and test."""
        n, t = self.mechanics.size, self.tables
        oil, q, v = state[:SIZE], state[SIZE : SIZE + n], state[SIZE + n :]
        motion, force = np.empty((4, ACTUATORS)), np.empty(ACTUATORS)
        integration.drive_motion(q, v, t, motion)
        actuators.forces(oil, motion[VELOCITY], t.drives, force)
        rate = np.empty_like(state)
        actuators.write_rates(oil, commands, motion, t.drives, t.pump, rate[:SIZE])
        rate[SIZE : SIZE + n] = v
        held, stiffness, damping = self.brakes
        torques = motion[RATIO] * (force + motion[STOP_FORCE])
        torques -= stiffness * (q[t.joints] - held) + damping * v[t.joints]
        rate[SIZE + n :] = self.mechanics.acceleration(q, v, torques)
        return rate

    def advance(
        self,
        state: Array,
        commands: Array,
        dt: float,
        step: float = integration.STEP,
        refresh: float = integration.REFRESH,
    ) -> Array:
        """Return the state after dt, s, under constant commands, (6,).

        step, refresh: longest integration step and longest time between two evaluations of mass
        and bias, s.
        """
        n = self.mechanics.size
        after = state.copy()
        oil, q, v = after[:SIZE], after[SIZE : SIZE + n], after[SIZE + n :]
        periods = max(1, math.ceil(dt / refresh - 1e-9))
        steps = max(1, math.ceil(dt / periods / step - 1e-9))
        h = dt / periods / steps
        for _ in range(periods):
            middle = q + 0.5 * steps * h * v
            posture, bias = self.mechanics.posture_and_bias(middle, v)
            integration.period(oil, q, v, commands, h, steps, posture, bias, self.tables)
        return after

    def step(self, state: Array, commands: Array, dt: float) -> tuple[Array, RobotTruth]:
        """Return the state after dt, s, under constant commands, (6,), and what it shows.

        Commands are limited to [-1, 1]. Raises SimulationError when the state is not finite or an
        arm was thrown through an end stop.
        """
        limited = np.minimum(np.maximum(commands, -1.0), 1.0)  # five times as fast as np.clip
        after = self.advance(state, limited, dt)
        if not np.isfinite(after).all():
            raise SimulationError(f"the state is not finite after a step with y2 = {commands}")
        self._check_stops(after)
        return after, self.outputs(after)

    def _check_stops(self, state: Array) -> None:
        """Raise SimulationError where an arm was thrown through its end stop."""
        angles = state[SIZE + self.mechanics.topology.joints[1:]]
        for number, (angle, of) in enumerate(zip(angles, self.mechanics.reaches, strict=True), 1):
            if not of.angle_low - BROKEN < angle < of.angle_high + BROKEN:
                raise SimulationError(
                    f"joint {number} went through its end stop, to {math.degrees(angle):.1f} deg"
                )

    def outputs(self, state: Array) -> RobotTruth:
        """Return what an ideal observer would read off the state."""
        n, t = self.mechanics.size, self.tables
        q, v = state[SIZE : SIZE + n], state[SIZE + n :]
        each = state[1:SIZE].reshape(ACTUATORS, EACH)
        motion, force, bent = integration.shown(state, self.mechanics.tcp_place, t)
        return RobotTruth(
            angle=q[t.joints],
            rate=v[t.joints],
            stroke=motion[STROKE],
            velocity=motion[VELOCITY],
            force=force,
            pressure_lifting=each[:, P_H],
            pressure_lowering=each[:, P_S],
            spool=each[:, SPOOL],
            logic_block=each[:, LOGIC],
            supply_pressure=float(state[SUPPLY]),
            position=bent.tcp,
            axes=bent.tcp_axes,
            deflection=bent.position,
            deflection_rotation=bent.rotation,
        )
