"""Conventional position control of the piston: the outer loop of the cascade (paper 3.2)."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.filters import before_low_pass, low_pass
from emir_control.trajectory import Reference


@dataclass(frozen=True, kw_only=True)
class CascadeParameters:
    """The two parameters of law (11)."""

    gain: float = quantity("1/s", 0.0, 50.0, "k_p, loop gain", default=2.0)
    time_constant: float = quantity("s", 1e-3, 10.0, "T, smooths h_d (paper 3.2)", default=0.4)

    def __post_init__(self) -> None:
        check_ranges(self)


class CascadeState(NamedTuple):
    """The smoothed reference H_d / (1 + T s)."""

    smoothed: float  # m


class CascadeInputs(NamedTuple):
    """The reference and the measured stroke."""

    reference: Reference
    stroke: float  # m


class CascadeOutputs(NamedTuple):
    """The command and its terms."""

    velocity_command: float  # dh_c/dt, m/s
    feedforward: float  # m/s
    feedback: float  # m/s
    smoothed_reference: float  # m


@dataclass(frozen=True)
class Cascade:
    """dH_c = dH_d + k_p [H_d / (1 + T s) - H], paper (11)."""

    parameters: CascadeParameters

    def initial(self, inputs: CascadeInputs) -> CascadeState:
        """Return the state in which the reference has stood where it is for long."""
        return CascadeState(inputs.reference.stroke)

    def step(
        self, state: CascadeState, inputs: CascadeInputs, dt: float
    ) -> tuple[CascadeState, CascadeOutputs]:
        """Return the velocity command of this control period of dt, s.

        An input that is not a number stops the machine and leaves the state as it was.
        """
        if not all(map(math.isfinite, (*inputs.reference, inputs.stroke))):
            return state, CascadeOutputs(0.0, math.nan, math.nan, state.smoothed)
        p = self.parameters
        if not math.isfinite(state.smoothed):  # begun without a reference
            state = self.initial(inputs)
        smoothed = low_pass(state.smoothed, inputs.reference.stroke, p.time_constant, dt)
        feedforward = inputs.reference.velocity
        feedback = p.gain * (smoothed - inputs.stroke)
        outputs = CascadeOutputs(feedforward + feedback, feedforward, feedback, smoothed)
        return CascadeState(smoothed), outputs

    def follow(
        self, state: CascadeState, inputs: CascadeInputs, command: float, dt: float
    ) -> CascadeState:
        """Return the next state while another controller's command, m/s, moves the machine."""
        return self.step(state, inputs, dt)[0]

    def take_over(
        self, state: CascadeState, inputs: CascadeInputs, command: float, dt: float
    ) -> CascadeState:
        """Return the state whose next command is the one in force, m/s.

        The smoothed reference is put where it gives that; the difference dies out with T.
        """
        p, wanted = self.parameters, inputs.reference
        if p.gain == 0.0:
            return state
        smoothed = inputs.stroke + (command - wanted.velocity) / p.gain
        before = before_low_pass(smoothed, wanted.stroke, p.time_constant, dt)
        return CascadeState(before) if math.isfinite(before) else state
