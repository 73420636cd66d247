"""trajectory_node's services and waypoints, period by period in lock step."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from waiting import until

from emir_analysis.robot_setup import Posture
from emir_common.quantity import ParameterError
from emir_control.inverse import ReachError
from emir_msgs_py import conversions
from emir_msgs_py.robot_topics import (
    JOINTS,
    ROBOT_CYLINDER_REFERENCE,
    ROBOT_CYLINDER_STATES,
    ROBOT_JOINT_STATES,
)
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    JOINT1,
    ROBOT,
)
from emir_ros import qos
from emir_ros.trajectory_node import TrajectoryNode

DT = CONTROL_PERIOD_NS * 1e-9
SIGNALS = {JOINT1: {"stroke": 0.4, "force": 0.0}} | {
    ROBOT: {f"{name}_angle": value for name, value in zip(JOINTS, Posture().angles, strict=True)}
    | {f"{name}_{what}": 0.0 for name in JOINTS for what in ("stroke", "force")}
}


class Bench(Node):
    """Gives the node its measurements and hears its reference, a period at a time."""

    def __init__(self, model: str, more: tuple[str, ...]) -> None:
        super().__init__("bench")
        words = ["lockstep:=true", f"model:={model}", "delay:=0.1", "pause:=0.2", *more]
        self.node = TrajectoryNode(["--ros-args", *(w for p in words for w in ("-p", p))])
        robot = model == ROBOT
        states = (ROBOT_JOINT_STATES, ROBOT_CYLINDER_STATES) if robot else (CYLINDER_STATES,)
        self._reference = ROBOT_CYLINDER_REFERENCE if robot else CYLINDER_REFERENCE
        self.signals = SIGNALS[model]
        self.heard: list[dict[str, float]] = []
        self.said: list[str] = []
        profile = qos.offered(lockstep=True)
        kind = conversions.message_class(self._reference.type)
        self._states = [(t, self.create_publisher(kind, t.name, profile)) for t in states]
        self._waypoints = self.create_publisher(JointTrajectory, "joint_trajectory", 10)
        self.create_subscription(kind, self._reference.name, self._on_reference, profile)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.spinning = SingleThreadedExecutor()
        for node in (self, self.node):
            self.spinning.add_node(node)
        self.until(lambda: self._waypoints.get_subscription_count() == 1)
        self.until(lambda: self.count_publishers("/diagnostics") == 1)

    def _on_reference(self, message: Any) -> None:
        self.heard.append(conversions.values(self._reference, message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.said += [status.message for status in message.status]

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until the condition holds."""
        until(condition, self._go_on)

    def _go_on(self) -> None:
        self.spinning.spin_once(timeout_sec=0.01)
        self.node.check()

    def run(self, duration: float) -> None:
        """Go on by a duration, s."""
        for _ in range(round(duration / DT)):
            stamp = len(self.heard) * CONTROL_PERIOD_NS
            for topic, publisher in self._states:
                publisher.publish(conversions.message(topic, stamp, self.signals))
            self.until(lambda stamp=stamp: len(self.heard) * CONTROL_PERIOD_NS > stamp)

    def told(self, text: str) -> None:
        """Wait until the node's diagnostics say a text."""
        self.until(lambda: any(text in said for said in self.said))

    def call(self, verb: str) -> Trigger.Response:
        """Call a service of the node."""
        client = self.create_client(Trigger, f"/trajectory_node/{verb}")
        self.until(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.until(future.done)
        return future.result()

    def send(self, names: list[str], places: list[list[float]], times: list[float]) -> None:
        """Send waypoints and wait until they are taken or rejected."""
        message = JointTrajectory(joint_names=names)
        for place, at in zip(places, times, strict=True):
            point = JointTrajectoryPoint(positions=place)
            point.time_from_start.sec, nanosec = int(at), round((at % 1.0) * 1e9)
            point.time_from_start.nanosec = nanosec
            message.points.append(point)
        before = self.node.waypoints_heard
        self._waypoints.publish(message)
        self.until(lambda: self.node.waypoints_heard > before)


@contextmanager
def _bench(model: str, *more: str) -> Iterator[Bench]:
    """Give a bench; more: parameters of the node, NAME:=VALUE."""
    rclpy.init()
    bench = Bench(model, more)
    try:
        yield bench
    finally:
        bench.spinning.shutdown()
        bench.node.destroy_node()
        bench.destroy_node()
        rclpy.shutdown()


def _of(heard: list[dict[str, float]], name: str) -> np.ndarray:
    return np.array([entry[name] for entry in heard])


@pytest.mark.parametrize(("model", "front"), [(JOINT1, ""), (ROBOT, "joint1_")])
def test_hold_stop_and_start(model: str, front: str) -> None:
    stroke, velocity = f"{front}reference_stroke", f"{front}reference_velocity"
    with _bench(model) as bench:
        bench.run(1.6)
        assert bench.heard[-1][velocity] == pytest.approx(0.025, rel=1e-3)
        assert bench.call("hold").success
        bench.run(1.0)
        speeds = _of(bench.heard, velocity)
        assert abs(np.diff(speeds)).max() / DT < 0.025 / 0.75 * 1.01
        assert speeds[-1] == 0.0
        strokes = _of(bench.heard, stroke)
        # the last period at full speed is that of the call
        assert strokes[-1] - strokes[49] == pytest.approx(0.025 * (DT + 0.375), rel=1e-3)
        assert bench.call("stop").success
        bench.send(["cylinder1"], [[0.5]], [5.0])
        bench.told("joint_trajectory rejected: stopped, goes on after ~/start")
        bench.run(0.2)
        assert _of(bench.heard, velocity)[-1] == 0.0
        assert bench.call("start").success
        bench.run(1.0)
        assert _of(bench.heard, velocity)[-1] > 0.02
        again = _of(bench.heard, stroke)[-round(1.0 / DT)]
        assert again == pytest.approx(strokes[0], abs=1e-9)  # where the machine stands


@pytest.mark.parametrize(("model", "front"), [(JOINT1, ""), (ROBOT, "joint1_")])
def test_what_is_stopped_before_it_begins_stays_where_the_machine_is(
    model: str, front: str
) -> None:
    stroke, velocity = f"{front}reference_stroke", f"{front}reference_velocity"
    with _bench(model) as bench:
        assert bench.call("stop").success
        bench.run(1.6)
        assert not _of(bench.heard, velocity).any()
        assert np.ptp(_of(bench.heard, stroke)) == 0.0
        assert bench.call("start").success
        bench.run(1.6)
        assert bench.heard[-1][velocity] == pytest.approx(0.025, rel=1e-3)
        bench.signals = {name: value + 0.01 for name, value in bench.signals.items()}
        for verb in ("start", "stop", "hold"):  # all before the next period
            assert bench.call(verb).success
        before = len(bench.heard)
        bench.run(0.5)
        assert not _of(bench.heard[before:], velocity).any()
        bench.send(["cylinder1"], [[0.5]], [5.0])
        bench.told("joint_trajectory rejected: stopped, goes on after ~/start")
        assert "stopped" in bench.said
        assert "held" not in bench.said


def test_at_rest_no_named_motion_is_needed_that_cannot_be_made() -> None:
    with _bench(ROBOT, "trajectory:=line", "line.x:=29.0", "line.z:=29.0") as bench:
        assert bench.call("stop").success
        bench.run(0.5)
        assert not _of(bench.heard, "joint1_reference_velocity").any()
        assert bench.call("start").success
        with pytest.raises(ReachError, match="line: "):
            bench.run(DT)


def test_a_rejection_stands_on_diagnostics_for_a_while() -> None:
    with _bench(JOINT1) as bench:
        bench.run(DT)
        bench.send(["elbow"], [[3.0]], [20.0])
        bench.told("joint 'elbow': there are cylinder1")
        said = len(bench.said)
        bench.run(2.0)
        assert len(bench.said) == said
        bench.run(2.0)
        bench.until(lambda: bench.said[-1] == "lift-lower")


def test_waypoints_that_take_more_force_than_the_pump_gives_are_rejected() -> None:
    """The base has to turn an arm of 22.5 m: 0.06 rad in 1.2 s is beyond its motor, in 4 s not."""
    with _bench(ROBOT) as bench:
        bench.run(DT)
        there = Posture().angles
        there[0] -= 0.06
        bench.send(list(JOINTS), [there.tolist()], [1.2])
        bench.told("base would need")
        bench.send(list(JOINTS), [there.tolist()], [4.0])
        bench.run(DT)
        bench.told("follows joint_trajectory")


@pytest.mark.parametrize("model", [JOINT1, ROBOT])
def test_an_unknown_trajectory_is_told_by_the_node(model: str) -> None:
    words = ["-p", f"model:={model}", "-p", "trajectory:=loop"]
    rclpy.init()
    try:
        with pytest.raises(ParameterError, match=r"^trajectory_node: trajectory 'loop': there are"):
            TrajectoryNode(["--ros-args", *words])
    finally:
        rclpy.shutdown()


def test_inactive_it_takes_no_orders() -> None:
    with _bench(JOINT1) as bench:
        bench.run(1.6)
        speed = bench.heard[-1]["reference_velocity"]
        bench.node.trigger_deactivate()
        bench.send(["cylinder1"], [[0.41]], [1.0])
        bench.told("joint_trajectory rejected: inactive")
        for verb in ("start", "hold", "stop"):
            answer = bench.call(verb)
            assert not answer.success
            assert answer.message == "inactive"
        bench.node.trigger_activate()
        bench.run(0.5)
        velocities = _of(bench.heard, "reference_velocity")[-15:]
        assert velocities == pytest.approx(speed, rel=1e-9)  # as if nothing had been ordered


def test_waypoints_in_strokes_and_in_angles() -> None:
    with _bench(JOINT1) as bench:
        bench.run(DT)
        bench.send(["cylinder1"], [[0.41], [0.40]], [1.0, 2.0])
        bench.run(1.0 + 2 * DT)
        assert bench.heard[-1]["reference_stroke"] == pytest.approx(0.41, abs=1e-3)
        bench.run(1.0)
        assert bench.heard[-1] == pytest.approx(
            {"reference_stroke": 0.40, "reference_velocity": 0.0}, abs=1e-9
        )
        bench.send(["joint1"], [[3.0]], [20.0])
        bench.told("joint_trajectory rejected: joint1 leaves its range")
        bench.send(["elbow"], [[3.0]], [20.0])
        bench.told("joint 'elbow': there are cylinder1")
        bench.run(DT)
        bench.told("follows joint_trajectory")


def test_waypoints_of_the_whole_robot() -> None:
    with _bench(ROBOT) as bench:
        bench.run(DT)
        there = Posture().angles
        there[:2] += math.radians(2.0)
        bench.send(list(JOINTS), [there.tolist()], [3.0])
        bench.run(3.0 + 2 * DT)
        assert bench.heard[-1]["base_reference_stroke"] == pytest.approx(there[0], abs=1e-9)
        linkage = bench.node.law.trajectory.linkages[1]
        assert linkage.angle(bench.heard[-1]["joint1_reference_stroke"]) == pytest.approx(there[1])
        still = _of(bench.heard, "joint3_reference_stroke")
        assert np.ptp(still) < 1e-9
        bench.send(["joint1"], [[0.8]], [5.0])
        bench.told("wanted are ['base', 'joint1'")
