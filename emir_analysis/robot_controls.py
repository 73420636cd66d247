"""What each control node computes for the whole robot, by the signals of its topics.

The nodes of the graph, the plain loop and the replay of a recording all hold these objects.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from emir_analysis.control_protocols import AT_REST, Signals, Topics
from emir_analysis.node_controls import signals_of
from emir_analysis.robot_setup import RobotForceLoopParameters
from emir_control.cascade import Cascade, CascadeInputs
from emir_control.drive_loop import DriveLoop, DriveLoopInputs
from emir_control.pfc import PREVIEW, Pfc, PfcInputs
from emir_control.robot_trajectory import RobotTrajectory, RobotTrajectoryInputs
from emir_control.trajectory import Reference
from emir_control.waypoints import Waypoints
from emir_msgs_py.robot_topics import (
    JOINTS,
    PRESSURES,
    ROBOT_CASCADE_TERMS,
    ROBOT_CYLINDER_PREVIEW,
    ROBOT_CYLINDER_REFERENCE,
    ROBOT_CYLINDER_STATES,
    ROBOT_FORCE_LOOP_TERMS,
    ROBOT_JOINT_STATES,
    ROBOT_PFC_TERMS,
    ROBOT_VALVE_COMMAND,
    ROBOT_VELOCITY_COMMAND,
    TCP_REFERENCE,
    of_joints,
)
from emir_msgs_py.topics import CYLINDER_PREVIEW

Array = NDArray[np.float64]

MOTOR = JOINTS[0]
HOLD = "hold"  # of a trajectory's names


@dataclass(frozen=True)
class RobotTrajectoryControl:
    """trajectory_node: the desired motion of all pistons, and of the TCP."""

    inputs: ClassVar[Topics] = (ROBOT_JOINT_STATES, ROBOT_CYLINDER_STATES)
    outputs: ClassVar[Topics] = (ROBOT_CYLINDER_REFERENCE, ROBOT_CYLINDER_PREVIEW, TCP_REFERENCE)
    trajectory: RobotTrajectory

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state and the reference of this period."""
        angles, forces = _six(signals, "angle"), _six(signals, "force")
        inputs = RobotTrajectoryInputs(angles, forces)
        if state is None or state is AT_REST:
            if not np.isfinite([angles, forces]).all():  # begins with the first ones
                return state, {name: math.nan for topic in self.outputs for name in topic.fields}
            still = replace(self.trajectory, name=HOLD)  # the named one may not be possible here
            state = (self.trajectory if state is None else still).initial(inputs)
        ahead = self.trajectory.ahead(state, PREVIEW, dt)
        state, now = self.trajectory.step(state, inputs, dt)
        preview = map(float, ahead.T.ravel())
        outputs = dict(zip(ROBOT_CYLINDER_PREVIEW.fields, preview, strict=True))
        outputs |= _signals("reference_stroke", now.strokes)
        outputs |= _signals("reference_velocity", now.velocities)
        outputs |= _signals("reference_force", now.forces)
        yaw = math.atan2(now.place[1], now.place[0])
        outputs |= pose_signals("tcp_reference", now.place[:3], _quaternion(yaw, now.place[3]))
        return state, outputs

    def held(self, state: Any, dt: float) -> Any:
        """Return the state in which the reference comes to rest and stays there."""
        if state is None or state is AT_REST:
            return AT_REST
        return self.trajectory.held(state, dt)

    def follow(self, state: Any, points: Waypoints, dt: float) -> Any:
        """Return the state that follows waypoints of the six joints. Raises WaypointError."""
        return self.trajectory.follow(state, points, dt)


@dataclass(frozen=True)
class RobotCascadeControl:
    """cascade_node: law (11) for every joint, with the same gain and lag."""

    inputs: ClassVar[Topics] = (ROBOT_CYLINDER_REFERENCE, ROBOT_CYLINDER_STATES)
    outputs: ClassVar[Topics] = (ROBOT_CASCADE_TERMS, ROBOT_VELOCITY_COMMAND)
    cascade: Cascade

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the commands and their terms."""
        after: dict[str, Any] = {}
        outputs: Signals = {}
        for joint in JOINTS:
            wanted = Reference(
                signals[f"{joint}_reference_stroke"], signals[f"{joint}_reference_velocity"]
            )
            inputs = CascadeInputs(wanted, signals[f"{joint}_stroke"])
            own = state[joint] if state else self.cascade.initial(inputs)
            after[joint], shown = self.cascade.step(own, inputs, dt)
            outputs |= {f"{joint}_{name}": value for name, value in shown._asdict().items()}
            outputs[f"{joint}_expected_force"] = signals[f"{joint}_reference_force"]
        return after, outputs


@dataclass(frozen=True)
class RobotPfcControl:
    """pfc_node: law (12) for every joint, with the same model and tuning."""

    inputs: ClassVar[Topics] = (
        ROBOT_CYLINDER_REFERENCE, ROBOT_CYLINDER_PREVIEW, ROBOT_CYLINDER_STATES,
    )  # fmt: skip
    outputs: ClassVar[Topics] = (ROBOT_PFC_TERMS, ROBOT_VELOCITY_COMMAND)
    pfc: Pfc

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the commands and their terms."""
        after: dict[str, Any] = {}
        outputs: Signals = {}
        for joint in JOINTS:
            wanted = signals[f"{joint}_reference_stroke"], signals[f"{joint}_reference_velocity"]
            preview = [signals[f"{joint}_{name}"] for name in CYLINDER_PREVIEW.fields]
            inputs = PfcInputs(*wanted, preview, signals[f"{joint}_stroke"])
            own = state[joint] if state else self.pfc.initial(inputs)
            after[joint], shown = self.pfc.step(own, inputs, dt)
            terms = signals_of(shown, "pfc", "velocity_command")
            outputs |= {f"{joint}_{name}": value for name, value in terms.items()}
            outputs[f"{joint}_expected_force"] = signals[f"{joint}_reference_force"]
        return after, outputs


@dataclass(frozen=True)
class RobotForceLoopControl:
    """force_loop_node: force feedback and prefilter of every joint."""

    inputs: ClassVar[Topics] = (ROBOT_VELOCITY_COMMAND, ROBOT_CYLINDER_STATES, PRESSURES)
    outputs: ClassVar[Topics] = (ROBOT_FORCE_LOOP_TERMS, ROBOT_VALVE_COMMAND)
    parameters: RobotForceLoopParameters

    def step(self, state: Any, signals: Signals, dt: float) -> tuple[Any, Signals]:
        """Return the next state, the commands and their terms."""
        after: dict[str, Any] = {}
        outputs: Signals = {}
        for joint in JOINTS:
            loop = DriveLoop(getattr(self.parameters, joint))
            inputs = DriveLoopInputs(
                signals[f"{joint}_velocity_command"],
                signals[f"{joint}_expected_force"],
                signals[f"{joint}_stroke"] if joint != MOTOR else 0.0,  # its chambers do not change
                signals[f"{joint}_pressure_lifting"],
                signals[f"{joint}_pressure_lowering"],
            )
            own = state[joint] if state else loop.initial(inputs)
            after[joint], shown = loop.step(own, inputs, dt)
            outputs |= {
                f"{joint}_valve_command": shown.valve_command,
                f"{joint}_measured_force": shown.force,
                f"{joint}_force_feedback": shown.feedback,
                f"{joint}_wanted_velocity": shown.velocity,
                f"{joint}_saturated": float(shown.saturated),
            }
        return after, outputs


def shut_signals() -> Signals:
    """Return the force loop's signals that shut all valves."""
    return {
        name: 0.0 for topic in RobotForceLoopControl.outputs for name in topic.fields
    } | dict.fromkeys(of_joints("measured_force"), math.nan)


def pose_signals(prefix: str, position: Array, quaternion: Array) -> Signals:
    """Return the signals of a pose; quaternion: (4,), x, y, z, w."""
    places = {f"{prefix}_{axis}": float(v) for axis, v in zip("xyz", position, strict=True)}
    turns = {f"{prefix}_q{axis}": float(v) for axis, v in zip("xyzw", quaternion, strict=True)}
    return places | turns


def _quaternion(yaw: float, pitch: float) -> Array:
    """Return x, y, z, w of a turn about z by the yaw and then about -y by the pitch, rad."""
    turned, lifted = (math.cos(0.5 * yaw), math.sin(0.5 * yaw)), 0.5 * pitch
    up, along = math.sin(lifted), math.cos(lifted)
    return np.array([turned[1] * up, -turned[0] * up, turned[1] * along, turned[0] * along])


def _six(signals: Mapping[str, float], quantity: str) -> Array:
    return np.array([signals[name] for name in of_joints(quantity)])


def _signals(quantity: str, values: Array) -> Signals:
    return dict(zip(of_joints(quantity), map(float, values), strict=True))
