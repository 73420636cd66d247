"""The outer loops of the closed loop without ROS: what each nodes' object is given and gives."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from emir_control.cascade import Cascade, CascadeInputs, CascadeParameters
from emir_control.lqg import Lqg, LqgInputs, LqgOutputs
from emir_control.pfc import Pfc, PfcInputs, PfcOutputs
from emir_control.scheduled_pfc import ScheduledPfc
from emir_control.shaping import ShapedCascade, ShapedInputs
from emir_control.tip import Tip, TipInputs
from emir_control.trajectory import NO_MOVE, Move, Reference
from emir_plant.sensors import Measurement

Signals = dict[str, float]


class Situation(NamedTuple):
    """What an outer loop may know in a control period."""

    reference: Reference
    preview: tuple[float, ...]  # reference strokes of the next periods, m
    reading: Measurement
    move: Move = NO_MOVE


class OuterLoop(Protocol):
    """From a situation to the velocity command and the terms it is made of."""

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""


@dataclass(frozen=True)
class CascadeLoop:
    """Conventional control, law (11)."""

    cascade: Cascade = Cascade(CascadeParameters())

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        inputs = CascadeInputs(now.reference, now.reading.stroke)
        state, outputs = self.cascade.step(state or self.cascade.initial(inputs), inputs, dt)
        return state, outputs._asdict()


@dataclass(frozen=True)
class PfcLoop:
    """Predictive control of the stroke, law (12)."""

    pfc: Pfc | ScheduledPfc

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        wanted = now.reference
        stroke, force = now.reading.stroke, now.reading.force
        inputs = PfcInputs(wanted.stroke, wanted.velocity, now.preview, stroke, stroke, force)
        law: Any = self.pfc
        state, outputs = law.step(state or law.initial(inputs), inputs, dt)
        return state, pfc_signals("pfc", outputs)


@dataclass(frozen=True)
class PfcTipLoop:
    """Predictive control of the TCP's angle alpha_6."""

    tip: Tip

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        r = now.reading
        inputs = TipInputs(now.reference, now.preview, r.angle, r.deflection, r.force)
        state, outputs = self.tip.step(state or self.tip.initial(inputs), inputs, dt)
        return state, pfc_signals("pfc_tip", outputs)


@dataclass(frozen=True)
class ShapedLoop:
    """Conventional control of a shaped reference."""

    shaped: ShapedCascade

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        inputs = ShapedInputs(now.reference, now.move, now.reading.stroke, now.reading.force)
        state, outputs = self.shaped.step(state or self.shaped.initial(inputs), inputs, dt)
        return state, outputs._asdict()


@dataclass(frozen=True)
class LqgLoop:
    """LQG, or by its name MPC, about a planned motion; gives the valve command itself."""

    lqg: Lqg
    name: str = "lqg"

    def step(self, state: Any, now: Situation, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the signals; state None: begin here."""
        r = now.reading
        inputs = LqgInputs(
            now.reference.stroke,
            now.move,
            r.angle,
            r.pressure_lifting,
            r.pressure_lowering,
            r.deflection,
        )
        state, outputs = self.lqg.step(state or self.lqg.initial(inputs), inputs, dt)
        return state, lqg_signals(self.name, outputs)


def lqg_signals(prefix: str, outputs: LqgOutputs) -> Signals:
    """Return command and terms by the names of the topic table."""
    terms = outputs._asdict()
    command = terms.pop("valve_command")
    return {"valve_command": command} | {f"{prefix}_{name}": v for name, v in terms.items()}


def pfc_signals(prefix: str, outputs: PfcOutputs) -> Signals:
    """Return command and terms by the names of the topic table."""
    terms = outputs._asdict()
    command = terms.pop("velocity_command")
    named = {f"{prefix}_{name}": float(value) for name, value in terms.items()}
    return {"velocity_command": command} | named
