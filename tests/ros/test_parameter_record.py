"""The parameters of other nodes, also when the middleware drops an answer."""

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from waiting import until

from emir_analysis.recorded_parameters import recorded_nodes, recorded_parameters
from emir_msgs_py import conversions
from emir_msgs_py.topics import JOINT_STATES
from emir_ros import parameter_record
from emir_ros.parameter_record import ParameterRecord
from emir_ros.recorder_node import RecorderNode

pytestmark = pytest.mark.usefixtures("ros")


class Dropped(AsyncParameterClient):
    """Asks, but the first answer of either kind never comes."""

    dropped: set[str]

    def list_parameters(self, *args: Any, **kw: Any) -> Any:
        """Ask for the names."""
        return self._dropped_once("list") or super().list_parameters(*args, **kw)

    def get_parameters(self, *args: Any, **kw: Any) -> Any:
        """Ask for the values."""
        return self._dropped_once("get") or super().get_parameters(*args, **kw)

    def _dropped_once(self, what: str) -> Any:
        if what in self.dropped:
            return None
        self.dropped.add(what)
        return Future()


def test_a_dropped_answer_is_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Dropped, "dropped", set(), raising=False)
    monkeypatch.setattr(parameter_record, "AsyncParameterClient", Dropped)
    asked, asking = Node("asked"), Node("asking")
    asked.declare_parameter("gain", 2.0)
    found: list[dict[str, dict[str, Any]]] = []
    executor = SingleThreadedExecutor()
    for node in (asked, asking):
        executor.add_node(node)
    record = ParameterRecord(asking, ["asked"], found.append)
    try:
        until(lambda: found, lambda: executor.spin_once(timeout_sec=0.1))
    finally:
        executor.shutdown()
        for node in (asked, asking):
            node.destroy_node()
    del record
    assert Dropped.dropped == {"list", "get"}
    assert [answers["asked"]["gain"] for answers in found] == [2.0]


def test_a_node_that_is_absent_costs_no_other_its_parameters(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "bag"
    words = ["-p", f"bag:={bag}", "-p", "nodes:=[asked, absent]"]
    asked, recorder = Node("asked"), RecorderNode(["--ros-args", *words])
    asked.declare_parameter("gain", 2.0)
    message = conversions.message(JOINT_STATES, 0, {"angle": 0.8, "velocity": 0.0})
    angles = asked.create_publisher(type(message), JOINT_STATES.name, 10)
    executor = SingleThreadedExecutor()
    for node in (asked, recorder):
        executor.add_node(node)

    def go_on() -> None:
        angles.publish(message)
        executor.spin_once(timeout_sec=0.1)

    try:
        until(lambda: recorder.answered and recorder.heard, go_on)
    finally:
        recorder.close()
        executor.shutdown()
        for node in (asked, recorder):
            node.destroy_node()
    assert set(recorded_nodes(bag)) == {"asked"}
    assert recorded_parameters(bag, "asked")["gain"] == 2.0
    assert "without the parameters of absent: no answer" in capfd.readouterr().err
