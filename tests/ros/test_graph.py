"""The graph against the plain loop, its recordings against other readers, and dying nodes."""

import gc
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from rclpy.node import Node
from refused import refusal
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosReliability

from emir_analysis.closed_loop import ClosedLoop
from emir_analysis.info import info, parameters_text, text
from emir_analysis.machine_model import lqg_parameters
from emir_analysis.node_controls import (
    CascadeControl,
    LqgControl,
    MpcControl,
    PfcControl,
    PfcTipControl,
)
from emir_analysis.recover import recover
from emir_analysis.replay import replay
from emir_analysis.rosbag2_writer import Rosbag2Writer
from emir_analysis.stamped import same
from emir_analysis.switching import Switch, SwitchedLoop
from emir_control import pfc_file
from emir_control.cascade import Cascade, CascadeParameters
from emir_control.lqg import Lqg
from emir_control.mpc import Mpc
from emir_control.pfc import Pfc
from emir_control.pfc_file import STROKE, TIP_ANGLE
from emir_control.tip import Tip
from emir_control.trajectory import TrajectoryParameters, named
from emir_msgs_py import conversions
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    CYLINDER_REFERENCE,
    DIAGNOSTICS,
    PLANT_PERIOD_NS,
    TOPICS,
    by_name,
)
from emir_plant.curve import POINTS
from emir_plant.plant import Plant
from emir_plant.sheet import joint1
from emir_ros.graph import Plan, duration, read_parameters, ros_arguments
from emir_ros.plant_node import PlantNode
from emir_ros.run import _wait_for_nodes
from emir_ros.run import main as run_graph
from emir_ros.run_parameters import reaches

DURATION = 4.8  # s: at rest, and into the plateau of the first move


CASCADE_TOPICS = {f"/{name}" for name in Plan(bag=Path()).topics}


NODES = set(Plan(bag=Path()).nodes) - {"recorder_node"}


def _loop_signals(controller: str) -> dict[str, np.ndarray]:
    """What the plain loop gives, without ROS."""
    outer = {
        "cascade": CascadeControl,
        "pfc": lambda: PfcControl(Pfc(pfc_file.load(pfc_file.default_file(STROKE), STROKE))),
        "pfc_tip": lambda: PfcTipControl(
            Tip(Pfc(pfc_file.load(pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)))
        ),
        "lqg": lambda: LqgControl(Lqg(lqg_parameters(joint1()))),
        "mpc": lambda: MpcControl(Mpc(lqg_parameters(joint1()))),
    }[controller]()
    trajectory = named("lift-lower", TrajectoryParameters())
    return ClosedLoop(Plant(joint1()), trajectory, outer).run(math.pi / 4, 2e6, DURATION)


def _read_with_rosbags(bag: Path) -> dict[str, list[tuple[int, object]]]:
    """The topics of the table, decoded."""
    found: dict[str, list[tuple[int, object]]] = {}
    with AnyReader([bag]) as reader:
        for connection, log_time, data in reader.messages():
            if connection.topic == DIAGNOSTICS:
                continue
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((log_time, message))
    return found


def _assert_equal(bag: Path, controller: str) -> None:
    recorded, loop = _read_with_rosbags(bag), _loop_signals(controller)
    names = Plan(bag=bag, controller=controller).topics
    assert f"{controller}/terms" in names
    assert recorded.keys() == {f"/{name}" for name in names}
    for topic in map(by_name, names):
        period = PLANT_PERIOD_NS if topic.every == "plant" else CONTROL_PERIOD_NS
        messages = recorded[f"/{topic.name}"]
        stamps = [conversions.stamp_ns(message) for _, message in messages]
        assert stamps == [k * period for k in range(round(DURATION * 1e9 / period) + 1)]
        assert stamps == [log_time for log_time, _ in messages]
    _assert_signals(recorded, names, loop)


def _assert_signals(
    recorded: dict[str, list[tuple[int, object]]],
    names: Collection[str],
    expected: dict[str, np.ndarray],
) -> None:
    """Every signal of the topics, as recorded, is as expected in every bit."""
    for topic in map(by_name, names):
        messages = recorded[f"/{topic.name}"]
        for name in topic.fields:
            values = [conversions.values(topic, message)[name] for _, message in messages]
            assert np.array_equal(values, expected[name]), name


@pytest.mark.parametrize(
    ("controller", "processes"),
    [
        ("cascade", "one"),
        ("cascade", "many"),
        ("pfc", "one"),
        ("pfc", "many"),
        ("pfc_tip", "one"),
        ("lqg", "one"),
        ("mpc", "one"),
    ],
)
def test_lockstep_graph_equals_the_plain_loop(
    controller: str, processes: str, tmp_path: Path
) -> None:
    bag = tmp_path / "run"
    words = ["--controller", controller, "--processes", processes]
    words += ["--duration", str(DURATION), "--bag", str(bag)]
    finished = _emir_run(words)
    assert finished.returncode == 0, finished.stderr
    assert "tcp_deflection_static" in finished.stdout
    _assert_equal(bag, controller)
    others = () if controller in {"lqg", "mpc"} else ("force_loop",)
    for node in ("trajectory", controller, *others, "plant"):
        assert same(replay(bag, node, {})), node


def test_switching_in_lock_step_equals_the_plain_loop_and_itself(tmp_path: Path) -> None:
    files = []
    for name in ("first", "second"):
        bag = tmp_path / name / "run"
        words = ["--controller", "cascade", "--switch", "2.5=pfc", "--switch", "3.6=pfc_tip"]
        assert run_graph([*words, "--duration", str(DURATION), "--bag", str(bag)]) == 0
        files.append((bag / "run_0.mcap").read_bytes())
    assert files[0] == files[1]
    controls = {
        "cascade": CascadeControl(Cascade(CascadeParameters())),
        "pfc": PfcControl(Pfc(pfc_file.load(pfc_file.default_file(STROKE), STROKE))),
        "pfc_tip": PfcTipControl(
            Tip(Pfc(pfc_file.load(pfc_file.default_file(TIP_ANGLE), TIP_ANGLE)))
        ),
    }
    switches = (Switch(0.0, "cascade"), Switch(2.5, "pfc"), Switch(3.6, "pfc_tip"))
    trajectory = named("lift-lower", TrajectoryParameters())
    loop = ClosedLoop(Plant(joint1()), trajectory, SwitchedLoop(controls, switches))
    expected = loop.run(math.pi / 4, 2e6, DURATION)
    recorded = _read_with_rosbags(bag)
    plan = Plan(bag=bag, controller="cascade", switches=switches[1:])
    assert recorded.keys() == {f"/{name}" for name in plan.topics}
    _assert_signals(recorded, plan.topics, expected)
    for node in ("trajectory", "cascade", "pfc", "pfc_tip", "selector", "force_loop"):
        assert same(replay(bag, node, {})), node


def test_switching_by_way_of_lqg_in_lock_step_equals_the_plain_loop(tmp_path: Path) -> None:
    """PFC begins, LQG takes over while it lifts, and back: the force loop hands on, then damps."""
    bag = tmp_path / "run"
    words = ["--controller", "pfc", "--switch", "2=lqg", "--switch", "2.6=pfc", "--duration", "3.2"]
    assert run_graph([*words, "--bag", str(bag)]) == 0
    controls = {
        "lqg": LqgControl(Lqg(lqg_parameters(joint1()))),
        "pfc": PfcControl(Pfc(pfc_file.load(pfc_file.default_file(STROKE), STROKE))),
    }
    switches = (Switch(0.0, "pfc"), Switch(2.0, "lqg"), Switch(2.6, "pfc"))
    trajectory = named("lift-lower", TrajectoryParameters())
    loop = ClosedLoop(Plant(joint1()), trajectory, SwitchedLoop(controls, switches))
    expected = loop.run(math.pi / 4, 2e6, 3.2)
    assert 0.5 < 0.032 * expected["lqg_active"].sum() < 0.7
    recorded = _read_with_rosbags(bag)
    plan = Plan(bag=bag, controller="pfc", switches=switches[1:])
    names = [name for name in plan.topics if f"/{name}" in recorded]
    assert {"lqg/velocity_command", "force_loop/terms", "selector/terms"} <= set(names)
    _assert_signals(recorded, names, expected)
    for node in ("lqg", "pfc", "force_loop"):
        assert same(replay(bag, node, {})), node


def test_lockstep_recording_is_the_same_every_time(tmp_path: Path) -> None:
    files = []
    for name in ("first", "second"):
        bag = tmp_path / name / "run"  # the file's name stands in it
        assert run_graph(["--duration", "2", "--bag", str(bag)]) == 0
        files.append((bag / "run_0.mcap").read_bytes())
    assert files[0] == files[1]


def test_a_recording_in_lock_step_is_split_by_its_own_time(tmp_path: Path) -> None:
    """What the nodes said at first is written a second later, and in the first file."""
    parameters, bag = tmp_path / "split.yaml", tmp_path / "run"
    parameters.write_text("recorder_node: {ros__parameters: {max_duration: 1.0}}")
    words = ["--params", str(parameters), "--duration", "2.4", "--bag", str(bag)]
    assert run_graph(words) == 0
    about = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    starts = [entry["starting_time"]["nanoseconds_since_epoch"] for entry in about["files"]]
    assert starts == [0, 1_000_000_000, 2_000_000_000]


@pytest.mark.parametrize(
    ("words", "moved"), [([], 0.0), (["--trajectory", "lift-lower", "--duration", "3"], 0.02)]
)
def test_the_parameter_files_trajectory_is_run_unless_another_is_asked_for(
    words: list[str], moved: float, tmp_path: Path
) -> None:
    parameters, bag = tmp_path / "hold.yaml", tmp_path / "run"
    parameters.write_text("trajectory_node: {ros__parameters: {trajectory: hold}}")
    words = ["--duration", "1", "--params", str(parameters), "--bag", str(bag), *words]
    assert run_graph(words) == 0
    strokes = [
        conversions.values(CYLINDER_REFERENCE, message)["reference_stroke"]
        for _, message in _read_with_rosbags(bag)[f"/{CYLINDER_REFERENCE.name}"]
    ]
    assert max(strokes) - min(strokes) >= moved
    assert (max(strokes) == min(strokes)) == (moved == 0.0)


@pytest.mark.parametrize(
    ("words", "least", "most"),
    [
        ([], 0.64, 0.64),
        (["--duration", "0.96"], 0.96, 0.96),
        (["--trajectory", "lower-lift"], 1.0, 60.0),
    ],
)
def test_the_parameter_files_duration_is_run_unless_another_run_is_asked_for(
    words: list[str], least: float, most: float, tmp_path: Path
) -> None:
    parameters, bag = tmp_path / "short.yaml", tmp_path / "run"
    parameters.write_text("plant_node: {ros__parameters: {duration: 0.64}}")
    assert run_graph([*words, "--params", str(parameters), "--bag", str(bag)]) == 0
    assert least <= _read_with_rosbags(bag)["/truth"][-1][0] / 1e9 <= most


def test_what_the_run_does_not_take_from_the_parameter_file_is_told(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    parameters = tmp_path / "other.yaml"
    parameters.write_text(
        "/**: {ros__parameters: {lockstep: false, model: joint1}}\n"
        "recorder_node: {ros__parameters: {bag: elsewhere, topics: [truth], max_size: 5.0}}\n"
    )
    words = ["--params", str(parameters), "--duration", "0.32", "--bag", str(tmp_path / "run")]
    assert run_graph(words) == 0
    said = "not used, the run sets it: /**: lockstep; recorder_node: bag, topics"
    assert f"emir run: {parameters}: {said}\n" in capfd.readouterr().err


def test_the_run_prevails_over_the_file_whatever_its_order(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """rcl would let a name that comes after the pattern /** prevail over the run's own."""
    parameters, bag = tmp_path / "other.yaml", tmp_path / "run"
    parameters.write_text(
        "/**: {ros__parameters: {use_sim_time: false}}\n"
        "plant_node: {ros__parameters: {lockstep: false, duration: 9.0}}\n"
    )
    assert run_graph(["--params", str(parameters), "--duration", "0.32", "--bag", str(bag)]) == 0
    assert "the run sets it: plant_node: lockstep, duration" in capfd.readouterr().err
    assert _read_with_rosbags(bag)["/truth"][-1][0] == 320_000_000


def test_a_file_of_two_machines_sets_up_each_by_its_own_part(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    parameters = tmp_path / "two.yaml"
    parameters.write_text(
        "/left/cascade_node: {ros__parameters: {gain: 1.5}}\n"
        "/left/trajectory_node: {ros__parameters: {trajectory: hold}}\n"
        "/right/cascade_node: {ros__parameters: {gain: 1.0}}\n"
        "/right/trajectory_node: {ros__parameters: {trajectory: lower-lift, speed: 0.02}}\n"
        "/*/plant_node: {ros__parameters: {duration: 0.32}}\n"
    )
    told = {}
    for side in ("left", "right"):
        bag = tmp_path / side
        words = ["--namespace", side, "--params", str(parameters), "--bag", str(bag)]
        assert run_graph(words) == 0
        set_up = yaml.safe_load(parameters_text(info(bag)))
        told[side] = {node: entry["ros__parameters"] for node, entry in set_up.items()}
    assert "of another namespace: /right/cascade_node, /right/traj" in capfd.readouterr().err
    gains = {side: nodes["cascade_node"]["gain"] for side, nodes in told.items()}
    assert gains == {"left": 1.5, "right": 1.0}
    names = {side: nodes["trajectory_node"]["trajectory"] for side, nodes in told.items()}
    assert names == {"left": "hold", "right": "lower-lift"}
    assert told["left"]["trajectory_node"]["speed"] == TrajectoryParameters().speed
    assert {nodes["plant_node"]["duration"] for nodes in told.values()} == {0.32}


@pytest.mark.parametrize(
    ("pattern", "namespaces"),
    [
        ("x", {"", "a", "a/b"}),
        ("/**/x", {"", "a", "a/b"}),
        ("/**", {"", "a", "a/b"}),
        ("/x", {""}),
        ("/*/x", {"a"}),
        ("a/x", {"a"}),
        ("/a/**", {"a", "a/b"}),
        ("/a/*", {"a"}),
        ("/b/x", set()),
        ("/**/y", set()),
    ],
)
def test_a_pattern_reaches_whom_rcl_lets_it_reach(
    pattern: str, namespaces: set[str], tmp_path: Path
) -> None:
    file = tmp_path / "pattern.yaml"
    as_rcl_takes_it = pattern if "/" in pattern else f"/**/{pattern}"
    file.write_text(f"{as_rcl_takes_it}: {{ros__parameters: {{a: 1}}}}\n")
    by_rcl = set()
    rclpy.init()
    for place in ("", "a", "a/b"):
        words = ["--params-file", str(file), "-r", f"__ns:=/{place}"]
        node = rclpy.create_node("x", cli_args=["--ros-args", *words])
        by_rcl |= {place} if node._parameter_overrides else set()
        node.destroy_node()
    rclpy.shutdown()
    ours = {place for place in ("", "a", "a/b") if reaches(pattern, "x", place)}
    assert ours == by_rcl == namespaces


def test_nodes_that_live_in_the_lock_steps_time_do_not_wait_for_it(tmp_path: Path) -> None:
    parameters, bag = tmp_path / "clock.yaml", tmp_path / "run"
    parameters.write_text("/**: {ros__parameters: {use_sim_time: true}}")
    words = ["--params", str(parameters), "--duration", str(DURATION), "--bag", str(bag)]
    assert run_graph(words) == 0
    _assert_equal(bag, "cascade")


def test_readers_agree_and_metadata_is_rosbag2s(tmp_path: Path) -> None:
    from mcap_ros2.decoder import DecoderFactory

    bag = tmp_path / "run"
    assert run_graph(["--duration", "1", "--bag", str(bag)]) == 0
    by_rosbags = _read_with_rosbags(bag)
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        counts: dict[str, int] = {}
        statuses = 0
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            if channel.topic == DIAGNOSTICS:
                statuses += 1
                continue
            k = counts.get(channel.topic, 0)
            counts[channel.topic] = k + 1
            topic = by_name(channel.topic[1:])
            log_time, other = by_rosbags[channel.topic][k]
            assert schema.encoding == "ros2msg"
            assert schema.name == topic.type
            assert channel.message_encoding == "cdr"
            assert message.log_time == log_time
            assert conversions.values(topic, decoded) == conversions.values(topic, other)
            assert {"offered_qos_profiles", "topic_type_hash"} <= channel.metadata.keys()
        stored = {record.name: record.metadata for record in reader.iter_metadata()}
    assert counts == {topic: len(messages) for topic, messages in by_rosbags.items()}
    assert set(stored["emir.parameters"]) == NODES
    text = (bag / "metadata.yaml").read_text()
    assert stored["rosbag2"]["serialized_metadata"] == text
    assert not re.search(r"[&*]id\d", text)  # rosbag2 writes no anchors
    info = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert info["version"] == 9
    assert info["message_count"] == sum(counts.values()) + statuses
    assert info["duration"]["nanoseconds"] == 1_000_000_000 - 1_000_000_000 % CONTROL_PERIOD_NS
    with AnyReader([bag]) as opened:
        for connection in opened.connections:
            (profile,) = connection.ext.offered_qos_profiles
            assert profile.reliability is QosReliability.RELIABLE


def test_schema_text_is_the_one_that_ros_distributes(tmp_path: Path) -> None:
    """rosbags keeps its own copy of ROS 2's definitions and gives them a type hash."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from emir_ros.message_definitions import definition, type_hash

    store = get_typestore(Stores.ROS2_JAZZY)
    beside = {"geometry_msgs/msg/PoseStamped", "diagnostic_msgs/msg/DiagnosticArray"}
    for name in {topic.type for topic in TOPICS} | beside:
        parsed = get_types_from_msg(definition(name), name)
        assert name in parsed
        for inner, fields in parsed.items():
            assert fields == store.fielddefs[inner], inner
        assert type_hash(name) == store.hash_rihs01(name)


@pytest.mark.parametrize("controller", ["cascade", "lqg"])
def test_real_time_graph_controls_the_machine(controller: str, tmp_path: Path) -> None:
    bag = tmp_path / "run"
    words = ["--realtime", "--controller", controller, "--duration", "4"]
    finished = _emir_run([*words, "--bag", str(bag)])
    assert finished.returncode == 0, finished.stderr
    recorded = _read_with_rosbags(bag)
    stroke = [m.position[0] for _, m in recorded["/truth"]]  # type: ignore[attr-defined]
    # Of 502: the computer may be busy, its timer then comes twice in a period; it does not go on.
    assert 200 < len(stroke) < 530
    periods = np.diff([log_time for log_time, _ in recorded["/valve_command"]])
    assert np.median(periods) == pytest.approx(CONTROL_PERIOD_NS, rel=0.05)
    strokes = [
        conversions.values(by_name("truth"), m)["true_stroke"] for _, m in recorded["/truth"]
    ]
    assert strokes[-1] - strokes[0] > 0.005  # it has begun to lift


def test_the_garbage_collector_passes_over_the_libraries_of_a_run_in_real_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Going through them takes 0.2 s, in which the valve shuts."""
    before, seen = len(gc.get_objects()), []
    show = PlantNode._show_progress

    def look(node: PlantNode) -> None:
        if not seen:
            seen.append(len(gc.get_objects()))
        show(node)

    monkeypatch.setattr(PlantNode, "_show_progress", look)
    words = ["--realtime", "--duration", "0.5", "--bag", str(tmp_path / "run")]
    assert run_graph(words) == 0
    assert seen[0] < 0.1 * before
    assert gc.get_freeze_count() == 0  # the process may have more to do


class Starting:
    """Stands for a process that takes its time to bring its node up, or has ended."""

    def __init__(self, name: str, code: int | None = None) -> None:
        self.looked_at = 0
        self._name, self._code = name, code
        self._up: list[Node] = []

    def poll(self) -> int | None:
        """Return the exit code; the third time the node is up."""
        self.looked_at += 1
        if self.looked_at == 3:
            self._up.append(Node(self._name))
        return self._code


@pytest.mark.usefixtures("ros")
def test_in_real_time_the_trajectory_begins_when_all_others_are_there() -> None:
    late = Starting("late_node")
    _wait_for_nodes({"late_node": late})
    assert late.looked_at >= 3
    dead = Starting("dead_node", code=1)
    _wait_for_nodes({"dead_node": dead})
    assert dead.looked_at == 1


@pytest.mark.parametrize("victim", ["cascade_node", "recorder_node", "plant_node"])
def test_a_killed_node_is_noticed_and_the_recording_stays_readable(
    victim: str, tmp_path: Path
) -> None:
    bag = tmp_path / "run"
    words = ["--duration", "600", "--processes", "many", "--bag", str(bag)]
    with _started(words) as process:
        _wait_until(lambda: _size(bag / "run_0.mcap") > 300_000, process)
        os.kill(_child(process.pid, victim), signal.SIGKILL)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert f"emir run: {victim} was killed by SIGKILL before the run was over" in errors
    assert "Traceback" not in errors
    from emir_analysis.run_signals import load_run

    recording = load_run(bag)
    assert recording["stroke"].time[-1] > 1.0
    if victim == "recorder_node":
        recover(bag, tmp_path / "whole")
        bag = tmp_path / "whole"
    assert _read_with_rosbags(bag).keys() == CASCADE_TOPICS


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("processes", ["one", "many"])
def test_an_interrupted_run_keeps_what_it_has(
    number: signal.Signals, processes: str, tmp_path: Path
) -> None:
    """Also where it is interrupted once more while its nodes end, none of which stays."""
    bag = tmp_path / "run"
    with _started(["--duration", "600", "--processes", processes, "--bag", str(bag)]) as process:
        _wait_until(lambda: _size(bag / "run_0.mcap") > 300_000, process)
        nodes = list(_children(process.pid))
        process.send_signal(number)
        if processes == "many":
            _wait_until(lambda: not all(_is_there(node) for node in nodes), process)
            process.send_signal(number)
        out, errors = process.communicate(timeout=120)
    assert bool(nodes) == (processes == "many")
    assert not any(_is_there(node) for node in nodes)
    assert process.returncode == 130
    assert errors.rstrip().endswith("emir run: interrupted")
    assert "tracking_error_rms" in out
    assert _read_with_rosbags(bag).keys() == CASCADE_TOPICS


BAD = {
    "controller": (["--controller", "magic"], "", "controller 'magic': there are cascade"),
    "namespace": (["--namespace", "2nd"], "", "namespace '2nd': letters, digits"),
    "trajectory": (["--trajectory", "loop"], "", "trajectory 'loop': there are lift-lower"),
    "no trajectory": (["--trajectory", ""], "", "trajectory '': there are lift-lower"),
    "trajectory's speed": (
        [],
        "trajectory_node: {ros__parameters: {speed: 2e+2}}",
        "trajectory_node: speed = 200: outside",
    ),
    "duration": (["--duration", "-1"], "", "duration = -1 s: has to be positive"),
    "switch": (["--switch", "2=magic"], "", "controller 'magic': there are cascade"),
    "switch time": (["--switch", "soon=pfc"], "", "--switch soon=pfc: not of the form S=NAME"),
    "late switch": (
        ["--switch", "5=pfc", "--duration", "4.5"],
        "",
        "--switch 5=pfc: the run is over after 4.5 s",
    ),
    "switch order": (["--switch", "2=pfc", "--switch", "1=cascade"], "", "have to rise from 0 s"),
    "range": (
        [],
        "plant_node: {ros__parameters: {valve: {dead_zone: 2.0}}}",
        "valve.dead_zone = 2",
    ),
    "plant's duration": (
        [],
        "plant_node: {ros__parameters: {duration: long}}",
        "plant_node: duration = 'long': not a number",
    ),
    "type": ([], "cascade_node: {ros__parameters: {gain: high}}", "gain = 'high': not of type"),
    "unknown": (
        [],
        "plant_node: {ros__parameters: {valve: {zone: 0.1}}}",
        "valve.zone: there is no",
    ),
    "design": (
        ["--controller", "pfc"],
        "pfc_node: {ros__parameters: {model_file: nowhere.yaml}}",
        "pfc_node: nowhere.yaml: No such file",
    ),
    "future": (
        ["--controller", "pfc_tip"],
        "pfc_tip_node: {ros__parameters: {future: bright}}",
        "pfc_tip_node: future = 'bright': there are preview",
    ),
    "window": (
        ["--controller", "pfc"],
        "pfc_node: {ros__parameters: {error_window: 1}}",
        "pfc_node: error_window = 1: has to exceed error_degree",
    ),
    "node": ([], "crane: {ros__parameters: {}}", "crane: no such node; there are"),
    "form": ([], "plant_node: {valve: 1}", "plant_node: ros__parameters is missing"),
    "twice": (
        [],
        "plant_node: {ros__parameters: {valve: {dead_zone: 0.1}, valve.dead_zone: 0.2}}",
        "plant_node: valve.dead_zone stands twice",
    ),
    "robot's file": (
        [],
        "/**: {ros__parameters: {model: robot}}\ntrajectory_node: {ros__parameters: {joint: 2}}",
        "params.yaml: /**: for the model robot, and the run is of joint1: give --model robot",
    ),
    "unknown model": (
        [],
        "/**: {ros__parameters: {model: [crane]}}",
        "params.yaml: /**: model ['crane']: there are joint1, robot",
    ),
    "right's gain": (
        ["--namespace", "right"],
        "/right/cascade_node: {ros__parameters: {gain: high}}",
        "cascade_node: gain = 'high': not of type",
    ),
    "angle": (
        [],
        "plant_node: {ros__parameters: {initial_angle: 0.0, supply: {p0: 5.0e6}}}",
        "params.yaml: plant_node: at 0.0 deg the boom needs",
    ),
}


@pytest.mark.parametrize("controller", ["lqg", "mpc"])
def test_a_move_that_the_drive_cannot_make_is_one_clear_line(
    controller: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    if controller == "mpc":
        pytest.importorskip("osqp", reason="OSQP is missing: pip install 'emir_ros[mpc]'")
    file, bag = tmp_path / "params.yaml", tmp_path / "run"
    file.write_text("trajectory_node: {ros__parameters: {distance: 0.2, speed: 0.2, ramp: 0.2}}")
    words = ["--controller", controller, "--params", str(file), "--duration", "3"]
    assert run_graph([*words, "--bag", str(bag)]) == 1
    said = [line for line in capfd.readouterr().err.splitlines() if "emir run" in line]
    assert len(said) == 1
    assert f"{controller}_node: no motion turns the joint by" in said[0]


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_clear_line(
    case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words, parameters, said = BAD[case]
    assert said in refusal(words, parameters, tmp_path, capfd)


def test_a_recording_is_never_overwritten(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "precious").write_text("data")
    assert run_graph(["--bag", str(tmp_path)]) == 1
    assert "exists already" in capfd.readouterr().err
    with pytest.raises(ValueError, match="exists already"):
        Rosbag2Writer(tmp_path)
    assert (tmp_path / "precious").read_text() == "data"


@pytest.mark.parametrize("processes", ["one", "many"])
def test_a_recording_says_what_it_was_made_with(processes: str, tmp_path: Path) -> None:
    """Parameters as set and as left alone, and what every field means."""
    file, bag = tmp_path / "params.yaml", tmp_path / "run"
    curve = [1e3 * k for k in range(POINTS)]
    file.write_text(
        "cascade_node: {ros__parameters: {gain: 1.5}}\n"
        "plant_node: {ros__parameters: {effects.payload.mass: 500.0, sensors.seed: 7,\n"
        f"  unnamed_force: {{over: 1, friction: {curve}}}}}}}\n"
    )
    words = ["--params", str(file), "--processes", processes, "--duration", "0.5"]
    assert run_graph([*words, "--bag", str(bag)]) == 0
    with (bag / "run_0.mcap").open("rb") as stream:
        reader = make_reader(stream)
        stored = {record.name: record.metadata for record in reader.iter_metadata()}
        summary = reader.get_summary()
    assert summary is not None
    parameters = {node: json.loads(text) for node, text in stored["emir.parameters"].items()}
    assert parameters["cascade_node"]["gain"] == 1.5
    assert parameters["plant_node"]["valve.dead_zone"] == joint1().valve.dead_zone
    assert parameters["plant_node"]["effects.coulomb_friction.force"] == 0.0
    assert parameters["plant_node"]["unnamed_force.friction"] == curve
    effects = "payload mass = 500 kg; unnamed_force"
    assert stored["emir.machine"] == {"effects": effects, "seed": "7"}
    assert {f"effects: {effects}", "seed: 7"} <= set(text(info(bag)).splitlines())
    for channel in summary.channels.values():
        if channel.topic == DIAGNOSTICS:
            continue
        topic = by_name(channel.topic[1:])
        fields = json.loads(channel.metadata["fields"])
        assert {name: entry["unit"] for name, entry in fields.items()} == {
            name: field.unit for name, field in topic.fields.items()
        }
        assert all(entry["meaning"] for entry in fields.values())
    again = tmp_path / "again.yaml"
    again.write_text(parameters_text(info(bag)))
    assert read_parameters(Plan(bag=bag, params=again)) == parameters
    words = ["--params", str(again), "--processes", processes, "--duration", "0.5"]
    assert run_graph([*words, "--bag", str(tmp_path / "again")]) == 0  # it sets up the same run
    assert _raw(tmp_path / "again") == _raw(bag)


def test_a_reader_that_has_seen_enough_gets_no_traceback(tmp_path: Path) -> None:
    """As `emir run ... | head -0` does."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "emir_ros.run", "--duration", "0.5"]
    with os.fdopen(write, "wb") as out:
        finished = subprocess.run(
            [*command, "--bag", str(tmp_path / "run")],
            stdout=out, stderr=subprocess.PIPE, text=True, timeout=120, check=False,
        )  # fmt: skip
    assert finished.returncode == 1
    assert "BrokenPipe" not in finished.stderr
    assert _read_with_rosbags(tmp_path / "run").keys() == CASCADE_TOPICS


def test_two_machines_in_one_domain_do_not_hear_each_other(tmp_path: Path) -> None:
    """Each in its namespace, at the same time: each records what it records alone."""
    short = ["--duration", "2", "--bag"]
    assert run_graph([*short, str(tmp_path / "alone")]) == 0
    gains = {"left": 2.0, "right": 1.0}
    for name, gain in gains.items():
        (tmp_path / f"{name}.yaml").write_text(
            f"cascade_node: {{ros__parameters: {{gain: {gain}}}}}\n"
        )
    commands = {
        name: ["--namespace", name, "--params", str(tmp_path / f"{name}.yaml"), *short]
        for name in gains
    }
    with (
        _started([*commands["left"], str(tmp_path / "left")]) as left,
        _started([*commands["right"], str(tmp_path / "right")]) as right,
    ):
        ends = left.communicate(timeout=120), right.communicate(timeout=120)
    assert left.returncode == right.returncode == 0, ends
    for side in ("alone", *gains):
        place = "" if side == "alone" else f"/{side}"
        said = {(at, name): message for at, name, message in _statuses(tmp_path / side)}
        assert said.keys() == {(0, f"{place}/{name}") for name in NODES}
        assert said[0, f"{place}/cascade_node"] == "running"
    alone = _raw(tmp_path / "alone")
    same_machine, other_gain = _raw(tmp_path / "left"), _raw(tmp_path / "right")
    assert same_machine == {f"/left{topic}": data for topic, data in alone.items()}
    assert other_gain.keys() == {f"/right{topic}" for topic in alone}
    assert other_gain["/right/truth"] != alone["/truth"]


def _statuses(bag: Path) -> list[tuple[int, str, str]]:
    """Log time, node and message of what was said on /diagnostics."""
    with AnyReader([bag]) as reader:
        said = [
            (log_time, status.name, status.message)
            for connection, log_time, data in reader.messages()
            if connection.topic == DIAGNOSTICS
            for status in reader.deserialize(data, connection.msgtype).status  # type: ignore[attr-defined]
        ]
    return sorted(said)


def _raw(bag: Path) -> dict[str, list[bytes]]:
    """The topics of the table, as they stand in the file."""
    found: dict[str, list[bytes]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            if connection.topic == DIAGNOSTICS:
                continue
            found.setdefault(connection.topic, []).append(bytes(data))
    return found


def test_parameters_reach_the_nodes(tmp_path: Path) -> None:
    """A machine with friction and a smaller move, set from one ROS 2 parameter file."""
    file, bag = tmp_path / "params.yaml", tmp_path / "run"
    file.write_text(
        "plant_node:\n  ros__parameters:\n    effects.coulomb_friction.force: 20000.0\n"
        "trajectory_node:\n  ros__parameters: {distance: 0.01, ramp: 0.2, delay: 0.5, pause: 0.5}\n"
    )
    plan = Plan(bag=bag, params=file)
    assert duration(plan) == pytest.approx(0.5 + 2 * (0.01 / 0.025 + 0.2 + 0.5))
    with ros_arguments(plan) as arguments:
        rclpy.init()
        node = PlantNode(arguments)
        assert node.plant.machine.effects.coulomb_friction.force == 20000.0
        assert node.own.duration == pytest.approx(duration(plan))
        node.destroy_node()
        rclpy.shutdown()


def test_plant_says_which_answer_it_waits_for(tmp_path: Path) -> None:
    words = ["--ros-args", "-p", "lockstep:=true", "-p", "patience:=0.5"]
    command = [sys.executable, "-m", "emir_ros.plant_node", *words]
    finished = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert finished.returncode == 1
    assert "plant_node: no valve_command for t = 0.000 s within 0.5 s" in finished.stderr
    assert "Traceback" not in finished.stderr


# helpers


def _emir_run(words: list[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "emir_analysis.cli", "run", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


class _started:  # noqa: N801 (used like a function)
    """`emir run` in the background; killed with its children when the test leaves it alive."""

    def __init__(self, words: list[str]) -> None:
        command = [sys.executable, "-m", "emir_ros.run", *words]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def __enter__(self) -> subprocess.Popen[str]:
        return self.process

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.communicate()


def _children(pid: int) -> Iterator[int]:
    for task in Path(f"/proc/{pid}/task").iterdir():
        yield from map(int, (task / "children").read_text().split())


def _child(parent: int, node: str) -> int:
    for pid in _children(parent):
        if node in Path(f"/proc/{pid}/cmdline").read_text().split("\0"):
            return pid
    pytest.fail(f"{node} is not running")


def _size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


def _is_there(number: int) -> bool:
    """Tell whether a process runs or has not been taken notice of by who started it."""
    return Path(f"/proc/{number}").exists()


def _wait_until(condition: object, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 120.0
    while not condition():  # type: ignore[operator]
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline, "the run does not get on"
