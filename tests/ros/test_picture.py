"""Joint 1's description: its bending is the model's, it is published, and recordings keep it."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from emir_plant.boom_urdf import boom_urdf
from emir_plant.plant import Plant
from emir_plant.sheet import joint1
from emir_ros import describe, qos
from emir_ros.plant_node import PlantNode
from emir_ros.run import main as run_graph


def _tcp(description: str, positions: dict[str, float]) -> np.ndarray:
    """Return x, z, m, and angle, rad, of the TCP: the joints one after the other, in a plane."""
    x = z = angle = 0.0
    parent = "base_link"
    joints = {j.find("parent").attrib["link"]: j for j in ET.fromstring(description).iter("joint")}  # noqa: S314
    while parent in joints:
        joint = joints[parent]
        ahead = float(joint.find("origin").attrib["xyz"].split()[0])
        x, z = x + ahead * math.cos(angle), z + ahead * math.sin(angle)
        if joint.attrib["type"] == "revolute":
            assert joint.find("axis").attrib["xyz"] == "0 -1 0"  # lifts
            angle += positions[joint.attrib["name"]]
        parent = joint.find("child").attrib["link"]
    assert parent == "tcp"
    return np.array([x, z, angle])


def test_what_is_shown_bends_as_the_model_does() -> None:
    rclpy.init()
    listener, executor = Node("rviz"), SingleThreadedExecutor()
    heard: dict[str, object] = {}
    for kind, name, profile in (
        (String, "robot_description", qos.latched()),
        (JointState, "description_joint_states", 10),
    ):
        listener.create_subscription(kind, name, lambda m, n=name: heard.update({n: m}), profile)
    plant = PlantNode()
    try:
        for node in (listener, plant):
            executor.add_node(node)
        for _ in range(2000):
            executor.spin_once(timeout_sec=0.1)
            if len(heard) == 2:
                break
    finally:
        executor.shutdown()
        for node in (listener, plant):
            node.destroy_node()
        rclpy.shutdown()
    shown = heard["description_joint_states"]
    positions = dict(zip(shown.name, shown.position, strict=True))
    x, z, angle = _tcp(heard["robot_description"].data, positions)
    truth = plant.truth
    geometry = plant.plant.machine.geometry
    assert angle == pytest.approx(truth.tip_angle, abs=1e-3)
    assert angle < positions["joint1"]  # it hangs
    line = np.array([math.cos(positions["joint1"]), math.sin(positions["joint1"])])
    off = line[0] * z - line[1] * x
    assert math.hypot(x, z) == pytest.approx(geometry.boom_length, rel=1e-3)
    # the modes that are left out bend it as well
    residual = off + plant.plant.record[0]["residual_sag"] * math.cos(truth.angle)
    assert residual == pytest.approx(truth.tcp_deflection, abs=2e-3)


@pytest.mark.parametrize("processes", ["one", "many"])
def test_a_recording_keeps_the_description(processes: str, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    words = ["--duration", "0.5", "--processes", processes, "--bag", str(bag)]
    assert run_graph(words) == 0
    with (bag / "run_0.mcap").open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert attachment.name == "robot_description.urdf"
    assert attachment.data.decode() == boom_urdf(Plant(joint1()).machine.geometry)


@pytest.mark.parametrize("model", ["joint1", "robot"])
def test_the_description_is_printed_as_the_plant_publishes_it(
    model: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """For robot_state_publisher, which wants it as a parameter before anything runs."""
    if model == "robot":
        pytest.importorskip("pinocchio", reason="pip install 'emir_ros[robot]'")
    file = tmp_path / "params.yaml"
    file.write_text("/**/plant_node: {ros__parameters: {geometry.boom_length: 20.0}}\n")
    words = ["--ros-args", "-p", f"model:={model}", "--params-file", str(file)]
    assert describe.main(words) == 0
    printed = capfd.readouterr().out.strip()
    rclpy.init()
    listener, heard = Node("rviz"), []
    listener.create_subscription(
        String, "robot_description", lambda m: heard.append(m.data), qos.latched()
    )
    plant, executor = PlantNode(words), SingleThreadedExecutor()
    try:
        executor.add_node(listener)
        for _ in range(2000):
            executor.spin_once(timeout_sec=0.1)
            if heard:
                break
    finally:
        executor.shutdown()
        for node in (listener, plant):
            node.destroy_node()
        rclpy.shutdown()
    assert heard == [printed]
