"""Input shaping: a move whose ramps leave one swing of the boom at rest.

A step answered by impulses A_i at times t_i leaves nothing of a mode of frequency w_d and
damping zeta behind, with K = exp(-zeta pi / sqrt(1 - zeta^2)) (Singer and Seering 1990):

    ZV     A = [1, K] / (1 + K),            t = [0, pi / w_d]
    ZVD    A = [1, 2 K, K^2] / (1 + K)^2,   t = [0, pi / w_d, 2 pi / w_d]

ZVD also leaves the slope over the frequency at zero. A shaped move takes as long as the plain
one: what the shaper adds is taken off the trapezoid.
"""

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

from emir_common.quantity import ParameterError, check_ranges, quantity
from emir_control.boom import BoomTable
from emir_control.cascade import Cascade, CascadeInputs, CascadeOutputs, CascadeState
from emir_control.prefilter import PrefilterParameters, joint_angle, lever_arm
from emir_control.trajectory import Move, Reference, Trapezoid

Shaper = Literal["zv", "zvd"]
RAMP = 0.75 / 3.3  # of the duration: the paper's trapezoid


class Impulse(NamedTuple):
    """A part of the move, 1, begun late by a time, s."""

    share: float
    delay: float


def impulses(shaper: Shaper, frequency: float, damping: float) -> tuple[Impulse, ...]:
    """Return the shaper's impulses for a mode of a frequency, Hz, and a damping, of critical.

    Raises ParameterError for another shaper.
    """
    root = math.sqrt(1.0 - damping * damping)
    decay = math.exp(-damping * math.pi / root)
    half = 0.5 / (frequency * root)
    if shaper == "zv":
        weights = [1.0, decay]
    elif shaper == "zvd":
        weights = [1.0, 2.0 * decay, decay * decay]
    else:
        raise ParameterError(f"shaper {shaper!r}: there are zv, zvd")
    total = sum(weights)
    return tuple(Impulse(weight / total, k * half) for k, weight in enumerate(weights))


@dataclass(frozen=True)
class ShapedMove:
    """A rest-to-rest move as the sum of its impulses' trapezoids."""

    trapezoid: Trapezoid
    parts: tuple[Impulse, ...]

    def at(self, time: float) -> Reference:
        """Return displacement and velocity `time` s after the start of the move."""
        each = [(part.share, self.trapezoid.at(time - part.delay)) for part in self.parts]
        stroke = sum(share * reference.stroke for share, reference in each)
        return Reference(stroke, sum(share * reference.velocity for share, reference in each))


def shaped(move: Move, parts: tuple[Impulse, ...]) -> ShapedMove:
    """Return the move, shaped, in its own duration.

    Raises ParameterError where the shaper takes longer than that.
    """
    left = move.duration - parts[-1].delay
    if left <= 0.0:
        raise ParameterError(
            f"a shaper of {parts[-1].delay:.2g} s does not fit into a move of {move.duration:g} s"
        )
    ramp = RAMP * left
    speed = abs(move.distance) / (left - ramp)
    return ShapedMove(Trapezoid(move.distance, speed, ramp), parts)


@dataclass(frozen=True, kw_only=True)
class ShapedParameters:
    """boom: whose slowest mode, the joint held, is shaped for, with the payload as read.

    damping: what the mode has and what the force loop adds.
    """

    boom: BoomTable
    cascade: Cascade
    shaper: Shaper = "zv"
    damping: float = quantity("1", 0.0, 0.9, "of critical, of the mode shaped for", default=0.01)
    linkage: PrefilterParameters = PrefilterParameters()

    def __post_init__(self) -> None:
        check_ranges(self)


class ShapedState(NamedTuple):
    """Mean force at rest, N, over a count of periods; the move under way and its start, m."""

    periods: int
    force: float
    move: ShapedMove | None
    start: float
    cascade: CascadeState


class ShapedInputs(NamedTuple):
    """The reference, the move to make, measured stroke, m, and force, N."""

    reference: Reference
    move: Move
    stroke: float
    force: float


@dataclass(frozen=True)
class ShapedCascade:
    """Law (11) on a shaped reference; the payload is read from the force at rest."""

    parameters: ShapedParameters

    def initial(self, inputs: ShapedInputs) -> ShapedState:
        """Return the state of a machine at rest."""
        cascade = self.parameters.cascade.initial(CascadeInputs(inputs.reference, inputs.stroke))
        return ShapedState(0, inputs.force, None, inputs.reference.stroke, cascade)

    def step(
        self, state: ShapedState, inputs: ShapedInputs, dt: float
    ) -> tuple[ShapedState, CascadeOutputs]:
        """Return the velocity command of this control period of dt, s."""
        state = self._prepared(state, inputs)
        reference = inputs.reference
        if state.move is not None:
            moved = state.move.at(inputs.move.since)
            reference = Reference(state.start + moved.stroke, moved.velocity)
        law = self.parameters.cascade
        cascade, outputs = law.step(state.cascade, CascadeInputs(reference, inputs.stroke), dt)
        return state._replace(cascade=cascade), outputs

    def _prepared(self, state: ShapedState, inputs: ShapedInputs) -> ShapedState:
        if inputs.move.since < 0.0:
            periods = 1 if state.move is not None else state.periods + 1
            force = state.force + (inputs.force - state.force) / periods
            return state._replace(periods=periods, force=force, move=None)
        if state.move is not None:
            return state
        p, start = self.parameters, inputs.reference.stroke
        angle = joint_angle(start, p.linkage)
        torque = state.force * lever_arm(angle, p.linkage) / math.cos(angle)
        boom = p.boom.loaded(p.boom.payload(torque)).clamped()
        frequency = math.sqrt(boom.stiffness[0]) / (2.0 * math.pi)
        move = shaped(inputs.move, impulses(p.shaper, frequency, p.damping))
        return state._replace(move=move, start=start)
