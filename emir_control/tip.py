"""Predictive control of the TCP's angle alpha_6 (paper 3.3): joint resolver and strain gauges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from emir_control.pfc import Pfc, PfcInputs, PfcOutputs
from emir_control.prefilter import (
    PrefilterParameters,
    joint_angle,
    lever_arm,
    piston_stroke,
)
from emir_control.scheduled_pfc import ScheduledPfc
from emir_control.trajectory import Reference


class TipState(NamedTuple):
    """The deflection that belongs to the weight, and the law's own state, scheduled or not."""

    sag: float  # rad
    pfc: Any


class TipInputs(NamedTuple):
    """The piston's reference and what alpha_6 is measured by."""

    reference: Reference
    ahead: Sequence[float]  # reference strokes of the next periods, m
    angle: float  # of the joint, rad
    deflection: float  # alpha_6 - alpha_1, rad
    force: float = math.nan  # of the piston, N; only a schedule asks for it


@dataclass(frozen=True)
class Tip:
    """PFC on alpha_6, less the deflection with which it began.

    The set point is the joint angle that belongs to the reference stroke: at rest the boom sags
    under its weight, and no piston motion is wanted for that.
    """

    pfc: Pfc | ScheduledPfc
    linkage: PrefilterParameters = field(default_factory=PrefilterParameters)

    def initial(self, inputs: TipInputs, command: float = 0.0) -> TipState:
        """Return the state of a boom that hangs as it does now, at a constant command, m/s."""
        sag = inputs.deflection
        return TipState(sag, self.pfc.initial(self._inputs(inputs, sag), command))

    def take_over(self, state: TipState, inputs: TipInputs) -> TipState:
        """Return the state whose next command is the one in force; see `Pfc.take_over`."""
        after = self.pfc.take_over(state.pfc, self._inputs(inputs, state.sag))
        return TipState(state.sag, after)

    def step(self, state: TipState, inputs: TipInputs, dt: float) -> tuple[TipState, PfcOutputs]:
        """Return the velocity command of this control period of dt, s; see `Pfc.step`."""
        if not math.isfinite(state.sag):  # begun without a measurement
            state = self.initial(inputs)
        after, outputs = self.pfc.step(state.pfc, self._inputs(inputs, state.sag), dt)
        return TipState(state.sag, after), outputs

    def follow(self, state: TipState, inputs: TipInputs, command: float) -> TipState:
        """Return the next state while another controller's command, m/s, moves the machine."""
        after = self.pfc.follow(state.pfc, self._inputs(inputs, state.sag), command)
        return TipState(state.sag, after)

    def _inputs(self, inputs: TipInputs, sag: float) -> PfcInputs:
        set_point = joint_angle(inputs.reference.stroke, self.linkage)
        arm = lever_arm(set_point, self.linkage)
        return PfcInputs(
            set_point,
            inputs.reference.velocity / arm,
            [joint_angle(stroke, self.linkage) for stroke in inputs.ahead],
            inputs.angle + inputs.deflection - sag,
            piston_stroke(inputs.angle, self.linkage),
            inputs.force,
        )
