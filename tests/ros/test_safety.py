"""What the graph does when a node dies, a number is none, two command at once, one is switched.

Time comes from /clock or from lock step, so that the computer's load has no part in what is seen;
only a process that is killed has the computer's own.
"""

import math
import os
import signal
import subprocess
import sys
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
from rclpy.parameter import Parameter
from sim_clock import SIM_TIME, SimClock
from waiting import until

from emir_control.limits import LimitParameters
from emir_control.prefilter import PrefilterParameters, joint_angle
from emir_msgs_py import conversions
from emir_msgs_py.topics import (
    CONTROL_PERIOD_NS,
    CYLINDER_REFERENCE,
    JOINT_STATES,
    PRESSURE_LIFTING,
    PRESSURE_LOWERING,
    TRUTH,
    VALVE_COMMAND,
    VELOCITY_COMMAND,
    Topic,
)
from emir_plant.plant import SimulationError
from emir_ros import qos
from emir_ros.cascade_node import CascadeNode
from emir_ros.diagnostics import Level
from emir_ros.force_loop_node import ForceLoopNode
from emir_ros.lqg_node import LqgNode
from emir_ros.pfc_node import PfcNode
from emir_ros.plant_node import PlantNode
from emir_ros.selector_node import SelectorNode
from emir_ros.shell import NodeError, Shell
from emir_ros.trajectory_node import TrajectoryNode

AT_ONCE = ["--ros-args", "-p", "delay:=0.2"]
LOCKSTEP = ["--ros-args", "-p", "lockstep:=true"]
CASCADED: tuple[Callable[[], Node], ...] = (
    lambda: PlantNode(SIM_TIME),
    lambda: TrajectoryNode([*SIM_TIME, "-p", "delay:=0.2"]),
    lambda: CascadeNode(SIM_TIME),
    lambda: ForceLoopNode(SIM_TIME),
)
INPUTS = (
    (VELOCITY_COMMAND, {"velocity_command": 0.02}),
    (JOINT_STATES, {"angle": 0.8}),
    (PRESSURE_LIFTING, {"pressure_lifting": 1e7}),
    (PRESSURE_LOWERING, {"pressure_lowering": 2e6}),
)


class Listener(Node):
    """Hears commands and diagnostics, in the order in which they come."""

    def __init__(self, *, lockstep: bool) -> None:
        super().__init__("listener")
        self.heard: list[tuple[str, float, int]] = []  # topic, value, stamp in ns
        self.said: list[tuple[str, bytes, str]] = []
        self._profile = qos.offered(lockstep=lockstep)
        for topic in (VELOCITY_COMMAND, VALVE_COMMAND):
            self._hear(topic, *topic.fields)
        self._hear(TRUTH, "spool")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def _hear(self, topic: Topic, signal: str) -> None:
        def receive(message: Any) -> None:
            value = conversions.values(topic, message)[signal]
            self.heard.append((topic.name, value, conversions.stamp_ns(message)))

        kind = conversions.message_class(topic.type)
        self.create_subscription(kind, topic.name, receive, self._profile)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.said += [(status.name, status.level, status.message) for status in message.status]

    def publisher(self, topic: Topic) -> Any:
        """Return a publisher of a topic as the graph's nodes have it."""
        return self.create_publisher(
            conversions.message_class(topic.type), topic.name, self._profile
        )

    def of(self, topic: Topic) -> list[float]:
        """Return the values heard of a topic."""
        return [value for name, value, _ in self.heard if name == topic.name]

    def complaints(self) -> list[str]:
        """Return the errors said, each once, with the node that said it."""
        return list(dict.fromkeys(f"{n}: {text}" for n, level, text in self.said if level == b"\2"))


class Graph:
    """Nodes in this process, spun while a condition is waited for."""

    def __init__(
        self, nodes: list[Node], *, lockstep: bool = False, sim_time: bool = False
    ) -> None:
        self.listener = Listener(lockstep=lockstep)
        self.nodes: list[Node] = []
        self.executor = SingleThreadedExecutor()
        self._clock = SimClock(self.listener, self.executor) if sim_time else None
        for node in (self.listener, *nodes):
            self.add(node)

    def node(self, name: str) -> Node:
        """Return the node of a name."""
        (found,) = (node for node in self.nodes if node.get_name() == name)
        return found

    def spool(self) -> float:
        """Return where the valve's spool was heard to be last."""
        return ([0.0, *self.listener.of(TRUTH)])[-1]

    def add(self, node: Node) -> None:
        """Let a node join."""
        self.nodes.append(node)
        self.executor.add_node(node)

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Spin until the condition holds."""
        until(condition, self._go_on, lambda: f"{what}; {self.listener.said}")

    def _go_on(self) -> None:
        self._spin()
        for node in self.nodes:
            if isinstance(node, Shell):
                node.check()

    def _spin(self) -> None:
        if self._clock is None:
            self.executor.spin_once(timeout_sec=0.02)
            return
        self._clock.advance([node for node in self.nodes if isinstance(node, Shell)])
        self._clock.settle()

    def lose(self, node: Node) -> None:
        """Let a node die."""
        self.executor.remove_node(node)
        node.destroy_node()
        self.nodes.remove(node)


@contextmanager
def _graph(
    *makes: Callable[[], Node], lockstep: bool = False, sim_time: bool = False
) -> Iterator[Graph]:
    rclpy.init()
    graph = Graph([make() for make in makes], lockstep=lockstep, sim_time=sim_time)
    try:
        yield graph
    finally:
        graph.executor.shutdown()
        for node in graph.nodes:
            node.destroy_node()
        rclpy.shutdown()


def _moves(graph: Graph) -> Callable[[], bool]:
    return lambda: max(graph.listener.of(VALVE_COMMAND), default=0.0) > 0.3


def test_a_killed_controller_shuts_the_valve_within_a_period_and_it_is_said() -> None:
    command = [sys.executable, "-P", "-m", "emir_ros.cascade_node"]
    with subprocess.Popen(command) as cascade, _graph(PlantNode, ForceLoopNode) as graph:
        try:
            there = graph.listener.count_subscribers
            graph.until(lambda: there(CYLINDER_REFERENCE.name) > 0, "the controller is not there")
            graph.add(TrajectoryNode(AT_ONCE))
            graph.until(_moves(graph), "the machine does not move")
        finally:
            os.kill(cascade.pid, signal.SIGKILL)
        cascade.wait()
        valve = graph.listener.of
        graph.until(lambda: valve(VALVE_COMMAND)[-1] == 0.0, "the valve stays open")
        told = [heard for heard in graph.listener.heard if heard[0] == VALVE_COMMAND.name]
        force_loop = next(node for node in graph.nodes if isinstance(node, ForceLoopNode))
        last, _ = force_loop._latest[VELOCITY_COMMAND.name]  # by the clock that stamps the valve's
        still_open = [stamp - last.nanoseconds for _, value, stamp in told if value != 0.0]
        # the period of the last command, and that in which the next was due
        assert max(still_open) < 2 * CONTROL_PERIOD_NS
        said = "/force_loop_node: valve shut: no fresh velocity_command"
        graph.until(lambda: said in graph.listener.complaints(), "nothing is said")


def test_a_controller_restarted_while_it_moves_takes_the_motion_up_again() -> None:
    with _graph(*CASCADED, sim_time=True) as graph:
        graph.until(_moves(graph), "the machine does not move")
        graph.lose(graph.node("cascade_node"))
        graph.until(lambda: graph.listener.of(VALVE_COMMAND)[-1] == 0.0, "the valve stays open")
        graph.add(CascadeNode(SIM_TIME))
        graph.until(lambda: graph.listener.of(VALVE_COMMAND)[-1] > 0.3, "it does not go on")
        heard = graph.listener.of(VALVE_COMMAND)
        first = max(k for k, value in enumerate(heard) if value == 0.0)
        assert heard[first + 1] < 1.0  # not at full stroke at once


@pytest.mark.parametrize(
    ("victim", "again"), [("trajectory_node", TrajectoryNode), ("force_loop_node", ForceLoopNode)]
)
def test_any_other_node_restarted_while_it_moves_takes_the_motion_up_again(
    victim: str, again: Callable[[list[str]], Node]
) -> None:
    with _graph(*CASCADED, sim_time=True) as graph:
        graph.until(_moves(graph), "the machine does not move")
        graph.until(lambda: graph.spool() > 0.2, "the spool does not move")
        graph.lose(graph.node(victim))
        graph.until(lambda: abs(graph.spool()) < 0.01, "the valve stays open")
        before = len(graph.listener.of(VALVE_COMMAND))
        graph.add(again(SIM_TIME))
        graph.until(lambda: graph.spool() > 0.2, "it does not go on")
        assert max(graph.listener.of(VALVE_COMMAND)[before:]) < 1.0  # not at full stroke at once


def test_a_dead_force_loop_shuts_the_valve_in_the_machine() -> None:
    with _graph(*CASCADED, sim_time=True) as graph:
        graph.until(_moves(graph), "the machine does not move")
        graph.until(lambda: graph.spool() > 0.2, "the spool does not move")
        graph.lose(graph.node("force_loop_node"))
        graph.until(lambda: abs(graph.spool()) < 0.1, "the spool stays where it was")
        said = "/plant_node: valve shut: no fresh valve_command"
        graph.until(lambda: said in graph.listener.complaints(), "nothing is said")


def test_two_controllers_at_once_shut_the_valve_until_one_is_gone() -> None:
    with _graph(*CASCADED, lambda: PfcNode(SIM_TIME), sim_time=True) as graph:
        valve = graph.listener.of
        said = "/force_loop_node: valve shut: more than one node publishes velocity_command"
        graph.until(lambda: said in graph.listener.complaints(), "nothing is said")
        before = len(valve(VALVE_COMMAND))
        graph.until(lambda: len(valve(VALVE_COMMAND)) > before + 5, "no valve command")
        assert not any(valve(VALVE_COMMAND)[before:])
        graph.lose(graph.node("pfc_node"))
        graph.until(lambda: valve(VALVE_COMMAND)[-1] > 0.3, "the machine does not move with one")


def test_a_switch_by_parameter_while_it_moves_goes_without_a_jump() -> None:
    """In lock step: on a busy computer the valve may shut in real time, which is a jump."""
    ready = [*LOCKSTEP, "-p", "standby:=true"]
    chosen = [*LOCKSTEP, "-p", "controllers:=[cascade, pfc]"]
    with _graph(
        lambda: TrajectoryNode([*LOCKSTEP, "-p", "delay:=0.2"]),
        lambda: CascadeNode(ready),
        lambda: PfcNode(ready),
        lambda: SelectorNode(chosen),
        lambda: ForceLoopNode(LOCKSTEP),
        lambda: PlantNode(LOCKSTEP),
        lockstep=True,
    ) as graph:
        selector = graph.nodes[4]
        graph.until(lambda: max(graph.listener.of(VELOCITY_COMMAND), default=0.0) > 0.02, "slow")
        (refused,) = selector.set_parameters([Parameter("controller", value="magic")])
        assert not refused.successful
        assert refused.reason == "selector_node: controller 'magic': running are cascade, pfc"
        before = len(graph.listener.of(VELOCITY_COMMAND))
        (done,) = selector.set_parameters([Parameter("controller", value="pfc")])
        assert done.successful
        graph.until(
            lambda: (
                any(text == "pfc drives the machine" for *_, text in graph.listener.said)
                and len(graph.listener.of(VELOCITY_COMMAND)) > before + 3
            ),
            "nothing is said",
        )
        command = graph.listener.of(VELOCITY_COMMAND)[before - 2 :]
        assert min(command) > 0.015
        assert np.abs(np.diff(command)).max() < 0.006  # begun cold it falls by 0.02


@pytest.mark.parametrize("bad", [name for _, (name,) in INPUTS])
def test_a_number_that_is_none_shuts_the_valve_in_its_period(bad: str) -> None:
    with _graph(lambda: ForceLoopNode(LOCKSTEP), lockstep=True) as graph:
        publishers = [graph.listener.publisher(topic) for topic, _ in INPUTS]
        for k in range(3):
            for publisher, (topic, signals) in zip(publishers, INPUTS, strict=True):
                given = dict.fromkeys(signals, math.nan) if k == 1 and bad in signals else signals
                publisher.publish(conversions.message(topic, k * CONTROL_PERIOD_NS, given))
            graph.until(lambda k=k: len(graph.listener.of(VALVE_COMMAND)) > k, "no valve command")
        first, second, third = graph.listener.of(VALVE_COMMAND)
        assert first > 0.0
        assert second == 0.0
        assert third > 0.0
        said = f"/force_loop_node: valve shut: {bad} is not a number"
        graph.until(lambda: said in graph.listener.complaints(), "nothing is said")


def test_a_command_that_comes_twice_ends_a_run_in_lock_step() -> None:
    with _graph(lambda: ForceLoopNode(LOCKSTEP), lockstep=True) as graph:
        publisher = graph.listener.publisher(VELOCITY_COMMAND)
        for _ in range(2):
            publisher.publish(conversions.message(VELOCITY_COMMAND, 0, {"velocity_command": 0.02}))
        with pytest.raises(NodeError, match=r"velocity_command came twice for t = 0\.000 s"):
            graph.until(lambda: False, "nothing is said")


def test_a_machine_that_fails_in_a_step_says_which_node_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with _graph(lambda: PlantNode(LOCKSTEP), lockstep=True) as graph:
        plant = graph.nodes[1]
        assert isinstance(plant, PlantNode)

        def advance(_command: object, _dt: float) -> None:
            raise SimulationError("the state is not finite")

        monkeypatch.setattr(plant.machine, "step", advance)
        publisher = graph.listener.publisher(VALVE_COMMAND)
        publisher.publish(conversions.message(VALVE_COMMAND, 0, {"valve_command": 0.5}))
        with pytest.raises(NodeError, match=r"^plant_node: the state is not finite$"):
            graph.until(lambda: False, "nothing is said")


def test_lqg_says_that_it_is_held_off_the_end_of_the_stroke(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Standing at the end, told of a move beyond it: planned to stay, and said."""
    with _graph(lambda: LqgNode(LOCKSTEP), lockstep=True) as graph:
        node = graph.nodes[1]
        assert isinstance(node, LqgNode)
        said: list[tuple[Level, str]] = []
        monkeypatch.setattr(node.diagnostics, "say", lambda *words: said.append(words))
        limits = LimitParameters()
        line = limits.stroke_high - limits.end_margin
        signals = {"reference_stroke": line, "angle": joint_angle(line, PrefilterParameters())}
        signals |= {"pressure_lifting": 20e5, "pressure_lowering": 20e5, "deflection": 0.0}
        for distance, since in ((0.0, -9.0), (0.05, -0.5)):
            move = {"move_since": since, "move_duration": 3.3, "move_distance": distance}
            node._run(0, [signals | move])
        move["move_since"] = 0.5
        node._run(0, [signals | move])
        assert said[0] == (Level.OK, "running")
        assert said[-1] == (Level.WARN, "held off the end of the stroke")
