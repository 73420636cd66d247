"""Conventional position control of the piston: the outer loop of the cascade (paper 3.2)."""

from dataclasses import dataclass
from typing import NamedTuple

from emir_common.quantity import check_ranges, quantity
from emir_control.filters import low_pass
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
        """Return the velocity command of this control period of dt, s."""
        p = self.parameters
        smoothed = low_pass(state.smoothed, inputs.reference.stroke, p.time_constant, dt)
        feedforward = inputs.reference.velocity
        feedback = p.gain * (smoothed - inputs.stroke)
        outputs = CascadeOutputs(feedforward + feedback, feedforward, feedback, smoothed)
        return CascadeState(smoothed), outputs
