"""The whole robot on the page: five arms on the turning base, all joints' plots."""

from collections import namedtuple
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import viser
from numpy.typing import NDArray

from emir_analysis.run_signals import at
from emir_analysis.signals import Recording
from emir_analysis.view.frames import shown_times
from emir_analysis.view.joint1 import BOOM, STRAIGHT, ball, polyline
from emir_analysis.view.page import Chart
from emir_control.arm import ArmParameters
from emir_msgs_py.robot_topics import (
    JOINTS,
    PRESSURES,
    ROBOT_CYLINDER_REFERENCE,
    ROBOT_CYLINDER_STATES,
    ROBOT_JOINT_STATES,
    ROBOT_VALVE_COMMAND,
    TCP_DEFLECTION,
    TCP_POSE,
)

Array = NDArray[np.float64]

TOPICS = (
    ROBOT_JOINT_STATES, ROBOT_CYLINDER_STATES, ROBOT_CYLINDER_REFERENCE, ROBOT_VALVE_COMMAND,
    PRESSURES, TCP_POSE, TCP_DEFLECTION,
)  # fmt: skip
SIGNALS = tuple(signal for topic in TOPICS for signal in topic.fields)
ERRORS = tuple(f"{joint}_error" for joint in JOINTS)  # stroke less reference, m; base: rad
COLORS = ("#5d4037", "#0b6bb5", "#d1622b", "#2e8b57", "#8e44ad", "#b8860b")
POINTS = 51  # along the arms

# Any: mypy wants the fields spelled out; these are those of the topic table.
named_tuple: Any = namedtuple  # noqa: PYI024 (fields by the topic table)
RobotFrame: Any = named_tuple("RobotFrame", ("time", *SIGNALS, *ERRORS))


def robot_frame(time: float, signals: dict[str, float]) -> Any:
    """Return the frame of a time, s, from signals by name; nan for what is missing."""
    known = {name: signals.get(name, float("nan")) for name in SIGNALS}
    errors = {
        f"{joint}_error": known[f"{joint}_stroke"] - known[f"{joint}_reference_stroke"]
        for joint in JOINTS
    }
    return RobotFrame(time=time, **known, **errors)


def robot_frames(run: Recording) -> list[Any]:
    """Return a frame for each sample of the machine, up to MOST_FRAMES."""
    time = shown_times(run, "joint1_stroke")
    columns = {name: at(run, name, time) for name in SIGNALS if name in run.signals}
    return [
        robot_frame(float(t), {name: float(column[k]) for name, column in columns.items()})
        for k, t in enumerate(time)
    ]


def _six(title: str, signal: str, factor: float) -> Chart:
    pairs = zip(JOINTS, COLORS, strict=True)
    return Chart(title, tuple((f"{j}_{signal}", j, factor, color) for j, color in pairs))


@dataclass(frozen=True)
class WholeRobot:
    """All six joints."""

    charts: ClassVar[tuple[Chart, ...]] = (
        _six("stroke less reference / mm (base: mrad)", "error", 1e3),
        _six("pressure, lifting / bar", "pressure_lifting", 1e-5),
        _six("valve / %", "valve_command", 100.0),
        Chart("TCP deflection / cm", tuple(
            (f"deflection_{axis}", axis, 100.0, color)
            for axis, color in zip("xyz", COLORS[1:4], strict=True)
        )),
    )  # fmt: skip

    arm: ArmParameters

    @property
    def reach(self) -> float:
        """Return how far it stretches, m."""
        return self.arm.arm_length * (len(JOINTS) - 1)

    def readings(self, frame: Any) -> list[tuple[str, float, str, int]]:
        """Return what is shown in numbers: name, value, unit, digits."""
        rows: list[tuple[str, float, str, int]] = [("time", frame.time, "s", 2)]
        rows += [
            (joint, float(np.degrees(getattr(frame, f"{joint}_angle"))), "deg", 2)
            for joint in JOINTS
        ]
        rows += [(f"TCP {axis}", getattr(frame, f"tcp_{axis}"), "m", 3) for axis in "xyz"]
        return rows

    def draw(self, scene: viser.SceneApi, frame: Any, bending: float) -> None:
        """Draw the arms, their bending so many times as large."""
        angles = np.array([getattr(frame, f"{joint}_angle") for joint in JOINTS])
        if np.isnan(angles).any():
            return
        rigid = centreline(self.arm, angles)
        deflection = np.array([getattr(frame, f"deflection_{axis}") for axis in "xyz"])
        bent = bent_line(rigid, np.nan_to_num(deflection) * bending)
        polyline(scene, "/boom", bent, BOOM, 0.35)
        polyline(scene, "/straight", rigid, STRAIGHT, 0.06)
        polyline(scene, "/base", np.array([[0.0, 0.0, 0.0], rigid[0]]), STRAIGHT, 0.8)
        joints = bent[:: POINTS // (len(JOINTS) - 1)]
        for number, place in enumerate(joints, start=1):
            ball(scene, f"/joint{number}" if number < len(JOINTS) else "/tcp", place, BOOM)


def centreline(arm: ArmParameters, joints: Array) -> Array:
    """Return points of the rigid arms, (POINTS, 3), m, for the joints' angles, (6,), rad."""
    arms = len(JOINTS) - 1
    pitch = np.repeat(np.cumsum(joints[1:]), (POINTS - 1) // arms)
    step = arm.arm_length * arms / (POINTS - 1)
    forward = np.concatenate([[0.0], np.cumsum(step * np.cos(pitch))])
    up = np.concatenate([[0.0], np.cumsum(step * np.sin(pitch))])
    return np.column_stack(
        [forward * np.cos(joints[0]), forward * np.sin(joints[0]), arm.height + up]
    )


def bent_line(rigid: Array, deflection: Array) -> Array:
    """Return the points moved by bending, (3,) m at the TCP, growing with the distance squared."""
    share = np.linspace(0.0, 1.0, len(rigid))
    return rigid + np.outer(share**2, deflection)
