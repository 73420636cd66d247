"""Predictive control whose models follow posture and payload (gain scheduling).

Every model of the schedule is fed the command that is applied, so each is ready at any time; the
command is the mean of what the neighbouring models' laws want, weighted by how near they are.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from emir_common.quantity import ParameterError
from emir_control.filters import low_pass
from emir_control.pfc import Pfc, PfcInputs, PfcOutputs, PfcParameters, PfcState
from emir_control.schedule import Schedule

NUMBERS = tuple(name for name in PfcOutputs._fields if name not in ("model_error", "limited"))


class ScheduledState(NamedTuple):
    """The slow part of the piston's force, N, and every law's state."""

    static_force: float
    laws: tuple[PfcState, ...]


@dataclass(frozen=True)
class ScheduledPfc:
    """The laws of all models of a schedule, as one; used like `Pfc`.

    The inputs have to tell stroke and force. Raises ParameterError for parameters without a
    schedule.
    """

    parameters: PfcParameters

    def __post_init__(self) -> None:
        if self.parameters.schedule is None:
            raise ParameterError("schedule: missing")
        _ = self.laws

    @cached_property
    def schedule(self) -> Schedule:
        """The schedule, which is there."""
        assert self.parameters.schedule is not None  # noqa: S101 (__post_init__ has seen to it)
        return self.parameters.schedule

    @cached_property
    def laws(self) -> tuple[Pfc, ...]:
        """The law of each model."""
        p = self.parameters
        return tuple(Pfc(replace(p, model=model, schedule=None)) for model in self.schedule.flat)

    def initial(self, inputs: PfcInputs, command: float = 0.0) -> ScheduledState:
        """Return the state in which the machine has moved at a constant command, m/s, for long."""
        states = tuple(law.initial(inputs, command) for law in self.laws)
        return ScheduledState(inputs.force, states)

    def take_over(self, state: ScheduledState, inputs: PfcInputs) -> ScheduledState:
        """Return the state whose next command is the one in force; see `Pfc.take_over`."""
        states = zip(self.laws, state.laws, strict=True)
        return state._replace(laws=tuple(law.take_over(own, inputs) for law, own in states))

    def step(
        self, state: ScheduledState, inputs: PfcInputs, dt: float
    ) -> tuple[ScheduledState, PfcOutputs]:
        """Return the velocity command of this control period of dt, s; see `Pfc.step`."""
        static_force = self._static_force(state, inputs, dt)
        if not math.isfinite(inputs.stroke + static_force):  # nobody knows which model counts
            inputs = inputs._replace(output=math.nan)
        weights = self.weights(inputs.stroke, static_force)
        laws, outputs = blended(self.laws, weights, state.laws, inputs, dt)
        return ScheduledState(static_force, laws), outputs

    def follow(self, state: ScheduledState, inputs: PfcInputs, command: float) -> ScheduledState:
        """Return the next state while another controller's command, m/s, moves the machine."""
        static_force = self._static_force(state, inputs, self.parameters.model.period)
        states = zip(self.laws, state.laws, strict=True)
        laws = tuple(law.follow(own, inputs, command) for law, own in states)
        return ScheduledState(static_force, laws)

    def weights(self, stroke: float, static_force: float) -> dict[int, float]:
        """Return which laws count, and how much; the first alone where nothing is known."""
        if not math.isfinite(stroke + static_force):
            return {0: 1.0}
        return self.schedule.weights(stroke, self.schedule.payload(stroke, static_force))

    def _static_force(self, state: ScheduledState, inputs: PfcInputs, dt: float) -> float:
        if not math.isfinite(inputs.force):
            return state.static_force
        if not math.isfinite(state.static_force):
            return inputs.force
        return low_pass(state.static_force, inputs.force, self.parameters.load_time, dt)


def blended(
    laws: Sequence[Pfc],
    weights: Mapping[int, float],
    states: Sequence[PfcState],
    inputs: PfcInputs,
    dt: float,
) -> tuple[tuple[PfcState, ...], PfcOutputs]:
    """Return the next states and the weighted mean of the laws' commands.

    Every model goes on with the command that is applied. A weighted mean of commands within the
    limits is within them.
    """
    found = {k: laws[k].step(states[k], inputs, dt) for k in weights}
    heaviest = found[max(weights, key=lambda k: weights[k])][1]
    if not math.isfinite(heaviest.unlimited):  # a measurement is no number: all stop
        return tuple(
            law.step(own, inputs, dt)[0] for law, own in zip(laws, states, strict=True)
        ), heaviest
    command = sum(weights[k] * after.command for k, (after, _) in found.items())
    means = {name: _mean(name, weights, found) for name in NUMBERS}
    limited = any(out.limited for _, out in found.values())
    outputs = heaviest._replace(**means, limited=limited)
    applied, after = outputs.velocity_command, []
    for k, law in enumerate(laws):
        if k in found:
            own, out = found[k]
            drive = law.parameters.model.B * (applied - out.velocity_command)
            after.append(own._replace(model=own.model + drive, command=command))
        else:
            after.append(law.follow(states[k], inputs, applied)._replace(command=command))
    return tuple(after), outputs


def _mean(
    name: str, weights: Mapping[int, float], found: Mapping[int, tuple[PfcState, PfcOutputs]]
) -> float:
    """Return the weighted mean of one field of the outputs."""
    return float(sum(weights[k] * getattr(out, name) for k, (_, out) in found.items()))


def law_of(parameters: PfcParameters) -> Pfc | ScheduledPfc:
    """Return the control law of a design, with or without a schedule."""
    return Pfc(parameters) if parameters.schedule is None else ScheduledPfc(parameters)
