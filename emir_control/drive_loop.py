"""The force loop along a plan: damps what the plan does not expect, by the drive's inverse.

With F the piston's force, F_e what the planned motion takes and u the velocity by the oil's flows
alone (`actuator.py`), the oil obeys dF/dt = k_h (u - v). So

    u = v_c + F_e' / k_h - k_F [T_H s / (1 + T_H s)] (F - F_e)

moves the piston with v_c while F follows F_e, and lets the rest die out. That is (10), which takes
every slow change of the load for a motion to be damped, but for the one that is planned; and what
fills and empties the chambers until a motion is steady is in u, not left to the outer loop.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.actuator import Actuator, ActuatorParameters, Oil
from emir_control.filters import low_pass
from emir_control.force_loop import ForceLoopOutputs
from emir_control.limits import LimitParameters, limited, off_the_ends


@dataclass(frozen=True, kw_only=True)
class DriveLoopParameters:
    """High pass (10), the drive's inverse and the limits of what is wanted."""

    gain: float = quantity("m/(s N)", 0.0, 1e-5, "k_F", default=8.8e-8)
    time_constant: float = quantity("s", 0.01, 60.0, "T_H, of the high pass", default=1.0)
    smoothing: float = quantity(
        "s", 1e-3, 1.0, "of F_e', which comes in steps of a control period", default=0.032
    )
    actuator: ActuatorParameters = field(default_factory=ActuatorParameters)
    limits: LimitParameters = field(default_factory=LimitParameters)

    def __post_init__(self) -> None:
        check_ranges(self)


class DriveLoopState(NamedTuple):
    """What the filters hold, the last wanted velocity and the logic block's opening."""

    static_force: float  # of F - F_e, N
    expected_force: float  # N, smoothed
    wanted: float  # m/s, within the limits
    logic: float


class DriveLoopInputs(NamedTuple):
    """The wanted motion, the force that it is expected to take, and the measurements."""

    velocity_command: float  # of the piston, m/s
    expected_force: float  # N
    stroke: float  # m
    pressure_lifting: float  # Pa
    pressure_lowering: float  # Pa


@dataclass(frozen=True)
class DriveLoop:
    """y2 = drive^-1(v_c + F_e' / k_h - k_F [T_H s / (1 + T_H s)] (F - F_e))."""

    parameters: DriveLoopParameters

    @cached_property
    def drive(self) -> Actuator:
        """The drive as stated."""
        return Actuator(self.parameters.actuator)

    def initial(self, inputs: DriveLoopInputs) -> DriveLoopState:
        """Return the state in which all has stood as it is for long."""
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        piloted = inputs.pressure_lifting > self.parameters.actuator.threshold
        expected = inputs.expected_force
        return DriveLoopState(force - expected, expected, 0.0, float(piloted))

    def step(
        self, state: DriveLoopState, inputs: DriveLoopInputs, dt: float
    ) -> tuple[DriveLoopState, ForceLoopOutputs]:
        """Return the valve command of this control period of dt, s.

        An input that is not a number shuts the valve and leaves the forces' state as it was.
        """
        if not all(map(math.isfinite, inputs)):
            return state._replace(wanted=0.0), ForceLoopOutputs(0.0, math.nan, 0.0, 0.0, False)
        if not math.isfinite(state.static_force):  # begun without a measurement
            state = self.initial(inputs)
        p, stroke = self.parameters, inputs.stroke
        force = self.drive.force(inputs.pressure_lifting, inputs.pressure_lowering)
        static = low_pass(state.static_force, force - inputs.expected_force, p.time_constant, dt)
        feedback = p.gain * (force - inputs.expected_force - static)
        expected = low_pass(state.expected_force, inputs.expected_force, p.smoothing, dt)
        rate = (expected - state.expected_force) / dt
        allowed = limited(inputs.velocity_command, state.wanted, stroke, dt, p.limits)
        wanted = allowed + rate / self.drive.stiffness(stroke) - feedback
        velocity = off_the_ends(wanted, stroke, 0.0, p.limits)
        logic = self.drive.next_logic(state.logic, inputs.pressure_lifting, dt)
        oil = self._oil(inputs, velocity, logic).with_open_block()
        still = abs(velocity) < p.actuator.static.standstill
        opening = 0.0 if still else self.drive.opening(velocity, oil)
        within = velocity == wanted and allowed == inputs.velocity_command
        outputs = ForceLoopOutputs(
            self.drive.command(opening), force, feedback, velocity, abs(opening) >= 1.0, not within
        )
        return DriveLoopState(static, expected, allowed, logic), outputs

    def _oil(self, inputs: DriveLoopInputs, velocity: float, logic: float) -> Oil:
        """Return the oil as the inverse reckons with it.

        The pump is taken to have the metering edge's drop to spare, so that one that gives more
        than stated does not open the valve wide.
        """
        p = self.parameters.actuator
        most = p.supply - p.balance
        lifting, lowering = inputs.pressure_lifting, inputs.pressure_lowering
        if velocity > 0.0:
            return Oil(inputs.stroke, min(lifting, most), lowering, logic)
        return Oil(inputs.stroke, lifting, min(lowering, most), logic)
