"""Force feedback: damps the machine without the oil loss of a leakage line (paper 3.1)."""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.filters import low_pass
from emir_control.limits import LimitParameters, limited, off_the_ends
from emir_control.prefilter import (
    PrefilterParameters,
    piston_force,
    piston_stroke,
    piston_velocity,
    valve_command,
)


@dataclass(frozen=True, kw_only=True)
class ForceLoopParameters:
    """High pass (10), prefilter and the limits of what is wanted.

    The gain is g / k_h with k_h = beta (A_H^2/V_H + A_S^2/V_S), 5.7e7 N/m at 45 deg; the slow
    mode gets a damping of about g / (2 omega): 8.8e-8 m/(s N) is g = 5 1/s, 0.57 of critical.
    """

    gain: float = quantity("m/(s N)", 0.0, 1e-5, "k_F", default=8.8e-8)
    time_constant: float = quantity("s", 0.01, 60.0, "T_H, of the high pass", default=1.0)
    prefilter: PrefilterParameters = field(default_factory=PrefilterParameters)
    limits: LimitParameters = field(default_factory=LimitParameters)

    def __post_init__(self) -> None:
        check_ranges(self)


class ForceLoopState(NamedTuple):
    """The slow part of the force, which the high pass takes away, and the last wanted velocity."""

    static_force: float  # N
    wanted: float = 0.0  # m/s, within the limits


class ForceLoopInputs(NamedTuple):
    """The wanted motion and the measurements.

    The wanted motion is the sum of a piston velocity and a joint rate; usually one is given.
    """

    velocity_command: float  # of the piston, m/s
    joint_rate_command: float  # rad/s
    angle: float  # of the joint, rad
    pressure_lifting: float  # Pa
    pressure_lowering: float  # Pa
    direct: bool = False  # the velocity stands for a valve command that is to be handed on


class ForceLoopOutputs(NamedTuple):
    """The command and what led to it."""

    valve_command: float  # y2, 1
    force: float  # F of the measured pressures, N (9)
    feedback: float  # velocity taken off for damping, m/s (10)
    velocity: float  # wanted piston velocity behind the feedback, m/s
    saturated: bool  # the valve is fully open
    limited: bool = False  # speed, its change or an end of the stroke


@dataclass(frozen=True)
class ForceLoop:
    """y2 = prefilter(v_c - k_F T_H s / (1 + T_H s) F), paper (9), (10), Fig. 8."""

    parameters: ForceLoopParameters

    def initial(self, inputs: ForceLoopInputs, velocity: float = 0.0) -> ForceLoopState:
        """Return the state in which force and wanted velocity, m/s, have been such for long."""
        return ForceLoopState(self._force(inputs), velocity)

    def step(
        self, state: ForceLoopState, inputs: ForceLoopInputs, dt: float
    ) -> tuple[ForceLoopState, ForceLoopOutputs]:
        """Return the valve command of this control period of dt, s.

        An input that is not a number shuts the valve and leaves the force's state as it was. What
        is handed on is neither damped nor limited: who commands the valve does that himself.
        """
        if not all(map(math.isfinite, inputs)):
            return state._replace(wanted=0.0), ForceLoopOutputs(0.0, math.nan, 0.0, 0.0, False)
        p = self.parameters
        if not math.isfinite(state.static_force):  # begun without a measurement
            state = self.initial(inputs, state.wanted)
        force = self._force(inputs)
        if inputs.direct:
            velocity = inputs.velocity_command
            command = valve_command(velocity, replace(p.prefilter, standstill=0.0))
            saturated = abs(command) >= 1.0
            outputs = ForceLoopOutputs(command, force, 0.0, velocity, saturated)
            return ForceLoopState(force, velocity), outputs
        static_force = low_pass(state.static_force, force, p.time_constant, dt)
        feedback = p.gain * (force - static_force)
        wanted = inputs.velocity_command
        wanted += piston_velocity(inputs.joint_rate_command, inputs.angle, p.prefilter)
        stroke = piston_stroke(inputs.angle, p.prefilter)
        allowed = limited(wanted, state.wanted, stroke, dt, p.limits)
        velocity = off_the_ends(allowed - feedback, stroke, 0.0, p.limits)  # damping moves, too
        command = valve_command(velocity, p.prefilter)
        outputs = ForceLoopOutputs(
            command, force, feedback, velocity, abs(command) >= 1.0, velocity != wanted - feedback
        )
        return ForceLoopState(static_force, allowed), outputs

    def _force(self, inputs: ForceLoopInputs) -> float:
        pressures = inputs.pressure_lifting, inputs.pressure_lowering
        return piston_force(*pressures, self.parameters.prefilter)
