"""What nodes say of themselves in real time: values, lost publishers, deadlines, overrides."""

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from waiting import until

from emir_common.quantity import ParameterError
from emir_msgs_py.topics import JOINT_STATES, VALVE_COMMAND, VELOCITY_COMMAND
from emir_ros.diagnostics import Beat
from emir_ros.force_loop_node import ForceLoopNode
from emir_ros.input_watch import InputWatch
from emir_ros.plant_node import PlantNode
from emir_ros.trajectory_node import TrajectoryNode


class Graph:
    """Nodes in this process and the last values that each has said."""

    def __init__(self, nodes: list[Node]) -> None:
        self.values: dict[str, dict[str, str]] = {}
        self.listener = Node("listener")
        self.listener.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 10)
        self.nodes = nodes
        self.executor = SingleThreadedExecutor()
        for node in (self.listener, *nodes):
            self.executor.add_node(node)

    def _hear(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.values[status.name] = {entry.key: entry.value for entry in status.values}

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until the condition holds."""
        until(condition, lambda: self.executor.spin_once(timeout_sec=0.02), lambda: self.values)

    def lose(self, node: Node) -> None:
        """Let a node die."""
        self.executor.remove_node(node)
        node.destroy_node()
        self.nodes.remove(node)

    def count(self, node: str, key: str) -> int:
        """Return how often a node says that something has happened."""
        return int(self.values.get(f"/{node}", {}).get(key, "0"))


@contextmanager
def _graph(*makes: Callable[[], Node]) -> Iterator[Graph]:
    rclpy.init()
    graph = Graph([make() for make in makes])
    try:
        yield graph
    finally:
        graph.executor.shutdown()
        for node in (graph.listener, *graph.nodes):
            node.destroy_node()
        rclpy.shutdown()


def test_a_beat_knows_jitter_and_missed_periods() -> None:
    beat = Beat(0.1)
    for now in (5.0, 5.1, 5.23, 5.3, 5.7, 5.8):
        beat.tick(now)
    assert beat.values() == {"jitter [ms]": "300.000", "missed periods": "3"}
    beat.tick(5.9)
    assert float(beat.values()["jitter [ms]"]) == pytest.approx(0.0, abs=1e-9)


def test_every_deadline_without_a_message_counts() -> None:
    counts: Counter[str] = Counter()
    times = iter((5.0, 5.05, 5.14, 5.27, 5.33, 5.38, 5.47))
    clock = [0.0]
    watch = InputWatch("t", 0.1, counts, lambda: clock[0], lambda: 1)
    for _ in range(3):
        clock[0] = next(times)
        watch.tick()
    assert not counts
    for missed in (1, 1, 2, 3):  # at 5.24, 5.34 and 5.44
        clock[0] = next(times)
        watch.look()
        assert counts["t: deadline missed"] == missed
    watch.tick()
    clock[0] = 5.56
    watch.look()
    assert counts == {"t: deadline missed": 3}


def test_publishers_that_go_count() -> None:
    counts: Counter[str] = Counter()
    there = [0, 2, 3, 1, 2, 1]
    watch = InputWatch("t", 0.0, counts, lambda: 0.0, iter(there).__next__)
    for _ in there:
        watch.look()
    assert counts == {"t: publisher lost": 3}


def test_diagnostics_hold_what_a_tool_wants_to_show() -> None:
    asked = f"qos_overrides./{VELOCITY_COMMAND.name}.subscription"
    loop = ["--ros-args", "-p", f"{asked}.deadline:=64000000"]
    command = [sys.executable, "-P", "-m", "emir_ros.cascade_node"]
    makes = (PlantNode, TrajectoryNode, lambda: ForceLoopNode(loop))
    with subprocess.Popen(command) as cascade, _graph(*makes) as graph:
        try:
            nodes = ["/cascade_node", *(f"/{node.get_name()}" for node in graph.nodes)]
            regular = {"jitter [ms]", "missed periods"}
            both = {"pressure_lifting [bar]", "pressure_lowering [bar]"}
            graph.until(lambda: all(regular <= graph.values.get(n, {}).keys() for n in nodes))
            graph.until(lambda: both <= graph.values["/force_loop_node"].keys())
            assert both | {"periods saturated"} <= graph.values["/plant_node"].keys()
            lifting = graph.values["/plant_node"]["pressure_lifting [bar]"]
            assert 20.0 < float(lifting) < 250.0
            stale = graph.count("force_loop_node", "periods without fresh inputs")
        finally:
            os.kill(cascade.pid, signal.SIGKILL)
        cascade.wait()
        name = VELOCITY_COMMAND.name
        graph.until(lambda: graph.count("force_loop_node", f"{name}: deadline missed"))
        graph.until(lambda: graph.count("force_loop_node", "periods without fresh inputs") > stale)
        graph.lose(graph.nodes[0])
        lost = f"{JOINT_STATES.name}: publisher lost"
        graph.until(lambda: graph.count("force_loop_node", lost))


def test_a_topics_quality_is_overridden_by_parameters() -> None:
    of = f"qos_overrides./{VALVE_COMMAND.name}.publisher"
    wanted = ("reliability:=best_effort", "durability:=transient_local", "depth:=3")
    words = [f"{of}.{entry}" for entry in wanted]
    given = ["--ros-args", *(word for entry in words for word in ("-p", entry))]
    with _graph(lambda: ForceLoopNode(given)) as graph:
        there = graph.listener.get_publishers_info_by_topic
        graph.until(lambda: there(VALVE_COMMAND.name))
        (info,) = there(VALVE_COMMAND.name)
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert graph.nodes[0].get_parameter(f"{of}.depth").value == 3


UNKNOWN = {
    "quality": ("/valve_command.publisher.depht", "no such quality; there are publisher.deadline"),
    "end": ("/valve_command.subscriber.depth", "no such quality; there are publisher.deadline"),
    "topic": ("/valve.publisher.depth", "no such topic; there are /boom_deflection"),
    "form": ("/valve_command", "no such quality; there are publisher.deadline"),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_an_override_of_what_nobody_has_is_told(case: str) -> None:
    name, said = UNKNOWN[case]
    words = ["--ros-args", "-p", f"qos_overrides.{name}:=3"]
    with _graph(), pytest.raises(ParameterError) as caught:
        ForceLoopNode(words)
    assert f"force_loop_node: qos_overrides.{name}: there is {said}" in str(caught.value)


@pytest.mark.parametrize(
    ("policy", "value", "said"),
    [
        ("depth", "-3", "-3: not a whole number of 1 ... 2147483647"),
        ("depth", "0", "0: not a whole number"),
        ("depth", "9999999999999", "9999999999999: not a whole number"),
        ("depth", "1.5", "1.5: not a whole number"),
        ("deadline", "-5", "-5: not a whole number of 0 ... "),
        ("liveliness_lease_duration", "soon", "'soon': not a whole number"),
        ("reliability", "perhaps", "'perhaps': there are .*best_effort"),
        ("history", "unknown", "'unknown': there are .*keep_last"),
        ("durability", "3", "3: there are .*volatile"),
    ],
)
def test_an_override_that_cannot_be_is_told_before_the_middleware_does(
    policy: str, value: str, said: str, capfd: pytest.CaptureFixture[str]
) -> None:
    name = f"qos_overrides./{VALVE_COMMAND.name}.publisher.{policy}"
    words = ["--ros-args", "-p", f"{name}:={value}"]
    with _graph(), pytest.raises(ParameterError, match=f"^force_loop_node: {name} = {said}"):
        ForceLoopNode(words)
    assert capfd.readouterr().err == ""


def test_an_override_may_be_given_to_nodes_without_the_topic() -> None:
    """As `/**` of a parameter file does; the topic's name is that in the nodes' namespace."""
    of = "qos_overrides./left/truth.publisher"
    words = ["--ros-args", "-r", "__ns:=/left", "-p", f"{of}.depth:=3"]
    with _graph(lambda: ForceLoopNode(words), lambda: PlantNode(words)) as graph:
        assert graph.nodes[1].get_parameter(f"{of}.depth").value == 3


def test_lock_step_takes_no_override() -> None:
    name = f"qos_overrides./{VALVE_COMMAND.name}.publisher.depth"
    words = ["--ros-args", "-p", "lockstep:=true", "-p", f"{name}:=3"]
    with _graph(), pytest.raises(ParameterError, match=f"{name}: fixed in lock step"):
        ForceLoopNode(words)
