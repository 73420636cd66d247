"""The graph with the whole robot: the plain loop's values, and what may be wrong with its input."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")
pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install 'emir_ros[robot]'")

from refused import refusal
from rosbags.highlevel import AnyReader

from emir_analysis.cli import main as analyze
from emir_analysis.info import info
from emir_analysis.replay import replay
from emir_analysis.robot_controls import (
    RobotCascadeControl,
    RobotForceLoopControl,
    RobotTrajectoryControl,
)
from emir_analysis.robot_machine import RobotLoop
from emir_analysis.robot_setup import (
    Posture,
    cascade_parameters,
    force_loops,
    path_parameters,
    trajectory,
)
from emir_analysis.run_signals import load_run
from emir_analysis.stamped import same
from emir_common.quantity import ParameterError
from emir_control.cascade import Cascade
from emir_control.trajectory import TrajectoryParameters
from emir_msgs_py import conversions
from emir_msgs_py.robot_topics import ROBOT_PFC_TERMS, ROBOT_TOPICS
from emir_msgs_py.topics import CONTROL_PERIOD_NS, DIAGNOSTICS, PLANT_PERIOD_NS
from emir_plant.robot.plant import RobotPlant
from emir_plant.robot.sheet import robot
from emir_ros.run import main as run_graph

DURATION = 1.6  # s: into the ramp of the move


def test_lockstep_graph_equals_the_plain_loop(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "run"
    words = ["--model", "robot", "--trajectory", "line", "--duration", str(DURATION)]
    assert run_graph([*words, "--bag", str(bag)]) == 0
    assert "tcp_path_error_peak" in capfd.readouterr().out
    assert info(bag).about["model"] == "robot"
    picture = tmp_path / "way.png"
    assert analyze(["analyze", str(bag), "--picture", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    sheet = robot()
    planned = trajectory(sheet, "line", TrajectoryParameters(), path_parameters(sheet))
    loop = RobotLoop(
        RobotPlant(sheet),
        [
            RobotTrajectoryControl(planned),
            RobotCascadeControl(Cascade(cascade_parameters())),
            RobotForceLoopControl(force_loops(sheet)),
        ],
    ).run(Posture().angles, 2e6, DURATION)
    for node in ("trajectory", "cascade", "force_loop", "plant"):
        assert same(replay(bag, node, {})), node
    with AnyReader([bag]) as reader:
        messages: dict[str, list[object]] = {}
        for connection, _, data in reader.messages():
            if connection.topic == DIAGNOSTICS:
                continue
            decoded = reader.deserialize(data, connection.msgtype)
            messages.setdefault(connection.topic, []).append(decoded)
    of_run = [topic for topic in ROBOT_TOPICS if topic is not ROBOT_PFC_TERMS]
    assert messages.keys() == {f"/{topic.name}" for topic in of_run}
    for topic in of_run:
        period = PLANT_PERIOD_NS if topic.every == "plant" else CONTROL_PERIOD_NS
        found = messages[f"/{topic.name}"]
        stamps = [conversions.stamp_ns(message) for message in found]
        assert stamps == [k * period for k in range(round(DURATION * 1e9 / period) + 1)]
        for name in topic.fields:
            values = [conversions.values(topic, message)[name] for message in found]
            assert np.array_equal(values, loop[name]), name


def test_predictive_control_drives_the_robot_and_is_replayed(tmp_path: Path) -> None:
    bag = tmp_path / "run"
    words = ["--model", "robot", "--controller", "pfc", "--duration", "1.3"]
    assert run_graph([*words, "--bag", str(bag)]) == 0
    for node in ("trajectory", "pfc", "force_loop"):
        assert same(replay(bag, node, {})), node
    assert 0.1 < load_run(bag)["joint1_valve_command"].value[-1] < 0.6  # it lifts
    with pytest.raises(ParameterError, match=r"^plant: joint 3: 85\.9 deg is outside"):
        replay(bag, "plant", {"initial_angles.joint3": 1.5})


def test_description_and_its_joints_are_published() -> None:
    """What robot_state_publisher needs, read by Pinocchio's parser."""
    import pinocchio as pin
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String

    from emir_ros import qos
    from emir_ros.plant_node import PlantNode

    rclpy.init()
    try:
        heard: dict[str, object] = {}
        listener, executor = Node("rviz"), SingleThreadedExecutor()
        latched = qos.offered(lockstep=True)
        joints = "description_joint_states"
        for kind, topic in ((String, "robot_description"), (JointState, joints)):
            profile = latched if kind is String else 10
            listener.create_subscription(
                kind, topic, lambda m, t=topic: heard.setdefault(t, m), profile
            )
        plant = PlantNode(["--ros-args", "-p", "model:=robot"])
        executor.add_node(listener)
        executor.add_node(plant)
        for _ in range(2000):
            executor.spin_once(timeout_sec=0.1)
            if len(heard) == 2:
                break
        model = pin.buildModelFromXML(heard["robot_description"].data)  # type: ignore[attr-defined]
        shown = heard[joints]
        assert set(shown.name) == set(model.names) - {"universe"}  # type: ignore[attr-defined]
        at = dict(zip(shown.name, shown.position, strict=True))  # type: ignore[attr-defined]
        assert at["joint1"] == pytest.approx(Posture().joint1, abs=1e-3)
        assert at["arm1_section2_pitch"] > 1e-5  # bent down by the weight
    finally:
        executor.shutdown()
        listener.destroy_node()
        plant.destroy_node()
        rclpy.shutdown()


BAD = {
    "model": (["--model", "crane"], "", "model 'crane': there are joint1, robot"),
    "controller": (
        ["--controller", "lqg"],
        "",
        "controller 'lqg': the whole robot has cascade, pfc",
    ),
    "switching": (["--switch", "1=pfc"], "", "switching: the whole robot keeps one controller"),
    "trajectory": (["--trajectory", "loop"], "", "there are lift-lower, lower-lift, hold, line"),
    "posture": (
        ["--trajectory", "hold"],
        "plant_node: {ros__parameters: {initial_angles: {joint3: 1.5}}}",
        r"yaml: plant_node: joint 3: 85.9 deg is outside the linkage's reach, -61.1 \.\.\. 72.6",
    ),
    "angle": (
        [],
        "plant_node: {ros__parameters: {initial_angles: {joint3: 5.0}}}",
        r"params.yaml: plant_node: initial_angles.joint3 = 5: outside -3.2 \.\.\. 3.2 rad",
    ),
    "angle's name": (
        [],
        "plant_node: {ros__parameters: {initial_angles: {joint9: 0.5}}}",
        "params.yaml: plant_node: initial_angles.joint9: there is no such parameter",
    ),
    "payload's type": (
        [],
        "plant_node: {ros__parameters: {geometry.payload: heavy}}",
        "params.yaml: plant_node: geometry.payload = 'heavy': not a number",
    ),
    "payload": (
        [],
        "plant_node: {ros__parameters: {geometry.payload: 2000.0, effects.payload.mass: 2000.0}}",
        "params.yaml: plant_node: arm.payload = 4000: outside",
    ),
    "pressure's type": (
        [],
        "plant_node: {ros__parameters: {supply.p0: high}}",
        "params.yaml: plant_node: supply.p0 = 'high': not a number",
    ),
    "file's type": (
        [],
        "trajectory_node: {ros__parameters: {robot_file: 5}}",
        "params.yaml: trajectory_node: 5: No such file",
    ),
    "line": (
        ["--trajectory", "line"],
        "trajectory_node: {ros__parameters: {line: {x: 25.0}}}",
        "trajectory_node: line: the arm does not reach",
    ),
    "joint 1's parameter": (
        [],
        "plant_node: {ros__parameters: {initial_angle: 0.5}}",
        "plant_node: initial_angle: there is no such parameter; there are .*initial_angles, ",
    ),
    "effect": (
        [],
        "plant_node: {ros__parameters: {effects: {command_delay: {delay: 0.01}}}}",
        "effects.command_delay: not in the model of the whole robot",
    ),
    "too heavy": (
        ["--trajectory", "hold"],
        "plant_node: {ros__parameters: {supply.p0: 5.0e+6}}",
        r"params.yaml: plant_node: joint \d needs \d+ bar to rest on, the pump gives 50",
    ),
    "file": (
        [],
        "plant_node: {ros__parameters: {robot_file: nowhere.yaml}}",
        "nowhere.yaml: No such file",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_line(
    case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words, parameters, said = BAD[case]
    words = ["--model", "robot", "--duration", "1", *words]
    assert re.search(said, refusal(words, parameters, tmp_path, capfd))


def test_missing_pinocchio_is_one_clear_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "emir_plant.robot.find_spec", lambda name: None if name == "pinocchio" else find(name)
    )
    assert run_graph(["--model", "robot", "--bag", str(tmp_path / "run")]) == 1
    assert "pip install 'emir_ros[robot]'" in capfd.readouterr().err


@pytest.mark.parametrize("model", ["joint1", "robot"])
def test_payload_beyond_the_machine_is_warned_of(
    model: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "params.yaml"
    file.write_text(
        "plant_node: {ros__parameters: {geometry.payload: 1600.0, supply.p0: 4.5e+7,"
        " resistances.k_pump_line: 3.6e+10}}"
    )
    words = ["--model", model, "--params", str(file), "--duration", "0.1"]
    assert run_graph([*words, "--bag", str(tmp_path / "run")]) == 0
    error = capfd.readouterr().err
    assert error.count("payload = 1600 kg: the machine is made for 1500 kg") == 1
