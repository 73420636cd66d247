"""Parameters set while a node runs: checked, in force from the next period, recorded."""

from collections.abc import Callable
from pathlib import Path

import pytest
import waiting

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from emir_analysis.info import info, text
from emir_analysis.node_controls import CascadeControl
from emir_analysis.recorded_orders import orders
from emir_msgs_py.topics import CASCADE_TERMS, CONTROL_PERIOD_NS
from emir_ros.cascade_node import CascadeNode
from emir_ros.force_loop_node import ForceLoopNode
from emir_ros.pfc_node import PfcNode
from emir_ros.plant_node import PlantNode
from emir_ros.recorder_node import RecorderNode
from emir_ros.trajectory_node import TrajectoryNode

pytestmark = pytest.mark.usefixtures("ros")

DT = CONTROL_PERIOD_NS * 1e-9
SIGNALS = {"reference_stroke": 0.31, "reference_velocity": 0.0, "stroke": 0.3}


def _set(node: Node, name: str, value: float) -> str:
    """Return why it was refused, "" if it was not."""
    (result,) = node.set_parameters([Parameter(name, value=value)])
    return "" if result.successful else result.reason


def test_a_gain_is_in_force_from_the_next_period_and_the_state_is_kept() -> None:
    node = CascadeNode(["--ros-args", "-p", "lockstep:=true"])
    node.control(SIGNALS | {"reference_stroke": 0.3}, DT)
    before = node.control(SIGNALS, DT)
    assert before["feedback"] == pytest.approx(2.0 * (before["smoothed_reference"] - 0.3))
    assert _set(node, "gain", 3) == ""
    after = node.control(SIGNALS, DT)
    assert after["feedback"] == pytest.approx(3.0 * (after["smoothed_reference"] - 0.3))
    assert before["smoothed_reference"] < after["smoothed_reference"] < 0.302
    node.destroy_node()


@pytest.mark.parametrize(
    ("make", "name", "value", "reason"),
    [
        (CascadeNode, "gain", 99.0, r"gain out of range Min: 0.0, Max: 50.0, value: 99.0"),
        (CascadeNode, "gain", 99, r"gain = 99: outside 0 ... 50 1/s"),
        (CascadeNode, "time_constant", float("nan"), r"time_constant out of range"),
        (ForceLoopNode, "gain", -1.0, r"gain out of range Min: 0.0, Max: 1e-05, value: -1.0"),
        (ForceLoopNode, "prefilter.dead_zone", 0.0, "read-only"),
        (PfcNode, "response_time", 0.0, "response_time out of range Min: 0.05, Max: 20.0"),
        (PfcNode, "error_window", 3, "read-only"),
    ],
)
def test_what_cannot_be_set_is_refused_with_the_reason(
    make: Callable[[], Node], name: str, value: float, reason: str
) -> None:
    node = make()
    before = node.get_parameter(name).value
    with pytest.raises(AssertionError, match=reason):
        assert _set(node, name, value) == ""
    assert node.get_parameter(name).value == before
    node.destroy_node()


@pytest.mark.parametrize("make", [CascadeNode, ForceLoopNode, PfcNode, PlantNode, TrajectoryNode])
def test_tools_are_told_meaning_unit_and_range(make: Callable[[], Node]) -> None:
    """What `ros2 param describe` and sliders show; of every number but the node's own few."""
    node = make()
    names = node.list_parameters([], 0).names
    described = {name: node.describe_parameter(name) for name in names}
    own = {"use_sim_time", "start_type_description_service"}
    assert all(d.description for name, d in described.items() if name not in own)
    numbers = {
        name: d
        for name, d in described.items()
        if isinstance(node.get_parameter(name).value, float) and name != "input_timeout"
    }
    assert numbers
    for name, descriptor in numbers.items():
        (span,) = descriptor.floating_point_range
        assert span.from_value <= node.get_parameter(name).value <= span.to_value
        assert f"{span.from_value:g} ... {span.to_value:g}" in descriptor.description
    node.destroy_node()


@pytest.mark.parametrize(
    ("make", "name", "value"),
    [(ForceLoopNode, "gain", 5e-8), (PfcNode, "response_time", 2.5)],
)
def test_the_law_has_what_was_set(make: Callable[[], Node], name: str, value: float) -> None:
    node = make()
    law = node.law
    assert _set(node, name, value) == ""
    held = node.law.force_loop if make is ForceLoopNode else node.law.pfc
    assert getattr(held.parameters, name) == value
    assert node.law is not law
    node.destroy_node()


def test_a_change_is_recorded(tmp_path: Path, executor: SingleThreadedExecutor) -> None:
    bag = tmp_path / "run"
    words = [f"bag:={bag}", f"topics:=[{CASCADE_TERMS.name}]", "nodes:=[cascade_node]"]
    recorder = RecorderNode(["--ros-args", *(w for p in words for w in ("-p", p))])
    cascade = CascadeNode()
    for node in (recorder, cascade):
        executor.add_node(node)

    def until(condition: Callable[[], object]) -> None:
        waiting.until(condition, lambda: executor.spin_once(timeout_sec=0.01))

    until(lambda: cascade.count_subscribers(CASCADE_TERMS.name) == 1)
    until(lambda: cascade.count_subscribers("/parameter_events") >= 1)
    said = {name: 0.0 for topic in CascadeControl.outputs for name in topic.fields}
    sent = 0
    while not recorder.changes:
        cascade.publish_all(0, said)
        sent += 1
        assert _set(cascade, "gain", 2.0 + 0.01 * sent) == ""
        assert sent < 100
        for _ in range(20):
            executor.spin_once(timeout_sec=0.01)
    until(lambda: recorder.writer.message_count > 0)
    until(lambda: "/orders" in recorder.writer.topics)
    recorder.close()
    (order, *_) = orders(bag, "cascade_node")
    assert order.what == "set"
    assert 2.0 < order.values["gain"] <= 2.0 + 0.01 * sent
    (first, *_) = info(bag).changes.values()
    assert (first.node, first.name) == ("/cascade_node", "gain")
    assert 2.0 < float(first.value) <= 2.0 + 0.01 * sent
    assert f"s: /cascade_node gain = {first.value}" in text(info(bag))
    for node in (recorder, cascade):
        node.destroy_node()
