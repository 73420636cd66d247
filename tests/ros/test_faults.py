"""docs/faults.md, row by row: what is not already shown by test_safety, test_graph, test_recover.

Faults of time and transport are driven by /clock, so that the computer's load has no part in them.
"""

import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosbags.highlevel import AnyReader
from sim_clock import SIM_TIME, SimClock
from waiting import DEADLINE, until

from emir_analysis.recover import recover
from emir_msgs_py import conversions
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    CYLINDER_REFERENCE,
    CYLINDER_STATES,
    JOINT_STATES,
    OFFERED_COMMANDS,
    PLANT_PERIOD_NS,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
    Topic,
)
from emir_ros import qos
from emir_ros.force_loop_node import TIMEOUT, ForceLoopNode
from emir_ros.selector_node import SelectorNode
from emir_ros.trajectory_node import TrajectoryNode

HOUR = 3600 * 1_000_000_000
SENSORS = (JOINT_STATES, PRESSURE_LIFTING, PRESSURE_LOWERING)
INPUTS = (VELOCITY_COMMAND, *SENSORS)
OFFERED = OFFERED_COMMANDS["cascade"]
SIGNALS = {
    "velocity_command": 0.02,
    "cascade_command": 0.02,
    "pfc_command": 0.01,
    "angle": 0.8,
    "pressure_lifting": 1e7,
    "pressure_lowering": 2e6,
}


class Bench:
    """The force loop on a test bench: time and inputs are given to it, its commands heard."""

    def __init__(
        self, executor: SingleThreadedExecutor, *commands: Topic, before: Sequence[Node] = ()
    ) -> None:
        """commands: what it is given; before: nodes that make its command of that."""
        self.loop = ForceLoopNode(SIM_TIME)
        self._nodes = [self.loop, *before]
        self.inputs = (*(commands or [VELOCITY_COMMAND]), *SENSORS)
        self.node = Node("bench")
        self.valve: list[float] = []
        profile = qos.offered(lockstep=False)
        self._inputs = {
            topic.name: self.node.create_publisher(
                conversions.message_class(topic.type), topic.name, profile
            )
            for topic in self.inputs
        }
        kind = conversions.message_class(VALVE_COMMAND.type)
        self.node.create_subscription(kind, VALVE_COMMAND.name, self._on_valve, profile)
        self._executor = executor
        for node in (*self._nodes, self.node):
            self._executor.add_node(node)
        self._clock = SimClock(self.node, self._executor)
        self.until(self._connected)

    def _connected(self) -> bool:
        return all(p.get_subscription_count() for p in self._inputs.values())

    def _on_valve(self, message: Any) -> None:
        self.valve.append(conversions.values(VALVE_COMMAND, message)["valve_command"])

    def until(self, condition: Callable[[], object]) -> None:
        """Spin until the condition holds."""
        until(condition, lambda: self._executor.spin_once(timeout_sec=0.01))

    def tick(self, inputs: Any = None, step: int = PLANT_PERIOD_NS) -> None:
        """Let time go on by a step, ns, and then give the inputs, all unless said otherwise."""
        self._clock.advance(self._nodes, step)
        for topic in self.inputs if inputs is None else inputs:
            self._inputs[topic.name].publish(conversions.message(topic, self._clock.now, SIGNALS))
        self._clock.settle()

    def empty(self, topic: Topic) -> None:
        """Publish a message of a topic that holds no numbers."""
        self._inputs[topic.name].publish(conversions.message_class(topic.type)())

    def settle(self) -> None:
        """Run until the valve opens."""
        until(lambda: self.valve and self.valve[-1] > 0.0, self.tick)


@pytest.fixture
def bench(executor: SingleThreadedExecutor) -> Bench:
    made = Bench(executor)
    made.settle()
    return made


def test_one_message_in_twenty_lost_changes_nothing(bench: Bench) -> None:
    """Sensors come four times a period, a command is kept: the valve never shuts."""
    before = len(bench.valve)
    for k in range(80):
        lost = INPUTS[(k // 5) % len(INPUTS)] if k % 5 == 0 else None
        bench.tick([topic for topic in INPUTS if topic is not lost])
    assert before + 15 < len(bench.valve) < before + 23  # a command each period
    assert min(bench.valve[before:]) > 0.0


@pytest.mark.parametrize("command", [VELOCITY_COMMAND, OFFERED], ids=lambda topic: topic.name)
def test_a_command_is_acted_on_when_it_comes(
    command: Topic, executor: SingleThreadedExecutor
) -> None:
    """Also by way of the selector: timers on the way would delay it by up to a period each."""
    chosen = [*SIM_TIME, "-p", "controllers:=[cascade]"]
    selectors = [SelectorNode(chosen)] if command is OFFERED else []
    bench = Bench(executor, command, before=selectors)
    bench.settle()
    for k in range(40):
        before = len(bench.valve)
        bench.tick(bench.inputs if k % 4 == 1 else SENSORS)
        if k < 16:  # until then it was given more commands than are due
            continue
        if k % 4 == 1:
            bench.until(lambda before=before: len(bench.valve) > before)  # time stands still
        assert len(bench.valve) == before + (k % 4 == 1)


def test_commands_late_by_100_ms_shut_the_valve_and_open_it_when_they_come(bench: Bench) -> None:
    late = [topic for topic in INPUTS if topic is not VELOCITY_COMMAND]
    silent = 0
    while bench.valve[-1] != 0.0:
        assert silent * PLANT_PERIOD_NS < TIMEOUT * 1e9 + CONTROL_PERIOD_NS
        bench.tick(late)
        silent += 1
    for _ in range(round(0.1e9 / PLANT_PERIOD_NS) - silent):
        bench.tick(late)
        assert bench.valve[-1] == 0.0
    before = len(bench.valve)
    while bench.valve[-1] == 0.0:
        assert len(bench.valve) < before + 3
        bench.tick()


def test_the_reference_stops_where_the_machine_does_not_follow(
    executor: SingleThreadedExecutor,
) -> None:
    """It would else be caught up with at full speed once the valve may open again."""
    far = [w for value in ("distance:=0.5", "speed:=0.1", "delay:=0.0") for w in ("-p", value)]
    node, operator = TrajectoryNode([*SIM_TIME, *far]), Node("operator")
    for each in (node, operator):
        executor.add_node(each)
    clock, wanted = SimClock(operator, executor), CYLINDER_REFERENCE
    heard: list[dict[str, float]] = []
    profile = qos.offered(lockstep=False)
    kind = conversions.message_class(CYLINDER_STATES.type)
    states = operator.create_publisher(kind, CYLINDER_STATES.name, profile)
    operator.create_subscription(
        kind,
        wanted.name,
        lambda message: heard.append(conversions.values(wanted, message)),
        profile,
    )
    still = dict.fromkeys(CYLINDER_STATES.fields, 0.0) | {"stroke": 0.4}

    def go_on() -> None:
        clock.advance([node])
        states.publish(conversions.message(CYLINDER_STATES, clock.now, still))
        clock.settle()

    def run(condition: Callable[[], object]) -> None:
        until(condition, go_on)

    try:
        run(lambda: heard)
        node.start()
        run(lambda: heard[-1]["reference_stroke"] > 0.45)
        run(lambda: heard[-1]["reference_velocity"] == 0.0)
        farthest = max(entry["reference_stroke"] for entry in heard)
        assert 0.5 < farthest < 0.5 + 0.1 * 2.0 * CONTROL_PERIOD_NS * 1e-9
        stopped = len(heard)
        run(lambda: len(heard) > stopped + 20)
        assert all(entry["reference_stroke"] == 0.4 for entry in heard[stopped:])
        assert "did not follow" in node.caution({})
        node.start()
        run(lambda: heard[-1]["reference_velocity"] > 0.0)
        assert not node.caution({})
    finally:
        for each in (node, operator):
            each.destroy_node()


def test_who_is_chosen_takes_over_from_a_dead_controller(executor: SingleThreadedExecutor) -> None:
    """The one that drove need not come back, nor be waited for."""
    selector = SelectorNode([*SIM_TIME, "-p", "controllers:=[cascade, pfc]"])
    bench = Bench(executor, OFFERED, OFFERED_COMMANDS["pfc"], before=[selector])
    bench.settle()
    alive = [topic for topic in bench.inputs if topic is not OFFERED]
    until(lambda: bench.valve[-1] == 0.0, lambda: bench.tick(alive))
    assert selector.chosen == "cascade"
    selector.set_parameters([Parameter("controller", value="pfc")])
    until(lambda: bench.valve[-1] != 0.0, lambda: bench.tick(alive))
    assert selector.chosen == "pfc"


def test_a_refused_set_changes_nothing(ros: None) -> None:
    """All or none: what is set together with a parameter that is refused is not in force."""
    selector = SelectorNode([*SIM_TIME, "-p", "controllers:=[cascade, pfc]"])
    both = [Parameter("controller", value="pfc"), Parameter("use_sim_time", value=False)]
    assert not selector.set_parameters_atomically(both).successful
    assert selector.chosen == selector.wanted == "cascade"
    assert selector.get_parameter("controller").value == "cascade"
    selector.destroy_node()


def test_two_machines_at_once_shut_the_valve(bench: Bench) -> None:
    """Sensors that two nodes publish are those of neither."""
    kind = conversions.message_class(JOINT_STATES.type)
    second = bench.node.create_publisher(kind, JOINT_STATES.name, qos.offered(lockstep=False))
    until(lambda: bench.valve[-1] == 0.0, bench.tick)
    bench.node.destroy_publisher(second)
    bench.settle()


def test_a_message_without_its_number_counts_as_none(bench: Bench) -> None:
    """It ends no node; without another command the valve shuts, and opens when one comes."""
    others = [topic for topic in INPUTS if topic is not VELOCITY_COMMAND]

    def go_on() -> None:
        bench.empty(VELOCITY_COMMAND)
        bench.tick(others)

    until(lambda: bench.valve[-1] == 0.0, go_on)
    assert bench.loop.failure is None
    assert bench.loop.diagnostics.counts["messages of another form"] > 0
    bench.settle()


@pytest.mark.parametrize("jump", [-HOUR // 2, HOUR], ids=["back", "forward"])
def test_a_jump_of_the_clock_shuts_the_valve_until_inputs_are_new(bench: Bench, jump: int) -> None:
    """What was heard before the jump is not trusted, also where its time is still to come."""
    bench.tick([], jump)
    before = len(bench.valve)
    for _ in range(8):
        bench.tick([])
    assert len(bench.valve) > before + 1
    assert not any(bench.valve[before + 1 :])
    bench.settle()
    assert bench.valve[-1] > 0.0


def test_a_stranger_on_the_commands_topic_shuts_the_valve(bench: Bench) -> None:
    """Somebody publishes text under the command's name: not taken for it, and not ignored."""
    script = (
        "import rclpy; from std_msgs.msg import String; rclpy.init();"
        "node = rclpy.create_node('stranger');"
        "publisher = node.create_publisher(String, 'velocity_command', 10);"
        "node.create_timer(0.01, lambda: publisher.publish(String(data='faster')));"
        "rclpy.spin(node)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL) as stranger:
        try:
            until(lambda: bench.valve[-1] == 0.0, bench.tick)
            stranger.send_signal(signal.SIGINT)  # it says goodbye; one killed is missed after 20 s
            bench.settle()
        finally:
            stranger.kill()
    assert bench.valve[-1] > 0.0


def test_a_full_disk_ends_the_recording_and_keeps_it(tmp_path: Path) -> None:
    """A limit on the file's size stands for the end of the disk; the system says the same."""
    bag, limit = tmp_path / "run", 400_000
    command = [sys.executable, "-m", "emir_ros.run", "--duration", "60", "--bag", str(bag)]
    finished = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert finished.returncode == 1
    (line,) = [line for line in finished.stderr.splitlines() if "recording ended" in line]
    assert line.startswith(f"emir run: recorder_node: {bag}/run_0.mcap: File too large")
    assert "Traceback" not in finished.stderr
    saved = recover(bag, tmp_path / "whole")
    assert saved.messages > 0
    with AnyReader([tmp_path / "whole"]) as reader:
        assert reader.message_count == saved.messages
        times = sorted(time for c, time, _ in reader.messages() if c.topic == "/truth")
    assert times == list(range(0, times[-1] + 1, PLANT_PERIOD_NS))  # nothing lost before


def test_a_node_that_cannot_end_well_keeps_no_other_from_it(tmp_path: Path) -> None:
    """All in one process: the machine is left in order, and the failure is one line."""
    script = (
        "import sys; from emir_ros.run import main; from emir_ros.shell import NodeError\n"
        "from emir_ros.plant_node import PlantNode\n"
        "from emir_ros.recorder_node import RecorderNode\n"
        "def fail(self): raise NodeError('recorder_node: disk full')\n"
        "RecorderNode.close = fail\n"
        "PlantNode.close = lambda self: print('the machine has ended')\n"
        "sys.exit(main(['--duration', '0.1', '--bag', sys.argv[1]]))"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "run")]
    finished = subprocess.run(
        command, capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert finished.returncode == 1
    assert "the machine has ended" in finished.stdout
    assert "emir run: recorder_node: disk full" in finished.stderr.splitlines()
    assert "Traceback" not in finished.stderr


def test_memory_stays_flat_in_lock_step(tmp_path: Path) -> None:
    """Between 10 s and 40 s of the run, by the recording's size, it grows by less than 1 %."""
    file = tmp_path / "run" / "run_0.mcap"
    command = [sys.executable, "-m", "emir_ros.run", "--duration", "600", "--bag", str(file.parent)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            used = []
            for size in (1_500_000, 6_000_000):
                deadline = time.monotonic() + DEADLINE
                while not file.exists() or file.stat().st_size < size:
                    assert process.poll() is None
                    assert time.monotonic() < deadline
                used.append(_resident(process.pid))
        finally:
            process.kill()
    assert used[1] < 1.01 * used[0]


def _resident(pid: int) -> int:
    """Return the memory that a process holds, in pages."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1])
