"""What each control node computes, by the signals of the topic table and without ROS.

The nodes of the graph, the closed loop without ROS and the replay of a recording hold these
objects.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from emir_analysis.control_protocols import AT_REST, Signals, Topics
from emir_control.cascade import Cascade, CascadeInputs, CascadeParameters
from emir_control.force_loop import ForceLoop, ForceLoopInputs, ForceLoopOutputs
from emir_control.limits import LimitParameters
from emir_control.lqg import (
    UNMEASURED,
    Lqg,
    LqgInputs,
    LqgOutputs,
    PlannedBeside,
    are_numbers,
)
from emir_control.pfc import Pfc, PfcInputs, PfcOutputs
from emir_control.prefilter import (
    PrefilterParameters,
    commanded_velocity,
    joint_angle,
    piston_stroke,
)
from emir_control.scheduled_pfc import ScheduledPfc
from emir_control.shaping import ShapedCascade, ShapedInputs
from emir_control.tip import Tip, TipInputs
from emir_control.trajectory import (
    NO_MOVE,
    AwayAndBack,
    Motion,
    Move,
    Reference,
    TrajectoryInputs,
    TrajectoryState,
)
from emir_control.waypoints import Along, Axis, Direct, Followed, Linkage, Waypoints, curve
from emir_msgs_py.topics import (
    BOOM_DEFLECTION,
    CASCADE_TERMS,
    CYLINDER_MOVE,
    CYLINDER_PREVIEW,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    FORCE_LOOP_TERMS,
    JOINT_STATES,
    LQG_TERMS,
    MPC_TERMS,
    PFC_TERMS,
    PFC_TIP_TERMS,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    TRUTH,
    VALVE_COMMAND,
    VALVE_LOOPS,
    VELOCITY_COMMAND,
)
from emir_plant.core import Truth
from emir_plant.sensors import Measurement


def situation(reference: Reference, preview: Sequence[float], reading: Measurement) -> Signals:
    """Return what controllers are told in a period, by signal. preview: strokes to come, m."""
    wanted = {"reference_stroke": reference.stroke, "reference_velocity": reference.velocity}
    ahead = dict(zip(CYLINDER_PREVIEW.fields, preview, strict=True))
    return (
        reading._asdict() | wanted | ahead | dict(zip(CYLINDER_MOVE.fields, NO_MOVE, strict=True))
    )


def plant_signals(reading: Measurement, truth: Truth) -> Signals:
    """Return what the plant publishes in a period, by signal; the table of topics is in order."""
    return reading._asdict() | dict(zip(TRUTH.fields, truth, strict=True))


class _Boom:
    """A stroke given by the angle of joint 1."""

    linkage = PrefilterParameters()

    def stroke(self, angle: float) -> float:
        """Return the stroke, m, at an angle, rad."""
        return piston_stroke(angle, self.linkage)

    def angle(self, stroke: float) -> float:
        """Return the angle, rad, at a stroke, m."""
        return joint_angle(stroke, self.linkage)


def _axis(name: str, linkage: Linkage) -> Axis:
    limits = LimitParameters()
    return Axis(name, linkage, *limits.free_stroke, limits.speed)


JOINT1_STROKE, JOINT1_ANGLE = _axis("cylinder1", Direct()), _axis("joint1", _Boom())


@dataclass(frozen=True)
class TrajectoryControl:
    """trajectory_node: the desired piston motion."""

    inputs: ClassVar[Topics] = (CYLINDER_STATES,)
    outputs: ClassVar[Topics] = (CYLINDER_REFERENCE, CYLINDER_PREVIEW, CYLINDER_MOVE)
    trajectory: AwayAndBack

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the reference of this period and of the next ones."""
        inputs = TrajectoryInputs(signals["stroke"])
        if state is None or state is AT_REST:
            begin = self.trajectory.initial(inputs)
            state = begin if state is None else self.held(begin, dt)
        motion = self._motion(state)
        ahead = motion.ahead(state, len(CYLINDER_PREVIEW.fields), dt)
        move = dict(zip(CYLINDER_MOVE.fields, motion.move(state, dt), strict=True))
        state, now = motion.step(state._replace(ahead=ahead), inputs, dt)
        reference = {"reference_stroke": now.stroke, "reference_velocity": now.velocity}
        preview = dict(zip(CYLINDER_PREVIEW.fields, ahead, strict=True))
        return state, reference | preview | move

    def held(self, state: Any, dt: float) -> Any:
        """Return the state in which the reference comes to rest and stays there."""
        if state is None or state is AT_REST:
            return AT_REST
        motion = self._motion(state).held(state.ticks * dt, state.start)
        return TrajectoryState(state.start, 0, motion)

    def follow(self, state: TrajectoryState, points: Waypoints, dt: float) -> TrajectoryState:
        """Return the state that follows waypoints of cylinder1 or joint1. Raises WaypointError."""
        now = self._motion(state).at(state.ticks * dt, state.start)
        axis = JOINT1_ANGLE if "joint1" in points.names else JOINT1_STROKE
        strokes = curve(points, [axis], [now])
        return TrajectoryState(state.start, 0, Followed(strokes, Along(float(strokes.x[-1]))))

    def _motion(self, state: TrajectoryState) -> Motion:
        return state.motion or self.trajectory


@dataclass(frozen=True)
class CascadeControl:
    """cascade_node: law (11)."""

    inputs: ClassVar[Topics] = (CYLINDER_REFERENCE, CYLINDER_STATES)
    outputs: ClassVar[Topics] = (CASCADE_TERMS, VELOCITY_COMMAND)
    cascade: Cascade = Cascade(CascadeParameters())

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        inputs = self._inputs(signals)
        state, outputs = self.cascade.step(state or self.cascade.initial(inputs), inputs, dt)
        return state, outputs._asdict()

    def follow(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the next state when that command was applied in this period."""
        inputs = self._inputs(signals)
        return self.cascade.follow(state or self.cascade.initial(inputs), inputs, command, dt)

    def take_over(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the state whose next command is the one in force."""
        inputs = self._inputs(signals)
        return self.cascade.take_over(state or self.cascade.initial(inputs), inputs, command, dt)

    def _inputs(self, signals: Signals) -> CascadeInputs:
        return CascadeInputs(_reference(signals), signals["stroke"])


@dataclass(frozen=True)
class PfcControl:
    """pfc_node: law (12)."""

    inputs: ClassVar[Topics] = (CYLINDER_REFERENCE, CYLINDER_PREVIEW, CYLINDER_STATES)
    outputs: ClassVar[Topics] = (PFC_TERMS, VELOCITY_COMMAND)
    pfc: Pfc | ScheduledPfc

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        inputs = self._inputs(signals)
        law: Any = self.pfc
        state, outputs = law.step(state or law.initial(inputs), inputs, dt)
        return state, signals_of(outputs, "pfc", "velocity_command")

    def follow(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the next state when that command was applied in this period."""
        inputs = self._inputs(signals)
        law: Any = self.pfc
        return law.follow(state or law.initial(inputs), inputs, command)

    def take_over(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the state whose next command is the one in force."""
        inputs = self._inputs(signals)
        law: Any = self.pfc
        return law.take_over(state or law.initial(inputs, command), inputs)

    def _inputs(self, signals: Signals) -> PfcInputs:
        wanted = _reference(signals)
        stroke, force = signals["stroke"], signals["force"]
        preview = _preview(signals)
        return PfcInputs(wanted.stroke, wanted.velocity, preview, stroke, stroke, force)


@dataclass(frozen=True)
class PfcTipControl:
    """pfc_tip_node: the TCP's angle alpha_6 (paper 3.3)."""

    inputs: ClassVar[Topics] = (
        CYLINDER_REFERENCE, CYLINDER_PREVIEW, JOINT_STATES, BOOM_DEFLECTION, CYLINDER_STATES,
    )  # fmt: skip
    outputs: ClassVar[Topics] = (PFC_TIP_TERMS, VELOCITY_COMMAND)
    tip: Tip

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        inputs = self._inputs(signals)
        state, outputs = self.tip.step(state or self.tip.initial(inputs), inputs, dt)
        return state, signals_of(outputs, "pfc_tip", "velocity_command")

    def follow(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the next state when that command was applied in this period."""
        inputs = self._inputs(signals)
        return self.tip.follow(state or self.tip.initial(inputs), inputs, command)

    def take_over(self, state: Any, signals: Signals, command: float, dt: float) -> Any:
        """Return the state whose next command is the one in force."""
        inputs = self._inputs(signals)
        return self.tip.take_over(state or self.tip.initial(inputs, command), inputs)

    def _inputs(self, signals: Signals) -> TipInputs:
        measured = signals["angle"], signals["deflection"], signals["force"]
        return TipInputs(_reference(signals), _preview(signals), *measured)


@dataclass(frozen=True)
class ShapedControl:
    """Conventional control of a shaped reference; no node has it."""

    inputs: ClassVar[Topics] = (CYLINDER_REFERENCE, CYLINDER_MOVE, CYLINDER_STATES)
    outputs: ClassVar[Topics] = (VELOCITY_COMMAND,)
    shaped: ShapedCascade

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        measured = signals["stroke"], signals["force"]
        inputs = ShapedInputs(_reference(signals), _move(signals), *measured)
        state, outputs = self.shaped.step(state or self.shaped.initial(inputs), inputs, dt)
        return state, outputs._asdict()


@dataclass(frozen=True)
class LqgControl:
    """lqg_node: LQG about a planned move, in the place of outer and force loop."""

    inputs: ClassVar[Topics] = (
        CYLINDER_REFERENCE, CYLINDER_MOVE, JOINT_STATES, PRESSURE_LIFTING, PRESSURE_LOWERING,
        BOOM_DEFLECTION,
    )  # fmt: skip
    outputs: ClassVar[Topics] = (LQG_TERMS, VALVE_COMMAND)
    name: ClassVar[str] = "lqg"
    lqg: Lqg | PlannedBeside

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        inputs = self._inputs(signals)
        if state is None and not are_numbers(inputs):
            return None, self._signals(UNMEASURED, 0.0)
        state, outputs = self.lqg.step(state or self.lqg.initial(inputs), inputs, dt)
        return state, self._signals(outputs, outputs.valve_command)

    def stand_by(self, state: Any, signals: Signals) -> tuple[Any, Signals]:
        """Return the next state while another drives, and what is offered. state None: begin."""
        inputs = self._inputs(signals)
        if state is None and not are_numbers(inputs):
            return None, self._signals(UNMEASURED, 0.0, ready=False)
        state, ready = self.lqg.stand_by(state or self.lqg.initial(inputs), inputs)
        waiting = LqgOutputs(0.0, 0.0, 0.0, 0.0, 0.0, state.payload, 0.0)
        command = state.sent.command if state.joins else 0.0
        return state, self._signals(waiting, command, ready=ready)

    def _signals(self, outputs: LqgOutputs, command: float, *, ready: bool = True) -> Signals:
        """Return outputs by signal, and what is offered: the velocity that stands for a command.

        Of that velocity the prefilter makes the command.
        """
        velocity = commanded_velocity(command, self.lqg.parameters.actuator.static)
        offered = {f"{self.name}_command": velocity, f"{self.name}_ready": float(ready)}
        return signals_of(outputs, self.name, "valve_command") | offered

    def _inputs(self, signals: Signals) -> LqgInputs:
        return LqgInputs(
            signals["reference_stroke"],
            _move(signals),
            signals["angle"],
            signals["pressure_lifting"],
            signals["pressure_lowering"],
            signals["deflection"],
        )


@dataclass(frozen=True)
class MpcControl(LqgControl):
    """mpc_node: the same with a quadratic program in each period."""

    outputs: ClassVar[Topics] = (MPC_TERMS, VALVE_COMMAND)
    name: ClassVar[str] = "mpc"


@dataclass(frozen=True)
class ForceLoopControl:
    """force_loop_node: force feedback and prefilter (paper 3.1)."""

    inputs: ClassVar[Topics] = (
        VELOCITY_COMMAND, JOINT_STATES, PRESSURE_LIFTING, PRESSURE_LOWERING,
    )  # fmt: skip
    outputs: ClassVar[Topics] = (FORCE_LOOP_TERMS, VALVE_COMMAND)
    force_loop: ForceLoop

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the command and its terms."""
        inputs = ForceLoopInputs(
            signals["velocity_command"],
            0.0,
            signals["angle"],
            signals["pressure_lifting"],
            signals["pressure_lowering"],
            direct=any(signals.get(f"{name}_active") == 1.0 for name in VALVE_LOOPS),
        )
        state, outputs = self.force_loop.step(state or self.force_loop.initial(inputs), inputs, dt)
        return state, force_loop_signals(outputs)


def force_loop_signals(outputs: ForceLoopOutputs) -> Signals:
    """Return command and terms by the names of the topic table."""
    return {
        "valve_command": outputs.valve_command,
        "measured_force": outputs.force,
        "force_feedback": outputs.feedback,
        "wanted_velocity": outputs.velocity,
        "saturated": float(outputs.saturated),
    }


def _reference(signals: Signals) -> Reference:
    return Reference(signals["reference_stroke"], signals["reference_velocity"])


def _preview(signals: Signals) -> list[float]:
    return [signals[name] for name in CYLINDER_PREVIEW.fields]


def _move(signals: Signals) -> Move:
    return Move(*(signals[name] for name in CYLINDER_MOVE.fields))


def signals_of(outputs: PfcOutputs | LqgOutputs, prefix: str, command: str) -> Signals:
    """Return a law's outputs by signal: the command by its name, the terms behind the prefix."""
    terms = outputs._asdict()
    given = terms.pop(command)
    return {command: given} | {f"{prefix}_{name}": float(value) for name, value in terms.items()}
